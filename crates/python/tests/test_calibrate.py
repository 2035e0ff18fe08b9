"""Datasets and calibrations: against the command line, the truth of the simulation, and each other."""

import json

import numpy as np
import pytest
from conftest import BOARD

import depthcal


def test_calibration_equals_the_command_line_to_the_byte(cli, folder, dataset, tmp_path):
    cli("calibrate", folder, "--with", "cyclic_depth@period_mm=300", "--cross-validate", 3, "--out", tmp_path / "cli")
    cached = depthcal.load(folder)
    assert cached.from_cache
    fit = depthcal.calibrate(cached, effects=["cyclic_depth@period_mm=300"], cross_validate=3)
    fit.save(tmp_path / "python")
    for name in ("calibration.json", "evaluation.json", "observations.json"):
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "cli" / name).read_bytes(), name


def test_diagnosis_and_comparison_equal_the_command_line_to_the_byte(cli, folder, dataset, tmp_path):
    cli("diagnose", folder, "--no-discovery", "--out", tmp_path / "cli")
    depthcal.diagnose(depthcal.load(folder), discovery=False).save(tmp_path / "python")
    for name in ("diagnosis.json", "calibration.json", "evaluation.json"):
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "cli" / name).read_bytes(), name
    models = ("none", "projective:xw")
    cli(
        "compare",
        folder,
        "--models",
        ",".join(models),
        "--learning",
        0,
        "--folds",
        3,
        "--out",
        tmp_path / "c",
    )
    depthcal.compare(depthcal.load(folder), models=models, folds=3).save(tmp_path / "p")
    assert (tmp_path / "p" / "comparison.json").read_bytes() == (tmp_path / "c" / "comparison.json").read_bytes()


def test_evaluation_equals_the_command_line_to_the_byte(cli, folder, dataset, fit, tmp_path):
    fit.save(tmp_path / "fit")
    cli("evaluate", tmp_path / "fit" / "calibration.json", folder, "--out", tmp_path / "cli")
    calibration = depthcal.Calibration.load(tmp_path / "fit" / "calibration.json")
    depthcal.evaluate(calibration, depthcal.load(folder)).save(tmp_path / "python")
    name = "evaluation.json"
    assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "cli" / name).read_bytes()


def test_next_captures_are_those_of_the_command_line(cli, folder):
    written = cli("next", folder, "--goal", "pinhole.fx", "--frames", 2, "--json")
    fit = depthcal.calibrate(depthcal.load(folder))
    captures = fit.next_captures("pinhole.fx", frames=2)
    assert captures["unit"] == "px" and len(captures["capture_next"]) == 2
    assert captures["now_95"] > captures["now"] > captures["capture_next"][1]["expected"] > 0
    shown = json.loads(written.stdout)
    assert {name: shown[name] for name in captures} == captures
    for wrong in ({"range_mm": (500, 100)}, {"within": 0.0}, {"frames": 0}, {"goal": "pinhole.nothing"}):
        with pytest.raises(depthcal.InputError):
            fit.next_captures(**wrong)


def test_arrays_give_the_same_fit_as_files(dataset, images, corners, fit):
    frames = [depthcal.Frame(corners[name], depth, gray, name) for name, (gray, depth) in images.items()]
    arrays = depthcal.Dataset.from_arrays(BOARD, frames, unit_mm=dataset.unit_mm)
    assert (arrays.size, len(arrays)) == (dataset.size, len(dataset))
    again = depthcal.calibrate(arrays, effects=["cyclic_depth@period_mm=300"])
    # Times and temperatures of frames.csv are not given; no effect of this model uses them.
    assert list(again.calibration.parameters) == list(fit.calibration.parameters)
    assert again.errors[0].depth_rms_mm == fit.errors[0].depth_rms_mm


def test_float_depth_in_metres_is_the_same_depth(dataset, images, corners, fit):
    frames = [
        depthcal.Frame(corners[name], (depth * np.float32(dataset.unit_mm / 1000)).astype(np.float32), gray, name)
        for name, (gray, depth) in images.items()
    ]
    metres = depthcal.Dataset.from_arrays(BOARD, frames, unit_mm=1000.0)
    again = depthcal.calibrate(metres, effects=["cyclic_depth@period_mm=300"])
    for a, b in zip(again.calibration.parameters, fit.calibration.parameters):
        assert a.name == b.name and (b.fixed or abs(a.value - b.value) < 0.02 * b.std_dev), a.name


def test_fits_of_other_noise_agree_within_their_standard_deviations(points):
    fit = depthcal.calibrate(points)
    other = {
        row.name: row
        for row in depthcal.calibrate(depthcal.simulate_points(frames=16, samples=150, seed=4)).calibration.parameters
    }
    free = [row for row in fit.calibration.parameters if not row.fixed]
    assert len(free) >= 12
    for row in free:
        # Of a dozen normal deviates none is beyond 4.5 but once in 10⁴.
        assert abs(row.value - other[row.name].value) < 4.5 * np.hypot(row.std_dev, other[row.name].std_dev), row.name


def test_start_values_and_fixed_intrinsics(dataset, images, corners):
    frames = [depthcal.Frame(corners[name], depth, gray, name) for name, (gray, depth) in images.items()]
    k = np.array([[580.0, 0, 320], [0, 580.0, 240], [0, 0, 1]])
    given = dict(intrinsics=k, distortion=[0] * 5, fixed=True)
    fixed = depthcal.Dataset.from_arrays(BOARD, frames, unit_mm=dataset.unit_mm, **given)
    fit = depthcal.calibrate(fixed)
    assert fit.calibration.value("pinhole.fx") == 580.0
    assert all(row.fixed for row in fit.calibration.parameters if row.name.startswith("pinhole."))
    np.testing.assert_array_equal(fit.calibration.matrix, k)


def test_only_some_markers_of_a_frame(dataset, images, corners):
    frames = []
    for name, (gray, depth) in images.items():
        ids, found = corners[name]
        some = ids < 9 * 4
        frames.append(depthcal.Frame((ids[some], found[some]), depth, gray, name))
    fit = depthcal.calibrate(depthcal.Dataset.from_arrays(BOARD, frames, unit_mm=dataset.unit_mm))
    assert fit.errors[0].reprojection_px < 0.3


def test_messages_are_those_of_the_command_line(cli, folder, dataset, tmp_path):
    wrong = cli("calibrate", folder, "--with", "cyclic_dept", "--out", tmp_path, code=1).stderr
    with pytest.raises(depthcal.InputError) as raised:
        depthcal.calibrate(dataset, effects=["cyclic_dept"])
    assert str(raised.value) == wrong.strip().removeprefix("error: ").replace("--with", "effects")
    missing = cli("calibrate", tmp_path / "none", "--out", tmp_path, code=1).stderr
    with pytest.raises(depthcal.InputError) as raised:
        depthcal.load(tmp_path / "none")
    assert str(raised.value) == missing.strip().removeprefix("error: ")


def test_input_errors_name_the_frame_and_the_remedy(images, corners):
    name, (gray, depth) = next(iter(images.items()))
    board = depthcal.Board.chessboard(3, 2, 25.0)
    for frame, words in [
        (depthcal.Frame(corners[name], depth, gray, "f"), ["'f'", "marker 6", "the board has 6"]),
        (depthcal.Frame(None, depth.astype(np.float64), gray, "f"), ["'f'", "float32"]),
        (depthcal.Frame(None, depth[:, :9], gray, "f"), ["f", "9", "640"]),
        (depthcal.Frame((np.array([1, 1]), np.ones((2, 2))), depth, gray, "f"), ["'f'", "twice"]),
        (depthcal.Frame((np.array([1]), np.full((1, 2), np.nan)), depth, gray, "f"), ["'f'", "leave out"]),
        (depthcal.Frame((np.array([0, 1]), np.ones((3, 2))), depth, gray, "f"), ["'f'", "one row"]),
    ]:
        with pytest.raises(depthcal.InputError) as raised:
            depthcal.Dataset.from_arrays(board, [frame], unit_mm=1.0)
        assert all(word in str(raised.value) for word in words), str(raised.value)
    with pytest.raises(depthcal.InputError, match="never guessed"):
        depthcal.Dataset.from_arrays(BOARD, [depthcal.Frame(corners[name], depth, gray)])


def test_a_fit_that_cannot_be_trusted_is_an_error_of_its_own(images, corners):
    name, (gray, depth) = next(iter(images.items()))
    frames = [depthcal.Frame(corners[name], depth, gray, str(i)) for i in range(3)]
    same = depthcal.Dataset.from_arrays(BOARD, frames, unit_mm=1.0)
    with pytest.raises(depthcal.Error) as raised:
        depthcal.calibrate(same, model="projective")
    # The same pose three times determines no camera: either there is no start, or parameters are undetermined.
    assert isinstance(raised.value, (depthcal.UntrustedFitError, depthcal.InputError))
    assert issubclass(depthcal.UntrustedFitError, depthcal.Error) and not issubclass(
        depthcal.UntrustedFitError, depthcal.InputError
    )


def test_without_detection_a_folder_says_what_is_missing(folder, tmp_path):
    if depthcal.has_detection:
        pytest.skip("this build detects boards")
    other = depthcal.simulate(tmp_path / "c", frames=2, seed=9)
    with pytest.raises(depthcal.InputError, match="without detection"):
        depthcal.load(other)
