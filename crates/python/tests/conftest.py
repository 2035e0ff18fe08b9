"""Captures that the tests share. Everything is simulated by code that shares nothing with the fit.

numpy and pytest are enough; tests that need more (pandas, matplotlib, OpenCV, Ray…) are skipped where it is not installed.
"""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

os.environ.setdefault("MPLBACKEND", "Agg")

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
def detected(folder):
    """The dataset with the corners that the package itself finds."""
    if not depthcal.has_detection:
        pytest.skip("this build has no detection of boards")
    detected = depthcal.load(folder, cache=False)
    assert len(detected) >= 10
    return detected


@pytest.fixture(scope="session")
def images(detected):
    """Image, uint8, and depth, uint16, of every frame by name."""
    return {row.name: (detected.image(row.name).astype(np.uint8), detected.depth(row.name)) for row in detected.frames}


@pytest.fixture(scope="session")
def corners(detected):
    """Numbers and positions of the corners of every frame by name."""
    return {row.name: detected.markers(row.name) for row in detected.frames}


@pytest.fixture(scope="session")
def dataset(folder, corners):
    """The dataset with given corners."""
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


#: Height and width of the images of :func:`small` and :func:`rig_record`.
SMALL = (48, 64)


def parsed(record, **changes):
    """A calibration of a changed record."""
    native = depthcal._depthcal.Calibration.parse(json.dumps({**record, **changes}), [])
    return depthcal.Calibration(native)


@pytest.fixture(scope="session")
def small(points):
    """A calibration of small images, with errors of depth of some mm."""
    record = depthcal.calibrate(points).calibration.record
    return parsed(record, camera={**record["camera"], "width": SMALL[1], "height": SMALL[0]})


@pytest.fixture(scope="session")
def small_rig(small):
    """A calibration of two such cameras, 20 mm apart."""
    record = small.record
    camera = {**record["camera"], "noise": record["noise"], "depth_unit_mm": 1.0, "frames_used": 1}

    def placed(name, translation):
        return {"name": name, "camera_from_rig": {"rotation": [1, 0, 0, 0], "translation_mm": translation}, **camera}

    return parsed(record, cameras=[placed("infrared", [0, 0, 0]), placed("colour", [20, 0, 0])])


def small_wave(seed=0):
    """A small depth image, uint16 mm, with pixels that were not measured."""
    random = np.random.default_rng(seed)
    depth = random.integers(400, 4000, SMALL, dtype=np.uint16)
    depth[::7, ::5] = 0
    return depth
