#!/usr/bin/env python3
"""The solver against Ceres on the same files, side by side: programs take turns, medians, ratios within the run.

    benches/compare.py --peers DIR [--rounds 5] [--threads 1,2] [--sizes 30,300,3000] [--bal FILE] [--json FILE]

DIR (or the environment variable PEERS), which benches/setup_peers.sh makes, holds the programs `ceres_board FILE 3d VARIANT dense THREADS 1` and
`ceres_bal FILE VARIANT THREADS 1 50`, and `data/board_44_N.txt` with N frames of 44 points. `--bal` names a problem of
bundle adjustment in the large as plain text, by default `data/problem-16-22106-pre.txt` in DIR; it is left out if it is not
there. Our examples are built first, unless `--ours` names the folder that they are in.

Every program prints a line of JSON with at least: wall (seconds of the solve alone), cost0, cost, iters, build, rss_mb.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys

from peers import build


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers", default=os.environ.get("PEERS"), help="folder of Ceres' programs")
    parser.add_argument("--ours", help="folder of the examples; built if not given")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--sizes", default="30,300,3000")
    parser.add_argument("--bal")
    parser.add_argument("--json")
    options = parser.parse_args()
    if not options.peers:
        sys.exit("--peers or the environment variable PEERS has to name the folder of Ceres' programs")
    return options


def run(command, threads):
    environment = dict(os.environ, OPENBLAS_NUM_THREADS="1", RAYON_NUM_THREADS=str(threads))
    process = subprocess.run(command, capture_output=True, text=True, env=environment)
    lines = [json.loads(line) for line in process.stdout.splitlines() if line.startswith("{")]
    if not lines:
        sys.exit(f"{' '.join(command)}: no result: {process.stderr[-300:]}")
    return lines[-1]


def main():
    options = arguments()
    peers = os.path.abspath(options.peers)
    ours = os.path.abspath(options.ours) if options.ours else os.path.dirname(build("-p", "depthcal-solver", "--example", "board", "--example", "bal"))
    threads = [int(t) for t in options.threads.split(",")]
    jobs = []
    for size in filter(None, options.sizes.split(",")):
        path = f"{peers}/data/board_44_{size}.txt"
        for t in threads:
            jobs.append((f"board {size}", "ours", t, [f"{ours}/board", path, "--threads", str(t)]))
            for variant in ("analytic", "frame", "point"):
                jobs.append((f"board {size}", variant, t, [f"{peers}/ceres_board", path, "3d", variant, "dense", str(t), "1"]))
    bal = options.bal or f"{peers}/data/problem-16-22106-pre.txt"
    if os.path.exists(bal):
        for t in threads:
            jobs.append(("bal", "ours", t, [f"{ours}/bal", bal, "--threads", str(t)]))
            for variant in ("dense", "sparse", "iterative"):
                jobs.append(("bal", variant, t, [f"{peers}/ceres_bal", bal, variant, str(t), "1", "50"]))
    seen = {}
    for _ in range(options.rounds):
        for problem, solver, t, command in jobs:
            seen.setdefault((problem, solver, t), []).append(run(command, t))
    median = lambda key, field: statistics.median(r[field] for r in seen[key])
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}, medians of {options.rounds}\n")
    print("| problem | solver | threads | ms | iterations | cost | build ms | memory MB |")
    print("|---|---|---|---|---|---|---|---|")
    for key in seen:
        problem, solver, t = key
        name = "this crate" if solver == "ours" else f"Ceres, {solver}"
        print(
            f"| {problem} | {name} | {t} | {1e3 * median(key, 'wall'):.2f} | {seen[key][0]['iters']} "
            f"| {median(key, 'cost'):.6f} | {1e3 * median(key, 'build'):.2f} | {median(key, 'rss_mb'):.0f} |"
        )
    print()
    best = lambda problem, names: min(median(k, "wall") for k in seen if k[0] == problem and k[1] in names)
    at_one = lambda problem, names: min(median(k, "wall") for k in seen if k[0] == problem and k[1] in names and k[2] == 1)
    print("| problem | best against best | one thread against one | against AutoDiff, best | one thread, AutoDiff |")
    print("|---|---|---|---|---|")
    problems = list(dict.fromkeys(k[0] for k in seen))
    for problem in problems:
        mine, mine_one = best(problem, ["ours"]), at_one(problem, ["ours"]) if 1 in threads else float("nan")
        every = {k[1] for k in seen if k[0] == problem} - {"ours"}
        row = [best(problem, every) / mine, at_one(problem, every) / mine_one]
        if "point" in every:
            row += [best(problem, ["point"]) / mine, at_one(problem, ["point"]) / mine_one]
        print(f"| {problem} | " + " | ".join(f"{x:.1f}" for x in row) + " |" * (5 - len(row)))
    print()
    for problem in problems:
        keys = [k for k in seen if k[0] == problem and k[1] == "ours"]
        cheapest = min(median(k, "cost") for k in seen if k[0] == problem and k[1] != "ours")
        cost = max(median(k, "cost") for k in keys)
        build_share = median(keys[0], "build") / (median(keys[0], "wall") / seen[keys[0]][0]["iters"])
        gain = median(keys[0], "wall") / min(median(k, "wall") for k in keys)
        print(f"{problem}: cost {(cost - cheapest) / cheapest:+.1e} relative to Ceres' lowest; ", end="")
        print(f"build {build_share:.2f} of an iteration; more threads gain {gain:.2f}")
    boards = [p for p in problems if p.startswith("board")]
    if len(boards) > 1:
        per_frame = [at_one(p, ["ours"]) / seen[(p, "ours", 1)][0]["iters"] / int(p.split()[1]) for p in boards]
        growth = ", ".join(f"{1e6 * x:.2f} ({p.split()[1]})" for x, p in zip(per_frame, boards))
        print(f"one thread, µs per frame and iteration: {growth}")
    if options.json:
        with open(options.json, "w") as file:
            json.dump([dict(problem=k[0], solver=k[1], threads=k[2], runs=v) for k, v in seen.items()], file, indent=1)


main()
