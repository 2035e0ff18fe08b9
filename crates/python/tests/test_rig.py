"""Rigs and fleets: the files of the command line, to the byte."""

import filecmp
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import depthcal


@pytest.fixture(scope="session")
def command_line(cache):
    binary = Path(os.environ.get("DEPTHCAL_BIN", ""))
    if not binary.is_file():
        print("SKIPPED: comparison with the command line; DEPTHCAL_BIN names no program")
        pytest.skip("DEPTHCAL_BIN names no program")

    def run(*arguments):
        done = subprocess.run([binary, *map(str, arguments)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done

    return run


@pytest.fixture(scope="module")
def rig_folder(command_line, tmp_path_factory):
    """A rendered rig: infrared with depth, and colour; its markers are in the cache, where both callers find them."""
    out = tmp_path_factory.mktemp("rig") / "captures"
    command_line("simulate", "--rig", "infrared,colour", "--frames", 10, "--seed", 3, "--out", out)
    command_line("calibrate", out, "--hold-out", "4", "--out", out.parent / "calibrated")
    return out


@pytest.fixture(scope="module")
def rig(rig_folder):
    return depthcal.load(rig_folder)


@pytest.fixture(scope="module")
def rig_fit(rig):
    return depthcal.calibrate(rig, hold_out=4)


def equal(one, other, *names):
    for name in names:
        assert (one / name).stat().st_size > 100 and filecmp.cmp(one / name, other / name, shallow=False), name


def test_a_rig_is_calibrated_as_by_the_command_line(rig, rig_fit, rig_folder, tmp_path):
    assert rig.cameras == ["infrared", "colour"] and len({row.name for row in rig.frames}) >= 8
    assert {row.camera for row in rig.frames} == set(rig.cameras) and "of infrared, colour" in repr(rig)
    one = rig.camera("colour")
    assert one.cameras == ["colour"] and one.size == (1280, 720) and one.unit_mm is None
    with pytest.raises(depthcal.InputError, match="several cameras, infrared, colour"):
        rig.size  # noqa: B018
    rig_fit.save(tmp_path)
    equal(tmp_path, rig_folder.parent / "calibrated", "calibration.json", "evaluation.json")
    assert "<html" in rig_fit.report.html
    both = {(row.source, row.target) for row in rig_fit.transfers}
    assert both == {("infrared", "colour")} and all(0 < row.rms_px < 2 for row in rig_fit.transfers)
    colour = rig_fit.calibration.camera("colour")
    assert rig_fit.calibration.cameras == rig.cameras and colour.cameras == []
    assert colour.matrix[0, 0] != rig_fit.calibration.matrix[0, 0]
    with pytest.raises(depthcal.InputError, match="it has infrared, colour"):
        rig_fit.calibration.camera("thermal")
    validated = depthcal.calibrate(rig, cross_validate=3)
    assert sum("cross-validated" in row.dataset for row in validated.errors) == 2


def test_names_of_an_earlier_release_warn(rig_folder):
    with pytest.warns(DeprecationWarning, match="depthcal.load_rig is depthcal.load now"):
        rig = depthcal.load_rig(rig_folder)
    assert isinstance(rig, depthcal.Rig) and depthcal.calibrate_rig.__name__ == "calibrate_rig"
    assert rig.frames[0].frame == rig.frames[0].name


def test_a_rig_is_evaluated_as_by_the_command_line(command_line, rig, rig_fit, rig_folder, tmp_path):
    path = rig_folder.parent / "calibrated" / "calibration.json"
    command_line("evaluate", path, rig_folder, "--out", tmp_path / "cli")
    evaluation = depthcal.evaluate(depthcal.Calibration.load(path), rig)
    evaluation.save(tmp_path / "python")
    equal(tmp_path / "python", tmp_path / "cli", "evaluation.json")
    assert len(evaluation.datasets) == 2 and evaluation.transfers[0].rms_px > 0
    one = depthcal.Calibration.load(path).camera("infrared")
    with pytest.raises(depthcal.InputError):
        depthcal.evaluate(one, rig)


def test_a_rig_is_diagnosed_as_by_the_command_line(command_line, rig, rig_folder, tmp_path):
    command_line("diagnose", rig_folder, "--no-discovery", "--out", tmp_path / "cli")
    diagnosis = depthcal.diagnose(rig, discovery=False)
    written = diagnosis.save(tmp_path / "python")
    assert all(path.is_file() for path in written)
    equal(tmp_path / "python", tmp_path / "cli", "diagnosis.json", "calibration.json", "evaluation.json")
    own = ["diagnosis.json", "calibration.json", "evaluation.json", "observations.json", "scores.json"]
    equal(tmp_path / "python", tmp_path / "cli", *(f"infrared/{name}" for name in own))
    assert list(diagnosis.cameras) == ["infrared"] and diagnosis.record["without_depth"] == ["colour"]
    assert diagnosis.verdict == diagnosis.cameras["infrared"].verdict and "[infrared]" in repr(diagnosis)
    assert len(diagnosis.cameras["infrared"].candidates) > 10 and len(diagnosis.transfers) > 0
    with pytest.raises(depthcal.InputError, match="several cameras"):
        diagnosis.steps  # noqa: B018
    assert diagnosis.calibration.cameras == rig.cameras and "<html" in diagnosis.report.html
    with pytest.raises(depthcal.InputError, match="folds"):
        depthcal.diagnose(rig, folds=1)


def test_depth_is_registered_as_by_the_command_line(command_line, rig_folder, tmp_path):
    cv2 = pytest.importorskip("cv2", reason="SKIPPED: registration; OpenCV is not installed")
    path = rig_folder.parent / "calibrated" / "calibration.json"
    command_line("apply", path, rig_folder, "--register", "colour", "--out", tmp_path / "cli")
    calibration = depthcal.Calibration.load(path)
    onto_colour = depthcal.Registration(calibration, "infrared", "colour")
    names = sorted(p.name for p in (tmp_path / "cli" / "infrared_in_colour").glob("*.png"))
    assert names
    for name in names[:2]:
        depth = cv2.imread(str(next(rig_folder.rglob(f"*depth*/{name}"))), cv2.IMREAD_UNCHANGED)
        registered = onto_colour(depth, calibration.unit_mm)
        expected = cv2.imread(str(tmp_path / "cli" / "infrared_in_colour" / name), cv2.IMREAD_UNCHANGED)
        assert registered.depth.dtype == np.uint16 and (expected > 0).mean() > 0.1
        np.testing.assert_array_equal(registered.depth, expected)
        assert registered.holes <= (expected == 0).sum() and registered.colours is None
    rgb = np.random.default_rng(1).integers(1, 255, (*registered.depth.shape, 3), dtype=np.uint8)
    coloured = onto_colour(depth, calibration.unit_mm, image=rgb).colours
    assert coloured.shape == (*depth.shape, 3) and (coloured.max(axis=2) > 0).mean() > 0.1
    with pytest.raises(depthcal.InputError, match="shape"):
        onto_colour(depth[:, :-1].copy())


@pytest.fixture(scope="module")
def units(tmp_path_factory):
    """Results of eight simulated units of one type."""
    out = tmp_path_factory.mktemp("units")
    for unit in range(8):
        points = depthcal.simulate_points(frames=10, samples=60, unit=unit, seed=100 + unit)
        depthcal.calibrate(points, lens="brown-conrady:full").save(out / f"unit{unit}")
    return out


def test_a_fleet_is_joined_as_by_the_command_line(command_line, units, tmp_path):
    command_line("fleet", units, "--out", tmp_path / "cli")
    joined = depthcal.fleet(units)
    joined.save(tmp_path / "python")
    equal(tmp_path / "python", tmp_path / "cli", "fleet.json", "prior.json")


def test_a_fleet_and_its_prior(units):
    joined = depthcal.fleet(units)
    assert joined.units == [f"unit{i}" for i in range(8)] and joined.left_out == []
    assert {"projective.dw", "pinhole.fx"} <= {row.name for row in joined.parameters}
    assert len(joined.effects) > 10 and joined.prior["units"] <= 8 and "<html" in joined.report.html
    few = depthcal.simulate_points(frames=4, samples=60, unit=9, seed=109)
    alone = depthcal.calibrate(few, lens="brown-conrady:full")
    helped = depthcal.calibrate(few, lens="brown-conrady:full", prior=joined)
    std = {fit: {row.name: row.std_dev for row in fit.calibration.parameters} for fit in (alone, helped)}
    assert std[helped]["pinhole.fx"] < 0.7 * std[alone]["pinhole.fx"]
    assert alone.prior_use == [] and "8 units" in helped.prior_use[0]
    with pytest.raises(depthcal.InputError, match="between 0 and 1"):
        depthcal.fleet(units, level=1.0)
    with pytest.raises(depthcal.InputError, match="640"):
        depthcal.calibrate(few, prior={**joined.prior, "width": 320})
