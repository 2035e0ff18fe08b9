"""Calibrates the cameras of a fleet, or corrects an archive of frames, by Ray. The same on one machine and on a cluster.

    python fleet.py calibrate captures/* --out results/                     # this machine
    python fleet.py correct shards/*.npy --calibration results/cam7/calibration.json --out corrected/
    python fleet.py calibrate captures/* --out /shared/results/ --address auto          # a cluster; paths on a file system of all nodes

Run it again after anything went wrong: units that are done are not done again. Lost workers are Ray's to replace: a task is tried
three more times. Ray keeps a few hundred bytes per unit in flight; data stay in files.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import work  # noqa: E402


def pending(arguments: argparse.Namespace) -> tuple[Callable[..., Any], list[tuple[Any, ...]]]:
    """The function of a unit, and the arguments of all units that are not done."""
    out = Path(arguments.out)
    if arguments.task == "calibrate":
        diagnose = not arguments.no_diagnose
        todo = [
            s for s in arguments.sources if not work.is_done(out, work.unit_of(s), work.camera_made_from(s, diagnose))
        ]
        return work.calibrate_camera, [(source, arguments.out, diagnose) for source in todo]
    settings = (arguments.calibration, arguments.unit_mm, arguments.format)
    todo = [s for s in arguments.sources if not work.is_done(out, Path(s).stem, work.shard_made_from(s, *settings))]
    return work.correct_shard, [(shard, arguments.calibration, arguments.out, *settings[1:]) for shard in todo]


def run(function: Callable[..., Any], todo: list[tuple[Any, ...]], arguments: argparse.Namespace) -> list[str]:
    """Has Ray do all units; returns why units failed. At most two units per core are in flight, however many there are."""
    import ray

    ray.init(
        address=arguments.address,
        num_cpus=None if arguments.address else arguments.workers,
        include_dashboard=False,
        log_to_driver=False,
        # The functions travel with their folder. A worker has one core.
        runtime_env={
            "working_dir": str(Path(__file__).parent),
            "env_vars": {"RAYON_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        },
    )
    task = ray.remote(num_cpus=1, max_retries=3, retry_exceptions=[OSError])(function)
    window = 2 * int(ray.cluster_resources().get("CPU", 1))
    waiting, failures, done, started = {}, [], 0, time.time()
    rest = iter(todo)
    while True:
        for unit in rest:
            waiting[task.remote(*unit)] = unit[0]
            if len(waiting) >= window:
                break
        if not waiting:
            break
        (ready,), _ = ray.wait(list(waiting))
        source = waiting.pop(ready)
        try:
            row = ray.get(ready)
        except ray.exceptions.RayError as error:
            failures.append(f"{source}: {str(error).strip().splitlines()[-1]}")
            continue
        done += 1
        if row.get("failed"):
            failures.append(f"{source}: {row['failed']}")
        if arguments.verbose:
            print(f"{done}/{len(todo)} {row['unit']} {row['seconds']:.2f} s, worker {row['worker']}", flush=True)
    seconds = time.time() - started
    print(f"{done} units in {seconds:.1f} s, {window // 2} workers", flush=True)
    ray.shutdown()
    return failures


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    tasks = parser.add_subparsers(dest="task", required=True)
    calibrate = tasks.add_parser("calibrate", help="calibrate cameras: folders of captures, or simulated:UNIT")
    calibrate.add_argument("--no-diagnose", action="store_true", help="calibrate only")
    correct = tasks.add_parser("correct", help="correct shards: .npy files of frames (n, height, width), uint16")
    correct.add_argument("--calibration", required=True, help="a calibration.json")
    correct.add_argument("--unit-mm", type=float, default=1.0, help="millimetres per step")
    correct.add_argument("--format", default="zarr", choices=["zarr", "png", "none"])
    for sub in (calibrate, correct):
        sub.add_argument("sources", nargs="+")
        sub.add_argument("--out", required=True)
        sub.add_argument("--address", help="of a Ray cluster, such as auto; this machine otherwise")
        sub.add_argument("--workers", type=int, default=os.cpu_count(), help="on this machine")
        sub.add_argument("--verbose", action="store_true")
    arguments = parser.parse_args()
    arguments.out = str(Path(arguments.out).absolute())
    arguments.sources = [s if s.startswith("simulated:") else str(Path(s).absolute()) for s in arguments.sources]
    if arguments.task == "correct":
        arguments.calibration = str(Path(arguments.calibration).absolute())
    Path(arguments.out).mkdir(parents=True, exist_ok=True)
    work.remove_leftovers(Path(arguments.out))
    function, todo = pending(arguments)
    print(f"{len(arguments.sources) - len(todo)} of {len(arguments.sources)} units are done", flush=True)
    failures = run(function, todo, arguments) if todo else []
    work.remove_leftovers(Path(arguments.out))
    for failure in failures:
        print(f"failed: {failure}", file=sys.stderr)
    print(f"{work.table(arguments.out).num_rows} rows in {arguments.out}/results.parquet")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
