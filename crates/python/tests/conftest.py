"""Captures that the tests share. Everything is simulated by code that shares nothing with the fit."""

import os
import subprocess
from pathlib import Path

import cv2
import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

import depthcal  # noqa: E402

BOARD = depthcal.Board.chessboard(9, 6, 25.0)


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory):
    """A cache of detections of the tests' own."""
    folder = tmp_path_factory.mktemp("cache")
    os.environ["DEPTHCAL_CACHE"] = str(folder)
    return folder


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A rendered dataset of chessboards: 14 frames of 640×480, with a wave in depth."""
    out = tmp_path_factory.mktemp("captures") / "chessboards"
    return depthcal.simulate(out, board="chessboard", frames=14, effects=["cyclic_depth=4"], seed=5)


@pytest.fixture(scope="session")
def images(folder):
    """Image and depth of every frame by name."""
    names = sorted(path.stem for path in (folder / "image").iterdir())
    read = lambda kind, name: cv2.imread(str(folder / kind / f"{name}.png"), cv2.IMREAD_UNCHANGED)  # noqa: E731
    return {name: (read("image", name), read("depth", name)) for name in names}


@pytest.fixture(scope="session")
def corners(images):
    """OpenCV's corners of every frame."""
    found = {}
    for name, (gray, _) in images.items():
        ok, points = cv2.findChessboardCornersSB(gray, (BOARD.columns, BOARD.rows), flags=cv2.CALIB_CB_ACCURACY)
        found[name] = points if ok else None
    assert sum(points is not None for points in found.values()) >= 10
    return found


@pytest.fixture(scope="session")
def dataset(folder, corners):
    """The dataset with OpenCV's corners."""
    return depthcal.load(folder, corners=corners)


@pytest.fixture(scope="session")
def fit(dataset):
    return depthcal.calibrate(dataset, effects=["cyclic_depth@period_mm=300"])


@pytest.fixture(scope="session")
def points():
    """A capture of markers and single depth pixels without images: fits in a moment."""
    return depthcal.simulate_points(frames=16, samples=150, seed=3)


@pytest.fixture(scope="session")
def cli(dataset, cache):
    """The command line, with the same markers in its cache. A function of its arguments."""
    binary = Path(os.environ.get("DEPTHCAL_BIN", ""))
    if not binary.is_file():
        print("SKIPPED: comparison with the command line; DEPTHCAL_BIN names no program")
        pytest.skip("DEPTHCAL_BIN names no program")
    dataset.write_observations(cache / f"{dataset.digest}.json")

    def run(*arguments, code=0):
        done = subprocess.run([binary, *map(str, arguments)], capture_output=True, text=True)
        assert done.returncode == code, done.stderr
        return done

    return run


def wave(shape=(480, 640)):
    """A depth image of a wavy wall, uint16 mm, with pixels that were not measured."""
    v, u = np.mgrid[: shape[0], : shape[1]]
    depth = (1200 + 300 * np.sin(u / 90) + 200 * np.cos(v / 60)).astype(np.uint16)
    depth[::17, ::13] = 0
    depth[5, 7] = 65535
    return depth
