"""The examples for fleets: one unit of work, resumption, and Ray where it is installed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyarrow", reason="SKIPPED: examples for fleets; pyarrow is not installed")
pytest.importorskip("zarr", reason="SKIPPED: examples for fleets; zarr is not installed")

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
sys.path.insert(0, str(EXAMPLES / "ray"))

import pyarrow.parquet  # noqa: E402
import work  # noqa: E402
import zarr  # noqa: E402
from conftest import wave  # noqa: E402

import depthcal  # noqa: E402


@pytest.fixture(scope="module")
def calibration(tmp_path_factory, points):
    path = tmp_path_factory.mktemp("calibration") / "calibration.json"
    depthcal.calibrate(points).calibration.save(path)
    return path


@pytest.fixture(scope="module")
def shards(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shards")
    for number in range(4):
        frames = np.stack([np.roll(wave(), 40 * number + i, axis=1) for i in range(70)])
        np.save(folder / f"shard-{number}.npy", frames)
    return sorted(folder.glob("*.npy"))


def test_a_shard_is_corrected_as_its_frames(shards, calibration, tmp_path):
    row = work.correct_shard(str(shards[0]), str(calibration), str(tmp_path))
    corrected = zarr.open_array(str(tmp_path / "shard-0.zarr"))
    frames = np.load(shards[0])
    corrector = depthcal.Corrector(depthcal.Calibration.load(calibration))
    for i in (0, 63, 64, 69):
        np.testing.assert_array_equal(corrected[i], corrector.correct(frames[i]))
    assert row["frames"] == 70 and row["corrected"] + row["without_depth"] + row["not_correctable"] == frames.size
    work.correct_shard(str(shards[1]), str(calibration), str(tmp_path), form="png")
    assert len(list((tmp_path / "shard-1").glob("*.png"))) == 70
    assert work.table(str(tmp_path)).num_rows == 2
    made_from = work.shard_made_from(str(shards[0]), str(calibration), 1.0, "zarr")
    assert work.is_done(tmp_path, "shard-0", made_from) and not work.is_done(tmp_path, "shard-2", made_from)
    assert not work.is_done(tmp_path, "shard-0", work.shard_made_from(str(shards[0]), str(calibration), 0.5, "zarr"))


def test_an_interrupted_shard_is_not_done(shards, calibration, tmp_path):
    program = f"import sys, os; sys.path.insert(0, {str(EXAMPLES / 'ray')!r}); import work; work.write_row = lambda *a: os._exit(9); "
    program += f"work.correct_shard({str(shards[0])!r}, {str(calibration)!r}, {str(tmp_path)!r})"
    assert subprocess.run([sys.executable, "-c", program]).returncode == 9
    made_from = work.shard_made_from(str(shards[0]), str(calibration), 1.0, "zarr")
    assert not work.is_done(tmp_path, "shard-0", made_from)
    work.correct_shard(str(shards[0]), str(calibration), str(tmp_path))
    assert work.is_done(tmp_path, "shard-0", made_from)


def test_an_array_task_does_its_part_and_no_more(tmp_path):
    units = [f"simulated:{n}" for n in (1, 2, 3)]
    (tmp_path / "units.txt").write_text("\n".join(units) + "\n")
    run = [sys.executable, str(EXAMPLES / "slurm" / "run.py")]
    for index in (0, 1, 0):
        environment = os.environ | {"SLURM_ARRAY_TASK_ID": str(index), "SLURM_ARRAY_TASK_COUNT": "2"}
        done = subprocess.run(
            [*run, "calibrate", tmp_path / "units.txt", tmp_path / "out"],
            env=environment,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
    assert done.stdout.count("was done") == 2
    subprocess.run([*run, "table", tmp_path / "out"], check=True)
    table = pyarrow.parquet.read_table(tmp_path / "out" / "results.parquet").to_pandas().set_index("unit")
    # Whether a unit of so few observations has something left that no effect explains is not the question here.
    assert len(table) == 3 and (table["effects"] == "cyclic_depth").all() and (table["verdict"] != "adequate").all()
    assert (table["depth_rms_mm"] < table["depth_rms_before_mm"]).all()
    assert (tmp_path / "out" / "simulated_1" / "report.html").exists()


def test_two_cameras_in_folders_of_one_name_stay_two(tmp_path, folder):
    """One is calibrated, the other fails: two rows, and the results of the first stay."""
    import shutil

    for camera in ("camA", "camB"):
        shutil.copytree(folder, tmp_path / camera / "calib")
    shutil.rmtree(next(path for path in (tmp_path / "camB" / "calib").iterdir() if path.is_dir()))
    sources = [str(tmp_path / camera / "calib") for camera in ("camA", "camB")]
    rows = [work.calibrate_camera(source, str(tmp_path / "out"), diagnose=False) for source in sources]
    assert rows[0]["failed"] is None and rows[1]["failed"] is not None
    table = work.table(str(tmp_path / "out")).to_pandas()
    assert sorted(table["source"]) == sources and table["failed"].notna().sum() == 1
    assert (tmp_path / "out" / work.unit_of(sources[0]) / "calibration.json").is_file()
    assert work.unit_of(sources[0]).startswith("camA-calib-")


def test_two_shards_of_one_name_are_refused(shards, calibration, tmp_path):
    work.correct_shard(str(shards[0]), str(calibration), str(tmp_path / "out"), form="none")
    other = tmp_path / shards[0].name
    np.save(other, np.load(shards[1])[:2])
    with pytest.raises(ValueError, match="another folder"):
        work.correct_shard(str(other), str(calibration), str(tmp_path / "out"), form="none")


def test_ray_survives_a_killed_worker_and_a_killed_driver(shards, calibration, tmp_path):
    pytest.importorskip("ray", reason="SKIPPED: Ray is not installed")
    program = [sys.executable, str(EXAMPLES / "ray" / "fleet.py"), "correct", *shards, "--calibration", calibration]
    program += ["--out", tmp_path / "out", "--workers", "2", "--verbose", "--format", "zarr"]
    program = [str(part) for part in program]

    def lines_until(process, words):
        seen = []
        for line in process.stdout:
            seen.append(line)
            if words in line:
                return seen
        raise AssertionError("".join(seen) + process.stderr.read())

    # The driver dies after the first shard.
    process = subprocess.Popen(
        program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    lines_until(process, "1/4")
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    time.sleep(1)
    # It is started again, and one of its workers dies.
    process = subprocess.Popen(
        program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    first = lines_until(process, "units are done")[-1]
    assert int(first.split()[0]) >= 1
    seen = lines_until(process, "worker")
    try:
        os.kill(int(seen[-1].split()[-1]), signal.SIGKILL)
    except ProcessLookupError:
        pass
    output, errors = process.communicate(timeout=240)
    assert process.returncode == 0, errors
    assert "4 rows" in output
    corrector = depthcal.Corrector(depthcal.Calibration.load(calibration))
    for shard in shards:
        corrected = zarr.open_array(str(tmp_path / "out" / f"{shard.stem}.zarr"))
        np.testing.assert_array_equal(corrected[69], corrector.correct(np.load(shard)[69]))


@pytest.mark.skipif(sys.platform != "linux", reason="SKIPPED: pages of mapped files are let go on Linux")
def test_memory_does_not_grow_with_the_shard(calibration, tmp_path):
    peaks = []
    for count in (64, 384):
        path = tmp_path / f"of{count}.npy"
        frames = np.lib.format.open_memmap(path, mode="w+", dtype=np.uint16, shape=(count, 480, 640))
        for i in range(0, count, 64):
            frames[i : i + 64] = wave()
        frames.flush()
        program = f"import sys; sys.path.insert(0, {str(EXAMPLES / 'ray')!r}); import work; "
        program += f"print(work.correct_shard({str(path)!r}, {str(calibration)!r}, {str(tmp_path)!r}, form='none')['peak_mib'])"
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        peaks.append(float(done.stdout))
    # The longer shard has 188 MiB more.
    assert peaks[1] - peaks[0] < 40, peaks
