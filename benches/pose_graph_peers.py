#!/usr/bin/env python3
"""Pose graphs: ours and GTSAM take turns on the same graphs from the same start with the same objective.

    benches/pose_graph_peers.py --graphs DIR --gtsam-python PYTHON [--rounds 5] [--threads 1,2] [--start chordal] [--json FILE]

DIR holds files of g2o, plain or compressed by xz, such as those that come with SE-Sync. PYTHON is an interpreter with GTSAM
and numpy. The objective is SE-Sync's, Σ κ ‖R_j − R_i R_ij‖² + τ ‖t_j − t_i − R_i t_ij‖², with κ and τ of the information matrices:
in GTSAM `FrobeniusBetweenFactorPose2` and `FrobeniusBetweenFactorPose3`. Ours computes the start and writes it; all read it. The
results of all are evaluated here by one function that shares code with none. GTSAM runs Gauss-Newton, Levenberg-Marquardt
as it is by default, and with Ceres' defaults, multifrontal Cholesky; `between` is Gauss-Newton with `BetweenFactorPose2` and
`BetweenFactorPose3`, the factors that GTSAM's users have, whose objective has angles instead of chords and hence another
minimum. Times are those of the solve, without the start.

GTSAM runs in this file with `--worker GRAPH START RESULT VARIANT`, which prints one line of JSON; the environment variable
MAX_ITERATIONS bounds its iterations.
"""
import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile

TOLERANCE = 1e-8
VARIANTS = ("gauss-newton", "levenberg-marquardt", "ceres-defaults", "between")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--graphs", help="folder of .g2o or .g2o.xz files")
    parser.add_argument("--gtsam-python", help="interpreter with GTSAM")
    parser.add_argument("--ours", help="the example pose_graph; built if not given")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--start", default="chordal", choices=["chordal", "tree", "file"])
    parser.add_argument("--only", help="names of graphs, separated by commas")
    parser.add_argument("--json")
    parser.add_argument("--worker", nargs=4, metavar=("GRAPH", "START", "RESULT", "VARIANT"), help=argparse.SUPPRESS)
    return parser.parse_args()


def read(path):
    """Measurements (i, j, pose, κ, τ) and poses {id: pose} of a file of g2o; a pose is [x, y, θ] or [x, y, z, qx, qy, qz, qw]."""
    import numpy as np

    measurements, poses = [], {}
    for line in open(path):
        tag, *words = line.split() or [""]
        numbers = [float(w) for w in words]
        if tag.startswith("VERTEX"):
            poses[int(words[0])] = numbers[1:]
        elif tag.startswith("EDGE"):
            n, d = (3, 2) if tag == "EDGE_SE2" else (6, 3)
            size = 3 if n == 3 else 7
            information, upper = np.zeros((n, n)), iter(numbers[2 + size :])
            for a in range(n):
                for b in range(a, n):
                    information[a, b] = information[b, a] = next(upper)
            tau = d / np.trace(np.linalg.inv(information[:d, :d]))
            kappa = information[2, 2] if n == 3 else 1.5 / np.trace(np.linalg.inv(information[3:, 3:]))
            measurements.append((int(words[0]), int(words[1]), numbers[2 : 2 + size], kappa, tau))
    return measurements, poses


def motion(pose):
    """Rotation matrix and translation, both as lists."""
    if len(pose) == 3:
        c, s = math.cos(pose[2]), math.sin(pose[2])
        return [[c, -s], [s, c]], pose[:2]
    x, y, z, w = pose[3:]
    n = math.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = x / n, y / n, z / n, w / n
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return rotation, pose[:3]


def objective(measurements, poses):
    """SE-Sync's objective."""
    import numpy as np

    at = {i: [np.array(part) for part in motion(pose)] for i, pose in poses.items()}
    terms = []
    for i, j, pose, kappa, tau in measurements:
        (ri, ti), (rj, tj), (r, t) = at[i], at[j], [np.array(part) for part in motion(pose)]
        terms.append(kappa * np.sum((rj - ri @ r) ** 2) + tau * np.sum((tj - ti - ri @ t) ** 2))
    return math.fsum(terms)


def worker(graph, start, result, variant):
    """Solves one graph with GTSAM."""
    import time

    import gtsam
    import numpy as np

    measurements, poses = read(graph)[0], read(start)[1]
    plane = len(next(iter(poses.values()))) == 3
    make = (lambda p: gtsam.Pose2(*p)) if plane else (lambda p: gtsam.Pose3(gtsam.Rot3(np.array(motion(p)[0])), np.array(p[:3])))
    factor = gtsam.FrobeniusBetweenFactorPose2 if plane else gtsam.FrobeniusBetweenFactorPose3
    d = 2 if plane else 3
    values, factors = gtsam.Values(), gtsam.NonlinearFactorGraph()
    for i, pose in poses.items():
        values.insert(i, make(pose))
    between = gtsam.BetweenFactorPose2 if plane else gtsam.BetweenFactorPose3
    for i, j, pose, kappa, tau in measurements:
        if variant == "between":
            # The norm of R_j - R_i R_ij is √2 times the angle, for small ones; Pose2 has the angle last, Pose3 first.
            precision = [tau, tau, 2 * kappa] if plane else [2 * kappa] * 3 + [tau] * 3
            factors.add(between(i, j, make(pose), gtsam.noiseModel.Diagonal.Precisions(np.array(precision))))
            continue
        # Columns of a homogeneous matrix; its last row is constant.
        precision = ([kappa] * d + [1.0]) * d + [tau] * d + [1.0]
        factors.add(factor(i, j, make(pose), gtsam.noiseModel.Diagonal.Precisions(np.array(precision))))
    first = min(poses)
    # GTSAM has no fixed variables; an equality constraint would be eliminated by QR.
    prior = gtsam.PriorFactorPose2 if plane else gtsam.PriorFactorPose3
    factors.add(prior(first, make(poses[first]), gtsam.noiseModel.Isotropic.Sigma(3 if plane else 6, 1e-6)))
    if variant in ("gauss-newton", "between"):
        params, optimizer = gtsam.GaussNewtonParams(), gtsam.GaussNewtonOptimizer
    else:
        params = gtsam.LevenbergMarquardtParams.CeresDefaults() if variant == "ceres-defaults" else gtsam.LevenbergMarquardtParams()
        optimizer = gtsam.LevenbergMarquardtOptimizer
    params.setRelativeErrorTol(TOLERANCE)
    params.setAbsoluteErrorTol(0.0)
    params.setMaxIterations(int(os.environ.get("MAX_ITERATIONS", 100)))
    begin = time.perf_counter()
    solver = optimizer(factors, values, params)
    solved = solver.optimize()
    wall = time.perf_counter() - begin
    with open(result, "w") as file:
        for i in poses:
            if plane:
                p = solved.atPose2(i)
                file.write(f"VERTEX_SE2 {i} {p.x()!r} {p.y()!r} {p.theta()!r}\n")
            else:
                p = solved.atPose3(i)
                q, t = p.rotation().toQuaternion(), p.translation()
                numbers = " ".join(repr(float(v)) for v in (*t, q.x(), q.y(), q.z(), q.w()))
                file.write(f"VERTEX_SE3:QUAT {i} {numbers}\n")
    memory = next(int(line.split()[1]) / 1024 for line in open("/proc/self/status") if line.startswith("VmHWM"))
    print(json.dumps({"wall": wall, "iters": solver.iterations(), "rss_mb": memory}))


def run(command, threads):
    # GTSAM's own threads are those of TBB, which follows the processors that the process may use.
    command = ["taskset", "-c", ",".join(str(i) for i in range(threads)), *command]
    process = subprocess.run(command, capture_output=True, text=True, env=dict(os.environ, OPENBLAS_NUM_THREADS="1"))
    lines = [json.loads(line) for line in process.stdout.splitlines() if line.startswith("{")]
    if not lines:
        return {"wall": math.nan, "iters": 0, "rss_mb": math.nan, "failed": process.stderr.strip().splitlines()[-1:]}
    return lines[-1]


def measure(name, graph, options, folder):
    """The lines of a table for one graph."""
    start, measurements = f"{folder}/start.g2o", read(graph)[0]
    programs, seen = {}, {}
    results = {}
    for threads in map(int, options.threads.split(",")):
        own = f"{folder}/ours-{threads}.g2o"
        programs["ours", threads] = [options.ours, graph, "--start", options.start, "--threads", str(threads), "--write-start", start, "--write", own]
        results["ours", threads] = own
        for variant in VARIANTS if options.gtsam_python else ():
            result = f"{folder}/{variant}-{threads}.g2o"
            programs[variant, threads] = [options.gtsam_python, __file__, "--worker", graph, start, result, variant]
            results[variant, threads] = result
    for _ in range(options.rounds):
        for key, command in programs.items():
            seen.setdefault(key, []).append(run(command, key[1]))
    rows = []
    for (solver, threads), runs in seen.items():
        cost = objective(measurements, read(results[solver, threads])[1]) if "failed" not in runs[0] else math.nan
        median = lambda field: statistics.median(r.get(field, 0.0) for r in runs)
        rows.append(
            dict(graph=name, solver=solver, threads=threads, ms=1e3 * (median("wall") - median("start")), start_ms=1e3 * median("start"),
                 iterations=runs[0]["iters"], objective=cost, memory=median("rss_mb"), failed=runs[0].get("failed"))
        )
    least = min(r["objective"] for r in rows if r["objective"] == r["objective"])
    for r in rows:
        print(
            f"| {name} | {r['solver']} | {r['threads']} | {r['ms']:.1f} | {r['start_ms']:.1f} | {r['iterations']} "
            f"| {r['objective']:.8g} | {(r['objective'] - least) / least:.0e} | {r['memory']:.0f} |",
            flush=True,
        )
    return rows


def main():
    options = arguments()
    if options.worker:
        return worker(*options.worker)
    if not options.graphs:
        sys.exit("--graphs has to name a folder of files of g2o")
    if not options.ours:
        from peers import build

        options.ours = build("-p", "depthcal-solver", "--example", "pose_graph")
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}, medians of {options.rounds}, start {options.start}\n")
    print("| graph | solver | threads | ms | start, ms | iterations | objective | above the least | memory, MB |\n|---|---|---|---|---|---|---|---|---|")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for file in sorted(os.listdir(options.graphs)):
            name = file.removesuffix(".xz").removesuffix(".g2o")
            if name == file or options.only and name not in options.only.split(","):
                continue
            graph = os.path.join(options.graphs, file)
            if file.endswith(".xz"):
                plain = f"{folder}/{name}.g2o"
                with open(plain, "wb") as out:
                    subprocess.run(["xz", "-dc", graph], stdout=out, check=True)
                graph = plain
            rows += measure(name, graph, options, folder)
    if options.json:
        with open(options.json, "w") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
