"""Two calibrations compared with each other."""

import json

import pytest

import depthcal


@pytest.fixture(scope="module")
def calibrations():
    """Two captures of one simulated camera."""
    captures = [depthcal.simulate_points(frames=16, samples=150, seed=seed) for seed in (3, 4)]
    return [depthcal.calibrate(capture, lens="brown-conrady:full").calibration for capture in captures]


def changed(calibration, tmp_path, name, change):
    """The calibration with a parameter changed by so many standard deviations, as a file."""
    path = tmp_path / "calibration.json"
    calibration.save(path)
    record = json.loads(path.read_text())
    piece, parameter = name.split(".")
    for p in next(q for q in record["camera"]["pieces"] if q["name"] == piece)["parameters"]:
        if p["name"] == parameter:
            p["value"] += change * p["std_dev"]
    path.write_text(json.dumps(record))
    return path


def test_two_captures_of_one_camera_agree(calibrations):
    difference = depthcal.diff(*calibrations)
    assert not difference.differs, difference.verdict
    assert all("agree" in sentence for sentence in difference.verdict)
    depth = [row for row in difference.differences if row.quantity == "depth"]
    assert len(depth) > 5 and all(row.expected_rms > 0 for row in depth)


def test_a_changed_parameter_is_seen_and_the_files_are_those_of_the_record(calibrations, tmp_path):
    path = changed(calibrations[0], tmp_path, "projective.dz", 20)
    difference = depthcal.diff(calibrations[0], path.parent)
    assert difference.differs and "differs by more than the uncertainties" in difference.verdict[0]
    written = difference.save(tmp_path / "diff")
    assert json.loads((tmp_path / "diff" / "diff.json").read_text()) == difference.record
    assert {file.name for file in written} == {"diff.json", "report.html"}


def test_what_cannot_be_compared_is_said(calibrations, tmp_path):
    (tmp_path / "camera.json").write_text("{}")
    with pytest.raises(depthcal.InputError, match="camera.json"):
        depthcal.diff(calibrations[0], tmp_path / "camera.json")
