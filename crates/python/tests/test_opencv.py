"""OpenCV as the source of corners and the reader of exported files."""

import json

import numpy as np
import pytest
from conftest import BOARD

import depthcal

cv2 = pytest.importorskip("cv2")


def test_truth_of_the_simulation(tmp_path):
    folder = depthcal.simulate(tmp_path / "c", board="chessboard", frames=10, seed=2, truth=tmp_path / "truth.json")
    truth = json.loads((tmp_path / "truth.json").read_text())["camera"]
    frames = []
    for path in sorted((folder / "image").iterdir()):
        gray = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        ok, corners = cv2.findChessboardCornersSB(gray, (9, 6), flags=cv2.CALIB_CB_ACCURACY)
        frames.append(depthcal.Frame(corners if ok else None, None, gray, path.stem))
    fit = depthcal.calibrate(depthcal.Dataset.from_arrays(BOARD, frames))
    assert fit.calibration.record["fit"]["model"] == "none"
    # Corners of OpenCV on rendered images are good to some hundredths of a pixel: a few standard deviations.
    for name, value in zip(("fx", "fy", "cx", "cy"), [*truth["focal_px"], *truth["centre_px"]]):
        row = next(row for row in fit.calibration.parameters if row.name == f"pinhole.{name}")
        assert abs(row.value - value) < max(6 * row.std_dev, 0.5), (name, row, value)


def test_exports_are_read_by_their_programs(fit, tmp_path):
    fit.calibration.export("opencv", tmp_path / "camera.yml")
    file = cv2.FileStorage(str(tmp_path / "camera.yml"), cv2.FILE_STORAGE_READ)
    np.testing.assert_allclose(file.getNode("camera_matrix").mat(), fit.calibration.matrix, rtol=1e-12)
    distortion = file.getNode("distortion_coefficients").mat().reshape(-1)
    points = np.array([[100.0, -80.0, 900.0], [-200.0, 50.0, 1100.0]])
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), fit.calibration.matrix, distortion)
    np.testing.assert_allclose(fit.calibration.project(points), expected.reshape(-1, 2), atol=1e-6)
    # OpenCV's files have a place for further entries, the others have none.
    with pytest.warns(UserWarning, match="no depth model: .*projective left out"):
        fit.calibration.export("ros")
    with pytest.raises(depthcal.InputError, match="opencv"):
        fit.calibration.export("none")


def test_png_files_equal_the_command_line_bit_by_bit(cli, fit, folder, tmp_path):
    fit.save(tmp_path / "fit")
    cli("apply", tmp_path / "fit" / "calibration.json", folder / "depth", "--unit-mm", 1, "--out", tmp_path / "out")
    corrector = depthcal.Corrector(depthcal.Calibration.load(tmp_path / "fit" / "calibration.json"))
    files = sorted((folder / "depth").iterdir())
    assert len(files) == 14
    for path in files:
        depth, expected = (cv2.imread(str(p), cv2.IMREAD_UNCHANGED) for p in (path, tmp_path / "out" / path.name))
        np.testing.assert_array_equal(corrector.correct(depth), expected)
        assert (expected != depth).any()
