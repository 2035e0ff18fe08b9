"""Correction of arrays: against the command line bit by bit, and against points of known geometry."""

import threading
import time

import numpy as np
import pytest
from conftest import wave

import depthcal


@pytest.fixture(scope="module")
def corrector(fit):
    return depthcal.Corrector(fit.calibration)


def test_frames_equal_the_command_line_bit_by_bit(cli, fit, images, tmp_path):
    fit.save(tmp_path / "fit")
    raw = tmp_path / "raw"
    raw.mkdir()
    depths = [depth for _, depth in images.values()][:3]
    for i, depth in enumerate(depths):
        np.save(raw / f"{i}.npy", depth)
        np.save(raw / f"f{i}.npy", depth.astype(np.float32) * np.float32(1.01))
    cli("apply", tmp_path / "fit" / "calibration.json", raw, "--unit-mm", 1, "--out", tmp_path / "out")
    corrector = depthcal.Corrector(depthcal.Calibration.load(tmp_path / "fit" / "calibration.json"))
    for i, depth in enumerate(depths):
        expected = np.load(tmp_path / "out" / f"{i}.npy")
        assert expected.dtype == np.uint16 and (expected != depth).any()
        np.testing.assert_array_equal(corrector.correct(depth), expected)
        expected = np.load(tmp_path / "out" / f"f{i}.npy")
        assert expected.dtype == np.float32
        np.testing.assert_array_equal(corrector.correct(depth.astype(np.float32) * np.float32(1.01)), expected)


def test_batches_place_and_units(corrector):
    depth = wave()
    one = corrector.correct(depth, 1.0)
    assert one.dtype == np.uint16 and one is not depth
    batch = np.stack([depth, depth[::-1], depth])
    many = corrector.correct(batch)
    np.testing.assert_array_equal(many[0], one)
    np.testing.assert_array_equal(many[1], corrector.correct(np.ascontiguousarray(depth[::-1])))
    out = np.zeros_like(depth)
    assert corrector.correct(depth, out=out) is out
    np.testing.assert_array_equal(out, one)
    place = depth.copy()
    assert corrector.correct(place, out=place) is place
    np.testing.assert_array_equal(place, one)
    halves = corrector.correct((depth.astype(np.uint32) * 2).clip(0, 65535).astype(np.uint16), 0.5)
    assert np.abs(halves[one > 0] / 2 - one[one > 0]).max() <= 0.76


def test_float_depth_and_counts(corrector):
    depth = wave().astype(np.float32)
    depth[5, 7] = np.nan
    corrected, (count, beyond, without, failed) = corrector.correct_counting(depth)
    assert count + without + failed == depth.size and beyond == 0
    assert without == int((~(depth > 0)).sum())
    mm = corrector.correct_to_mm(np.nan_to_num(depth).astype(np.uint16))
    np.testing.assert_array_equal(mm, corrected)
    assert np.abs(corrector.correct(np.nan_to_num(depth).astype(np.uint16)) - mm).max() <= 0.502


def test_points_are_depth_on_rays(corrector, fit):
    depth = wave()
    points = corrector.points(depth)
    assert points.shape == (480, 640, 3) and points.dtype == np.float32
    mm = corrector.correct_to_mm(depth)
    known = mm > 0
    np.testing.assert_array_equal(points[known][:, 2], mm[known])
    assert np.isnan(points[~known]).all()
    some = np.argwhere(known)[::997]
    pixels = fit.calibration.project(points[some[:, 0], some[:, 1]].astype(np.float64))
    assert np.abs(pixels - some[:, ::-1]).max() < 0.01
    rays = fit.calibration.rays(some[:, ::-1].astype(np.float64))
    expected = points[some[:, 0], some[:, 1], :2] / points[some[:, 0], some[:, 1], 2:]
    assert np.abs(rays - expected).max() < 1e-6
    floats = corrector.points(np.where(depth == 65535, 0, depth).astype(np.float32))
    np.testing.assert_allclose(floats[known], points[known], rtol=2e-7)


def test_read_only_input_is_not_copied_or_changed(corrector):
    depth = wave()
    before = depth.copy()
    depth.flags.writeable = False
    corrector.correct(depth)
    np.testing.assert_array_equal(depth, before)
    with pytest.raises(depthcal.InputError, match="writeable"):
        corrector.correct(before, out=depth)


def test_the_array_itself_is_read(corrector, tmp_path):
    """A file mapped into memory is corrected into another without a copy of either."""
    np.save(tmp_path / "in.npy", np.stack([wave()] * 4))
    source = np.load(tmp_path / "in.npy", mmap_mode="r")
    target = np.lib.format.open_memmap(tmp_path / "out.npy", mode="w+", dtype=np.uint16, shape=source.shape)
    assert corrector.correct(source, out=target) is target
    del target
    np.testing.assert_array_equal(np.load(tmp_path / "out.npy")[3], corrector.correct(wave()))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.astype(np.float64), "float32"),
        (lambda d: d[:, ::2], "640"),
        (lambda d: d[None, None], "shape"),
    ],
)
def test_other_arrays_are_refused_with_the_remedy(corrector, change, words):
    with pytest.raises(depthcal.InputError, match=words):
        corrector.correct(change(wave()))


def test_arguments_are_checked(corrector):
    depth = wave()
    for arguments, words in [
        ({"unit_mm": 0.0}, "above 0"),
        ({"out": np.zeros((480, 640), np.float32)}, "uint16"),
        ({"out": np.zeros((1, 480, 640), np.uint16)}, "same shape"),
        ({"amplitude": np.zeros((480, 641), np.uint16)}, "amplitude"),
        ({"time_s": [1.0, 2.0]}, "one per frame"),
    ]:
        with pytest.raises(depthcal.InputError, match=words):
            corrector.correct(depth, **arguments)
    with pytest.raises(depthcal.InputError, match="calibration.json"):
        depthcal.Corrector("calibration.json")
    with pytest.raises(depthcal.InputError, match="calibration is a dict: give a Calibration"):
        depthcal.Corrector({})


def test_amplitude_and_time_reach_the_correction():
    effects = ["reflectivity_bias", "temporal_drift"]
    points = depthcal.simulate_points(
        frames=20, samples=300, effects=["reflectivity_bias=6", "temporal_drift=6"], seed=2
    )
    fit = depthcal.calibrate(points, effects=effects)
    corrector = depthcal.Corrector(fit.calibration)
    assert {"amplitude", "time_s"} <= set(corrector.needs)
    depth, dark, bright = wave(), np.full((480, 640), 60, np.uint8), np.full((480, 640), 220, np.uint16)
    a = corrector.correct_to_mm(depth, amplitude=dark, time_s=0.0)
    assert (a != corrector.correct_to_mm(depth, amplitude=bright, time_s=0.0)).any()
    assert (a != corrector.correct_to_mm(depth, amplitude=dark, time_s=500.0)).any()
    np.testing.assert_array_equal(a, corrector.correct_to_mm(depth, amplitude=dark.astype(np.uint16), time_s=0.0))
    both = corrector.correct_to_mm(
        np.stack([depth, depth]), amplitude=np.stack([dark.astype(np.uint16), bright]), time_s=[0.0, 500.0]
    )
    np.testing.assert_array_equal(both[1], corrector.correct_to_mm(depth, amplitude=bright, time_s=500.0))


def test_the_gil_is_free_while_frames_are_corrected(corrector):
    """Another thread counts while one call corrects many frames. With the GIL held, it would not count once."""
    batch = np.stack([wave()] * 60)
    counted, stop = [0], threading.Event()

    def count():
        while not stop.is_set():
            counted[0] += 1
            time.sleep(0)

    thread = threading.Thread(target=count)
    thread.start()
    while counted[0] == 0:
        time.sleep(0.001)
    interval, before = __import__("sys").getswitchinterval(), 0
    try:
        # The counting thread can only get the GIL within the call, not at a switch before it.
        __import__("sys").setswitchinterval(10.0)
        before = counted[0]
        corrector.correct(batch)
        during = counted[0] - before
    finally:
        __import__("sys").setswitchinterval(interval)
        stop.set()
        thread.join()
    assert during > 5


def test_threads_of_its_own_give_the_same_bits(fit, corrector):
    single = depthcal.Corrector(fit.calibration, threads=1)
    np.testing.assert_array_equal(single.correct(wave()), corrector.correct(wave()))


def test_uncertainty_and_mask_equal_the_command_line(cli, fit, images, tmp_path):
    fit.save(tmp_path / "fit")
    raw = tmp_path / "raw"
    raw.mkdir()
    depth = next(depth for _, depth in images.values())
    np.save(raw / "0.npy", depth)
    out = tmp_path / "out"
    cli(
        "apply", tmp_path / "fit" / "calibration.json", raw, "--unit-mm", 0.125, "--out", out, "--uncertainty", "--mask"
    )
    assert (out / "sigma" / "0.tiff").is_file() and (out / "mask" / "0.png").is_file()
    corrector = depthcal.Corrector(depthcal.Calibration.load(tmp_path / "fit" / "calibration.json"))
    sigma = corrector.uncertainty(depth, 0.125)
    assert sigma.dtype == np.float32 and sigma.shape == depth.shape
    assert np.isnan(sigma[depth == 0]).all()
    # σ follows depth, not its unit.
    np.testing.assert_allclose(corrector.uncertainty(depth.astype(np.float32) / 8000, unit_mm=1000), sigma, rtol=1e-4)
    mask = corrector.mask(corrector.correct(depth, unit_mm=0.125), 0.125)
    assert mask.dtype == np.uint8 and set(np.unique(mask)) <= {0, 128, 255} and (mask == 255).any()
    # The wall is beyond the pole of D, or near it, where σ is not known: it is where boards were.
    assert (sigma[mask == 255] > 0).all()
