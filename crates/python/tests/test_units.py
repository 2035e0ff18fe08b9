"""Depth is in units of unit_mm, whole steps and floating-point numbers alike."""

import numpy as np
import pytest
from conftest import SMALL, small_wave

import depthcal

#: Millimetres per unit, and the largest relative rounding of float32 to and from it.
UNITS = [0.1, 0.25, 1.0, 10.0, 1000.0]
ROUNDING = 3e-7


@pytest.fixture(scope="module")
def corrector(small):
    return depthcal.Corrector(small)


@pytest.mark.parametrize("unit_mm", UNITS)
def test_floats_are_in_units(corrector, unit_mm):
    mm = small_wave().astype(np.float32)
    mm[1, 1:4] = [np.nan, np.inf, -5.0]
    given = (mm.astype(np.float64) / unit_mm).astype(np.float32)
    expected = corrector.correct(mm)
    assert np.abs(expected - mm)[np.isfinite(mm)].max() > 1.0 and (expected[1, 1:4] == 0.0).all()
    corrected, counts = corrector.correct_counting(given, unit_mm)
    assert corrected.dtype == np.float32 and counts == corrector.correct_counting(mm)[1]
    np.testing.assert_allclose(corrected.astype(np.float64) * unit_mm, expected, rtol=ROUNDING)
    np.testing.assert_array_equal(corrector.correct(given, unit_mm), corrected)
    place = given.copy()
    np.testing.assert_array_equal(corrector.correct(place, unit_mm, out=place), corrected)
    np.testing.assert_array_equal(corrector.correct(np.stack([given, given]), unit_mm)[1], corrected)
    # Millimetres whatever the unit.
    np.testing.assert_allclose(corrector.correct_to_mm(given, unit_mm), expected, rtol=ROUNDING)
    np.testing.assert_allclose(corrector.points(given, unit_mm), corrector.points(mm), rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize("unit_mm", [0.1, 0.25, 1.0, 10.0])
def test_steps_and_floats_are_one_depth(corrector, unit_mm):
    steps = small_wave() // np.uint16(max(1, unit_mm / 2))
    float_steps = steps.astype(np.float32)
    mm = corrector.correct_to_mm(steps, unit_mm)
    np.testing.assert_allclose(corrector.correct_to_mm(float_steps, unit_mm), mm, rtol=ROUNDING)
    corrected = corrector.correct(float_steps, unit_mm)
    np.testing.assert_allclose(corrected * np.float64(unit_mm), mm, rtol=ROUNDING)
    assert np.abs(corrector.correct(steps, unit_mm) - corrected.astype(np.float64)).max() < 0.502
    np.testing.assert_allclose(
        corrector.points(float_steps, unit_mm), corrector.points(steps, unit_mm), rtol=1e-6, atol=1e-4
    )


def test_metres(corrector):
    """1.5 m are corrected as 1500 mm are, into metres."""
    metres = corrector.correct(np.full(SMALL, 1.5, np.float32), unit_mm=1000.0)
    expected = corrector.correct(np.full(SMALL, 1500.0, np.float32)) / np.float32(1000)
    assert np.abs(expected - 1.5).max() > 1e-3
    np.testing.assert_allclose(metres, expected, rtol=ROUNDING)


def test_floats_in_units_equal_the_command_line_bit_by_bit(cli, fit, images, tmp_path):
    fit.save(tmp_path / "fit")
    raw = tmp_path / "raw"
    raw.mkdir()
    depth = next(iter(images.values()))[1]
    for unit_mm in (1000.0, 0.1):
        given = (depth / unit_mm).astype(np.float32)
        np.save(raw / "f.npy", given)
        out = tmp_path / f"out{unit_mm}"
        cli("apply", tmp_path / "fit" / "calibration.json", raw, "--unit-mm", unit_mm, "--out", out)
        corrector = depthcal.Corrector(depthcal.Calibration.load(tmp_path / "fit" / "calibration.json"))
        np.testing.assert_array_equal(corrector.correct(given, unit_mm), np.load(out / "f.npy"))


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
@pytest.mark.parametrize("unit_mm", [0.0, -1.0, np.nan, np.inf])
def test_a_unit_is_a_length(corrector, small_rig, dtype, unit_mm):
    depth = small_wave().astype(dtype)
    calls = [corrector.correct, corrector.correct_counting, corrector.correct_to_mm, corrector.points]
    for call in [*calls, depthcal.Registration(small_rig, "infrared", "colour")]:
        before = depth.copy()
        with pytest.raises(depthcal.InputError, match="^unit_mm is .* above 0"):
            call(depth, unit_mm)
        np.testing.assert_array_equal(depth, before)
    with pytest.raises(depthcal.InputError, match="unit_mm"):
        frame = depthcal.Frame(np.ones((12, 2)), depth)
        depthcal.Dataset.from_arrays(depthcal.Board.chessboard(4, 3, 20.0), [frame], unit_mm=unit_mm)


def test_whole_steps_of_metres_are_refused(corrector, small_rig):
    """Depth in uint16 with the unit of metres is a mistake, as in files."""
    calls = [corrector.correct, corrector.correct_counting, corrector.correct_to_mm, corrector.points]
    for call in [*calls, depthcal.Registration(small_rig, "infrared", "colour")]:
        with pytest.raises(depthcal.InputError, match="whole steps.*unit_mm = 1000 is for floating-point metres"):
            call(small_wave(), 1000.0)
    with pytest.raises(depthcal.InputError, match="f: .*whole steps"):
        frame = depthcal.Frame(np.ones((12, 2)), small_wave(), name="f")
        depthcal.Dataset.from_arrays(depthcal.Board.chessboard(4, 3, 20.0), [frame], unit_mm=1000.0)


@pytest.mark.parametrize("unit_mm", UNITS)
def test_registered_depth_is_in_units(small_rig, unit_mm):
    registration = depthcal.Registration(small_rig, "infrared", "colour")
    mm = np.full(SMALL, 900, np.float32)
    mm[::3] += 400
    expected = registration(mm)
    assert (expected.depth > 0).any()
    given = registration((mm / unit_mm).astype(np.float32), unit_mm)
    assert given.depth.dtype == np.float32 and given.holes == expected.holes
    np.testing.assert_allclose(given.depth.astype(np.float64) * unit_mm, expected.depth, rtol=2e-6)
    if unit_mm in (0.25, 1.0, 10.0):
        steps = registration((mm / unit_mm).astype(np.uint16), unit_mm)
        assert np.abs(steps.depth - given.depth.astype(np.float64)).max() < 0.51


def test_datasets_of_one_depth_in_several_units():
    """Datasets keep depth in the unit that it was given in."""
    board = depthcal.Board.chessboard(9, 6, 25.0)
    depth = small_wave()
    ids = np.arange(54)
    pixels = np.stack([5 + 6.0 * (ids % 9), 5 + 6.0 * (ids // 9)], axis=1)
    steps = depthcal.Dataset.from_arrays(board, [depthcal.Frame((ids, pixels), depth)], unit_mm=1.0)
    metres = depthcal.Dataset.from_arrays(
        board, [depthcal.Frame((ids, pixels), depth.astype(np.float32) / np.float32(1000))], unit_mm=1000.0
    )
    np.testing.assert_allclose(
        metres.depth("0000") * metres.unit_mm, steps.depth("0000") * steps.unit_mm, rtol=ROUNDING
    )
    assert (steps.unit_mm, metres.unit_mm) == (1.0, 1000.0)
