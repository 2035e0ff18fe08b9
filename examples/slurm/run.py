"""The part of an array task: every COUNT-th unit of a list, beginning with number INDEX. The functions are those of examples/ray.

    python run.py calibrate units.txt results/                              # all of them, one after the other
    SLURM_ARRAY_TASK_ID=3 SLURM_ARRAY_TASK_COUNT=16 python run.py calibrate units.txt results/
    python run.py correct shards.txt corrected/ --calibration cam7/calibration.json
    python run.py table results/                                            # results.parquet, after the array

units.txt names a folder of captures, or a shard, per line. Units that are done are not done again: submit the array again after lost nodes
or the end of the time limit.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "ray"))

import work  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", choices=["calibrate", "correct", "table"])
    parser.add_argument(
        "paths", nargs="+", metavar="PATH", help="the list and the folder of the results; for table the folder alone"
    )
    parser.add_argument("--calibration")
    parser.add_argument("--unit-mm", type=float, default=1.0)
    parser.add_argument("--format", default="zarr", choices=["zarr", "png", "none"])
    arguments = parser.parse_args()
    out = Path(arguments.paths[-1]).absolute()
    if arguments.task == "table":
        work.remove_leftovers(out)
        print(f"{work.table(str(out)).num_rows} rows in {out}/results.parquet")
        return 0
    if len(arguments.paths) != 2 or (arguments.task == "correct" and not arguments.calibration):
        parser.error("give a list, a folder for the results and, for correct, --calibration")
    units = [line.strip() for line in Path(arguments.paths[0]).read_text().splitlines() if line.strip()]
    index, count = (
        int(os.environ.get(f"SLURM_ARRAY_TASK_{name}", default)) for name, default in (("ID", 0), ("COUNT", 1))
    )
    first = int(os.environ.get("SLURM_ARRAY_TASK_MIN", 0))
    failed = 0
    for unit in units[index - first :: count]:
        if arguments.task == "calibrate":
            done = work.is_done(out, work.unit_of(unit), work.camera_made_from(unit, True))
            row = None if done else work.calibrate_camera(unit, str(out))
        else:
            settings = (arguments.calibration, arguments.unit_mm, arguments.format)
            done = work.is_done(out, Path(unit).stem, work.shard_made_from(unit, *settings))
            row = None if done else work.correct_shard(unit, arguments.calibration, str(out), *settings[1:])
        print(f"{unit}: {'was done' if row is None else row.get('failed') or 'done'}", flush=True)
        failed += bool(row and row.get("failed"))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
