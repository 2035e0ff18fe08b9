"""One unit of work of a fleet: one camera, or one shard of frames. Knows neither Ray nor Slurm; both run these functions.

A unit is done when its row exists: a small Parquet file in the folder ``rows`` of the output, written last and renamed into place. A unit
that was interrupted anywhere before has no row and is done again from its beginning; its results are replaced. Nothing else is
remembered anywhere, so that it does not matter who does a unit, how often it is tried, or whether the one who asked for it is alive.
"""

from __future__ import annotations

import functools
import hashlib
import json
import mmap
import os
import resource
import shutil
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.parquet

import depthcal

#: Frames that a worker has in memory at a time, beyond what is mapped from files.
FRAMES_AT_A_TIME = 64


def fingerprint(*parts: Any) -> str:
    """A short name for what a unit was made from."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()[:16]


def row_path(out: Path, unit: str) -> Path:
    """Where the row of a unit is."""
    return out / "rows" / f"{unit}.parquet"


def is_done(out: Path, unit: str, made_from: str) -> bool:
    """Whether a unit is done, from the same input."""
    path = row_path(out, unit)
    try:
        return pyarrow.parquet.read_table(path, columns=["made_from"])["made_from"][0].as_py() == made_from
    except (FileNotFoundError, pyarrow.ArrowException):
        return False


def source_of(out: Path, unit: str) -> str | None:
    """The source of a unit that is done; None where there is none."""
    try:
        return pyarrow.parquet.read_table(row_path(out, unit), columns=["source"])["source"][0].as_py()
    except (FileNotFoundError, pyarrow.ArrowException):
        return None


def write_row(out: Path, unit: str, row: dict[str, Any]) -> None:
    """Writes the row of a unit: it is done."""
    path = row_path(out, unit)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(f".{os.getpid()}.tmp")
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist([row]), temporary)
    os.replace(temporary, path)


def remove_leftovers(out: Path) -> None:
    """Removes what interrupted units left behind. Nobody may be at work in ``out``."""
    for path in [*out.glob(".*.tmp"), *(out / "rows").glob("*.tmp")]:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def peak_mib() -> float:
    """The most memory that this process has had, MiB, pages of mapped files included."""
    try:
        # Linux counts to getrusage's peak what the parent had before it became this program.
        status = Path("/proc/self/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0]) / 1024
    except (OSError, IndexError):
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak / (1 << 20) if sys.platform == "darwin" else peak / (1 << 10)


# --- Cameras ------------------------------------------------------------------------------------------------------------------------


def capture(source: str) -> depthcal.Dataset:
    """The capture of a camera: a folder with a ``dataset.toml``, with ``corners.npz`` beside it where the corners are another program's;
    or ``simulated:UNIT`` for the simulated camera of that number."""
    if source.startswith("simulated:"):
        unit = int(source.removeprefix("simulated:"))
        return depthcal.simulate_points(frames=16, samples=200, effects=["cyclic_depth=5"], unit=unit, seed=1000 + unit)
    corners = Path(source) / "corners.npz"
    if corners.exists():
        with np.load(corners) as found:
            return depthcal.load(source, corners={name: found[name] for name in found.files})
    return depthcal.load(source)


def unit_of(source: str) -> str:
    """The name of a camera's results: that of its folder, with a short form of where that lies, because folders of many cameras may have one
    name (``camA/calib``, ``camB/calib``)."""
    if source.startswith("simulated:"):
        return source.replace(":", "_")
    path = Path(source).absolute()
    return f"{path.parent.name}-{path.name}-{fingerprint(str(path))[:6]}"


def camera_made_from(source: str, diagnose: bool) -> str:
    """What a camera's results are made from: its files by name, size and time, and what is asked for."""
    files = [] if source.startswith("simulated:") else sorted(p for p in Path(source).rglob("*") if p.is_file())
    listed = [(str(p.relative_to(source)), p.stat().st_size, p.stat().st_mtime_ns) for p in files]
    return fingerprint(depthcal.__version__, source, listed, diagnose)


def calibrate_camera(source: str, out: str, diagnose: bool = True) -> dict[str, Any]:
    """Calibrates a camera, finds what its model lacks, and writes the files of the command line into ``out/UNIT``. A camera that cannot be
    calibrated is done as well: its row has the reason."""
    folder, unit, started = Path(out), unit_of(source), time.time()
    made_from = camera_made_from(source, diagnose)
    row: dict[str, Any] = {
        "unit": unit,
        "source": source,
        "made_from": made_from,
        "failed": None,
        "verdict": None,
        "effects": None,
    }
    try:
        dataset = capture(source)
        result = (
            depthcal.diagnose(dataset, discovery=False) if diagnose else depthcal.calibrate(dataset, cross_validate=3)
        )
    except depthcal.Error as error:
        row["failed"] = f"{type(error).__name__}: {error}"
    else:
        temporary = folder / f".{unit}.{os.getpid()}.tmp"
        shutil.rmtree(temporary, ignore_errors=True)
        result.save(temporary)
        shutil.rmtree(folder / unit, ignore_errors=True)
        os.replace(temporary, folder / unit)
        errors = result.errors[len(result.errors) - 1]
        row |= {"depth_rms_before_mm": errors.depth_rms_before_mm, "depth_rms_mm": errors.depth_rms_mm}
        row |= {p.name: p.value for p in result.calibration.parameters}
        row |= {f"{p.name}.std": p.std_dev for p in result.calibration.parameters if p.std_dev is not None}
        if diagnose:
            row |= {"verdict": result.verdict, "effects": ",".join(step.effect for step in result.steps)}
    row |= {"seconds": time.time() - started, "worker": os.getpid(), "peak_mib": peak_mib()}
    write_row(folder, unit, row)
    return row


# --- Frames -------------------------------------------------------------------------------------------------------------------------


@functools.lru_cache(maxsize=4)
def corrector(calibration: str, modified_ns: int) -> depthcal.Corrector:
    """A corrector, built once in each worker and used for all of its shards. One thread: a worker has one core."""
    return depthcal.Corrector(depthcal.Calibration.load(calibration), threads=1)


def shard_made_from(shard: str, calibration: str, unit_mm: float, form: str) -> str:
    """What a corrected shard is made from."""
    stat = os.stat(shard)
    content = hashlib.sha256(Path(calibration).read_bytes()).hexdigest()
    return fingerprint(depthcal.__version__, shard, stat.st_size, stat.st_mtime_ns, content, unit_mm, form)


def correct_shard(shard: str, calibration: str, out: str, unit_mm: float = 1.0, form: str = "zarr") -> dict[str, Any]:
    """Corrects a shard: a file ``NAME.npy`` of frames (n, height, width), uint16. The result is a Zarr array ``out/NAME.zarr`` with a chunk
    for some frames, or a folder ``out/NAME`` of PNG files.

    The shard is mapped, not read: a frame is read from the page cache by the correction itself, and never copied. Pages are let go after
    their frames, so that memory does not grow with the shard.
    """
    folder, unit, started = Path(out), Path(shard).stem, time.time()
    if (other := source_of(folder, unit)) not in (None, shard):
        raise ValueError(f"{unit} in {out} is of {other}: give {shard} another folder for its results, or another name")
    frames = np.load(shard, mmap_mode="r")
    correct = corrector(calibration, os.stat(calibration).st_mtime_ns)
    temporary = folder / f".{unit}.{os.getpid()}.tmp"
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.parent.mkdir(parents=True, exist_ok=True)
    write = _writer(form, temporary, frames.shape)
    counts, correcting = np.zeros(4, np.int64), 0.0
    buffer = np.empty((min(FRAMES_AT_A_TIME, len(frames)), *frames.shape[1:]), np.uint16)
    for first in range(0, len(frames), FRAMES_AT_A_TIME):
        part = frames[first : first + FRAMES_AT_A_TIME]
        begin = time.perf_counter()
        corrected, some = correct.correct_counting(part, unit_mm, out=buffer[: len(part)])
        correcting += time.perf_counter() - begin
        counts += some
        write(first, corrected)
        if hasattr(mmap, "MADV_DONTNEED"):
            frames._mmap.madvise(mmap.MADV_DONTNEED)
    final = folder / (f"{unit}.zarr" if form == "zarr" else unit)
    shutil.rmtree(final, ignore_errors=True)
    os.replace(temporary, final)
    names = ("corrected", "saturated", "without_depth", "not_correctable")
    row = {
        "unit": unit,
        "source": shard,
        "made_from": shard_made_from(shard, calibration, unit_mm, form),
        "frames": len(frames),
        **dict(zip(names, counts.tolist())),
        "correcting_s": correcting,
        "seconds": time.time() - started,
        "worker": os.getpid(),
        "peak_mib": peak_mib(),
    }
    write_row(folder, unit, row)
    return row


def _writer(form: str, path: Path, shape: tuple[int, ...]) -> Any:
    """A function that writes frames from number ``first`` on."""
    if form == "zarr":
        import zarr

        chunks = (min(FRAMES_AT_A_TIME, shape[0]), *shape[1:])
        array = zarr.create_array(
            str(path), shape=shape, chunks=chunks, dtype="uint16", compressors=zarr.codecs.ZstdCodec(level=1)
        )

        def write(first: int, part: np.ndarray) -> None:
            array[first : first + len(part)] = part

    elif form == "png":
        import cv2

        path.mkdir()

        def write(first: int, part: np.ndarray) -> None:
            for i, frame in enumerate(part):
                cv2.imwrite(str(path / f"{first + i:06d}.png"), frame, [cv2.IMWRITE_PNG_COMPRESSION, 1])

    elif form == "none":

        def write(first: int, part: np.ndarray) -> None:
            path.mkdir(exist_ok=True)

    else:
        raise ValueError(f"format '{form}': give zarr, png or none")
    return write


def table(out: str) -> pyarrow.Table:
    """The rows of all units that are done, in order of their names, also written to ``out/results.parquet``."""
    paths = sorted((Path(out) / "rows").glob("*.parquet"))
    tables = [pyarrow.parquet.read_table(path) for path in paths]
    joined = pyarrow.concat_tables(tables, promote_options="permissive")
    pyarrow.parquet.write_table(joined, Path(out) / "results.parquet")
    return joined
