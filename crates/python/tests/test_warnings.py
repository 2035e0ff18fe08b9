"""Warnings of the engine are warnings of Python, at the line that called."""

import threading
import warnings

import numpy as np
import pytest
from conftest import BOARD, small_wave

import depthcal


def copies(images, corners, dataset, count=2):
    """A dataset whose first frames are copies of each other."""
    listed = list(images.items())
    listed += [(f"copy {i}", listed[0][1]) for i in range(count)]
    frames = [
        depthcal.Frame(corners.get(name, corners[listed[0][0]]), depth, gray, name) for name, (gray, depth) in listed
    ]
    return depthcal.Dataset.from_arrays(BOARD, frames, unit_mm=dataset.unit_mm)


def test_a_warning_of_the_engine_is_one_of_python(images, corners, dataset):
    with pytest.warns(depthcal.DepthcalWarning, match="2 frames are copies of others") as told:
        copies(images, corners, dataset)
    assert len(told) == 1 and told[0].filename == __file__


def test_a_warning_may_be_an_error(images, corners, dataset):
    with warnings.catch_warnings():
        warnings.simplefilter("error", depthcal.DepthcalWarning)
        with pytest.raises(depthcal.DepthcalWarning, match="copies"):
            copies(images, corners, dataset)


def test_calls_at_a_time_have_their_own_warnings(images, corners, dataset):
    """One warns, the other does not, whatever threads they run in."""
    warned = {}

    def work(count):
        # Filters are those of the process; what is recorded here is the message of each call.
        warned[count] = copies(images, corners, dataset, count)

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        threads = [threading.Thread(target=work, args=(count,)) for count in (1, 2, 3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert len(warned) == 3
    assert sorted(str(w.message).split()[0] for w in told) == ["1", "2", "3"]


def test_inputs_that_effects_need_are_asked_for():
    points = depthcal.simulate_points(
        frames=20, samples=60, effects=["reflectivity_bias=6", "temporal_drift=6"], seed=2
    )
    fit = depthcal.calibrate(points, effects=["reflectivity_bias", "temporal_drift"])
    corrector = depthcal.Corrector(fit.calibration)
    assert set(corrector.needs) == {"amplitude", "time_s"}
    depth, amplitude = np.full((480, 640), 1500, np.uint16), np.full((480, 640), 100, np.uint16)
    for call in (corrector.correct, corrector.correct_counting, corrector.correct_to_mm, corrector.points):
        with pytest.warns(depthcal.DepthcalWarning) as told:
            call(depth)
        said = [str(w.message) for w in told]
        assert len(said) == 2 and told[0].filename == __file__
        assert "time_s is not given" in said[0] and "temporal_drift" in said[0]
        assert "amplitude is not given" in said[1] and "reflectivity_bias" in said[1]
        with pytest.warns(depthcal.DepthcalWarning, match="amplitude is not given") as told:
            call(depth, time_s=5.0)
        assert len(told) == 1
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            call(depth, time_s=5.0, amplitude=amplitude)


def test_cameras_that_need_nothing_say_nothing(small, small_rig):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        depthcal.Corrector(small).correct(small_wave())
        depthcal.Registration(small_rig, "infrared", "colour")(small_wave())
