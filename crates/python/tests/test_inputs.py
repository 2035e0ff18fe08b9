"""Corners and arguments are checked: a clear error that names the argument, or the obvious thing."""

import numpy as np
import pytest
from conftest import BOARD

import depthcal


def frames_of(images, change):
    """The frames with changed corners."""
    return [depthcal.Frame(change(name), depth, gray, name) for name, (gray, depth) in images.items()]


def test_corners_without_ids_are_all_of_the_board(images, corners, dataset):
    name = next(iter(images))
    everywhere = {key: pixels for key, (ids, pixels) in corners.items() if len(ids) == 54}
    depthcal.Dataset.from_arrays(BOARD, frames_of(images, lambda key: everywhere.get(key)), unit_mm=dataset.unit_mm)
    for count in (53, 40):
        with pytest.raises(depthcal.InputError, match=rf"'{name}'.*{count} markers.*board has 54.*ids"):
            depthcal.Dataset.from_arrays(
                BOARD, frames_of(images, lambda key, n=count: everywhere[name][:n]), unit_mm=dataset.unit_mm
            )
    more = np.concatenate([everywhere[name], everywhere[name][:2] + 3])
    with pytest.raises(depthcal.InputError, match="56 markers.*board has 54"):
        depthcal.Dataset.from_arrays(BOARD, frames_of(images, lambda _: more), unit_mm=dataset.unit_mm)


def test_corners_of_a_folder_are_checked_alike(folder, corners):
    name, (_, pixels) = next(iter(corners.items()))
    with pytest.raises(depthcal.InputError, match=rf"'{name}'.*20 markers.*board has 54"):
        depthcal.load(folder, corners={name: pixels[:20]})
    swapped = {key: (ids, found[:, ::-1]) for key, (ids, found) in corners.items()}
    with pytest.raises(depthcal.InputError, match=r"\(u, v\)"):
        depthcal.load(folder, corners=swapped)


def test_rows_before_columns_are_refused(images, corners, dataset):
    """(v, u) runs as on a board that is seen from behind, and was fitted as such before, with a principal point out of place."""

    def swapped(key):
        ids, pixels = corners[key]
        return ids, pixels[:, ::-1]

    with pytest.raises(depthcal.InputError, match=r"frame '.*\(u, v\), the column before the row"):
        depthcal.Dataset.from_arrays(BOARD, frames_of(images, swapped), unit_mm=dataset.unit_mm)


def test_corners_outside_the_image_are_refused(images, corners, dataset):
    def far(key):
        ids, pixels = corners[key]
        return ids, pixels + [400, 0]

    with pytest.raises(depthcal.InputError, match="outside the image, 640 × 480 px"):
        depthcal.Dataset.from_arrays(BOARD, frames_of(images, far), unit_mm=dataset.unit_mm)


def test_messages_for_arrays_name_no_file(images, corners, dataset):
    """Advice for users of arrays is about arguments."""
    with pytest.raises(depthcal.Error) as raised:
        depthcal.Dataset.from_arrays(BOARD, [depthcal.Frame(None, None, gray) for gray, _ in images.values()])
    assert "dataset.toml" not in str(raised.value)


def test_a_folder_stands_for_its_dataset(folder, points, tmp_path):
    if not depthcal.has_detection:
        pytest.skip("this build has no detection of boards")
    by_path = depthcal.calibrate(str(folder), cross_validate=2)
    by_dataset = depthcal.calibrate(depthcal.load(folder), cross_validate=2)
    assert by_path.evaluation == by_dataset.evaluation
    by_path.save(tmp_path)
    by_fit, by_file = depthcal.evaluate(by_path, folder), depthcal.evaluate(tmp_path / "calibration.json", [folder])
    assert by_fit.datasets[0] == by_file.datasets[0]
    for wrong in (None, 3, by_path, {}):
        with pytest.raises(depthcal.InputError, match="dataset is a .*: give a Dataset"):
            depthcal.calibrate(wrong)
        with pytest.raises(depthcal.InputError, match="dataset is a"):
            depthcal.diagnose(wrong)
    with pytest.raises(depthcal.InputError, match="train is a"):
        depthcal.compare(None)
    for wrong in (None, 3, points):
        with pytest.raises(depthcal.InputError, match="calibration is a"):
            depthcal.evaluate(wrong, points)
        with pytest.raises(depthcal.InputError, match="calibration is a"):
            depthcal.Corrector(wrong)
    with pytest.raises(depthcal.InputError, match="datasets is empty"):
        depthcal.evaluate(by_path, [])


def test_whole_numbers_of_any_type(points):
    expected = depthcal.calibrate(points, cross_validate=3).evaluation
    assert depthcal.calibrate(points, cross_validate=np.int64(3)).evaluation == expected
    held = depthcal.calibrate(points, hold_out=4).evaluation
    assert depthcal.calibrate(points, hold_out=np.int32(4)).evaluation == held
    assert depthcal.calibrate(points, hold_out=(np.uint8(4), np.int16(1))).evaluation == held
    for wrong in (-1, 0, 1, 2.5, True, "3", np.float64(3)):
        with pytest.raises(depthcal.InputError, match="^cross_validate is"):
            depthcal.calibrate(points, cross_validate=wrong)
        with pytest.raises(depthcal.InputError, match="^hold_out is"):
            depthcal.calibrate(points, hold_out=wrong)
        with pytest.raises(depthcal.InputError, match="^folds is"):
            depthcal.diagnose(points, folds=wrong)
        with pytest.raises(depthcal.InputError, match="^folds is"):
            depthcal.compare(points, folds=wrong)
    with pytest.raises(depthcal.InputError, match="exclude each other"):
        depthcal.calibrate(points, hold_out=4, cross_validate=3)


def test_more_folds_than_frames_are_refused():
    few = depthcal.simulate_points(frames=8, samples=60, seed=1)
    for call in (
        lambda: depthcal.calibrate(few, cross_validate=100),
        lambda: depthcal.compare(few, models=["none"], folds=100),
        lambda: depthcal.diagnose(few, folds=100),
    ):
        with pytest.raises(depthcal.InputError, match="100.*8|8.*100"):
            call()


def test_models_are_needed(points):
    with pytest.raises(depthcal.InputError, match="models is empty"):
        depthcal.compare(points, models=[])
    one = depthcal.compare(points, models="projective", folds=3)
    assert one.models.names == ["projective"]
