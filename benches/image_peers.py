#!/usr/bin/env python3
"""Calibration from corners alone beside OpenCV and mrcal, in turns, in one run: times from corners to covariance, and results.

    benches/image_peers.py [OBSERVATIONS.json...] [--frames 34,340] [--threads 1,2] [--rounds 5] [--repeats 3]
        [--opencv-python PYTHON] [--mrcal-python PYTHON] [--ours PROGRAM] [--json FILE]

Corners are simulated: a chessboard of 10 by 7 corners, 640 by 480 pixels, a mild lens (k1 k2 p1 p2 k3), 0.1 px of noise, poses
that vary. Files that are named are measured as well; `depthcal detect --out FOLDER` writes them. OpenCV has to be importable
in one Python, mrcal in one (Debian: python3-mrcal); a peer that is not is left out. Our example is built first, unless
`--ours` names the program.

All fit fx fy cx cy k1 k2 p1 p2 k3 and a pose per frame, with a plane board, and end with standard deviations:

- ours: `calibrate_image` with `brown-conrady:full`, no start values; it also looks for mirrored poses and misdetected boards,
  and estimates the noise from the residuals, which takes two adjustments or more. `ours, chooses` is the default, which also
  chooses the order of the lens where the corners leave it uncertain at the image's border.
- OpenCV: `calibrateCameraExtended` without a guess; `LU` with CALIB_USE_LU; `no covariance` is `calibrateCamera`, which gives no
  standard deviations. Its points are 32-bit. Its standard deviations are scaled by the residuals.
- mrcal: the solves of `mrcal-calibrate-cameras`: poses by `seed_stereographic`, then `optimize` for the poses, with the core,
  with the lens; a plane board, no regularisation, no rejection of outliers. `checks` is with both, as the tool has it. mrcal
  needs a focal length that a user gives by hand: here the image's width, 640 px for simulated corners, which is 29 % too
  long. Its standard deviations are those of (JᵀJ)⁻¹ by the factorization of `optimizer_callback`, scaled by the residuals.
  Regular grids only.

Programs take turns, round by round, in processes of their own with as many threads as asked for. The first repetition of a
process is timed like the others. On a busy machine ratios within a run say more than times, and processor time, summed over
threads, more than time by the clock.
"""
import argparse
import json
import math
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time

from peers import build, has

WIDTH, HEIGHT = 640, 480
PINHOLE = [497.3, 496.1, 322.6, 236.8]
LENS = [-0.12, 0.05, 0.0008, -0.0005, -0.02]  # k1 k2 p1 p2 k3
COLUMNS, ROWS, SPACING_MM = 10, 7, 25.0
SIGMA_PX = 0.1
# Calibrations of one process end after this time, s.
SLOW_S = 4.0


def rotation(vector):
    angle = math.sqrt(sum(x * x for x in vector))
    x, y, z = [v / angle for v in vector]
    c, s = math.cos(angle), math.sin(angle)
    d = 1 - c
    return [[c + x * x * d, x * y * d - z * s, x * z * d + y * s],
            [y * x * d + z * s, c + y * y * d, y * z * d - x * s],
            [z * x * d - y * s, z * y * d + x * s, c + z * z * d]]  # fmt: skip


def project(point):
    x, y = point[0] / point[2], point[1] / point[2]
    k1, k2, p1, p2, k3 = LENS
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return [PINHOLE[0] * u + PINHOLE[2], PINHOLE[1] * v + PINHOLE[3]]


def simulated(frames):
    """Observations of whole boards in view, tilted by up to 45°, from 300 to 1200 mm away."""
    generator = random.Random(frames)
    board = [(SPACING_MM * (i % COLUMNS), SPACING_MM * (i // COLUMNS)) for i in range(COLUMNS * ROWS)]
    middle = [0.5 * SPACING_MM * (COLUMNS - 1), 0.5 * SPACING_MM * (ROWS - 1)]
    made = []
    while len(made) < frames:
        axis = [generator.gauss(0, 1), generator.gauss(0, 1), generator.gauss(0, 0.6)]
        size = math.radians(generator.uniform(5, 45)) / math.sqrt(sum(a * a for a in axis))
        turn = rotation([a * size for a in axis])
        z = generator.uniform(300, 1200)
        centre = [generator.uniform(-0.6, 0.6) * z, generator.uniform(-0.45, 0.45) * z, z]
        points = [[centre[i] + turn[i][0] * (x - middle[0]) + turn[i][1] * (y - middle[1]) for i in range(3)] for x, y in board]
        if min(p[2] for p in points) < 100:
            continue
        pixels = [project(p) for p in points]
        if any(not (2 < u < WIDTH - 3 and 2 < v < HEIGHT - 3) for u, v in pixels):
            continue
        # A lens of high order folds far outside: only what is really in view.
        if max(math.hypot(p[0], p[1]) / p[2] for p in points) > 0.85:
            continue
        noisy = [[u + generator.gauss(0, SIGMA_PX), v + generator.gauss(0, SIGMA_PX)] for u, v in pixels]
        markers = [{"index": i, "pixel": p, "std_px": 1.0} for i, p in enumerate(noisy)]
        made.append({"name": f"{len(made):04}", "width": WIDTH, "height": HEIGHT, "markers": markers})
    target = {"kind": "chessboard", "columns": COLUMNS, "rows": ROWS, "spacing_mm": SPACING_MM}
    dataset = {"path": f"simulated {frames}", "digest": "0"}
    return {"format": "depthcal-observations", "version": 1, "dataset": dataset, "target": target, "frames": made}


def grid(target):
    """Columns and rows of the corners, and the board's points, mm."""
    kind, columns, rows, s = target["kind"], target["columns"], target["rows"], target["spacing_mm"]
    if kind == "asymmetric-circles":
        points = [((2 * (i % columns) + i // columns % 2) * s, i // columns * s) for i in range(columns * rows)]
        return None, points
    if kind == "aprilgrid":
        sys.exit("boards of tags are not read here")
    offset = 0
    if kind == "charuco":
        columns, rows, offset = columns - 1, rows - 1, 1
    return (columns, rows), [((i % columns + offset) * s, (i // columns + offset) * s) for i in range(columns * rows)]


def found_frames(observations):
    return [f for f in observations["frames"] if len(f.get("markers", [])) >= 6]


def enough(walls, repeats):
    """Whether a process has calibrated often enough: not again where once takes seconds."""
    return len(walls) >= repeats or sum(walls) > SLOW_S


def run_opencv(path, threads, repeats, variant):
    import cv2
    import numpy as np

    cv2.setNumThreads(threads)
    observations = json.load(open(path))
    frames = found_frames(observations)
    _, points = grid(observations["target"])
    board = np.array([[x, y, 0] for x, y in points], np.float32)
    objects = [board[[m["index"] for m in f["markers"]]] for f in frames]
    images = [np.array([m["pixel"] for m in f["markers"]], np.float32) for f in frames]
    size = frames[0]["width"], frames[0]["height"]
    flags = cv2.CALIB_USE_LU if variant.startswith("LU") else 0
    given = objects, images, size, None, None
    walls, cpus = [], []
    while not enough(walls, repeats):
        begin = time.perf_counter(), time.process_time()
        if variant.endswith("no covariance"):
            rms, k, lens, _, _ = cv2.calibrateCamera(*given, flags=flags)
            std_fx = None
        else:
            rms, k, lens, _, _, deviations, _, _ = cv2.calibrateCameraExtended(*given, flags=flags)
            std_fx = deviations.ravel()[0]
        walls.append(time.perf_counter() - begin[0])
        cpus.append(time.process_time() - begin[1])
    pinhole = [k[0, 0], k[1, 1], k[0, 2], k[1, 2]]
    result = dict(walls=walls, cpus=cpus, rms=rms, pinhole=pinhole, std_fx=std_fx, lens=lens.ravel()[:5].tolist())
    return dict(result, frames=len(frames), version=cv2.__version__)


def run_mrcal(path, threads, repeats, variant):
    import mrcal
    import numpy as np

    observations = json.load(open(path))
    frames = found_frames(observations)
    shape, _ = grid(observations["target"])
    if shape is None:
        return dict(skipped="its boards are regular grids")
    columns, rows = shape
    spacing = observations["target"]["spacing_mm"] / 1000
    # Corners that were not found have no weight.
    corners = np.zeros((len(frames), rows, columns, 3))
    corners[..., 2] = -1
    for corner, frame in zip(corners, frames):
        for marker in frame["markers"]:
            corner[marker["index"] // columns, marker["index"] % columns] = [*marker["pixel"], 1 / marker["std_px"]]
    size = np.array([[frames[0]["width"], frames[0]["height"]]], np.int32)
    frame_camera = np.zeros((len(frames), 2), np.int32)
    frame_camera[:, 0] = np.arange(len(frames))
    indices = np.zeros((len(frames), 3), np.int32)
    indices[:, 0], indices[:, 2] = np.arange(len(frames)), -1
    walls, cpus = [], []
    while not enough(walls, repeats):
        observed = corners.copy()
        begin = time.perf_counter(), time.process_time()
        intrinsics, _, poses = mrcal.seed_stereographic(size, float(size[0, 0]), frame_camera, observed, spacing)
        problem = dict(
            intrinsics=intrinsics, extrinsics_rt_fromref=np.zeros((0, 6)), frames_rt_toref=poses, points=None,
            observations_board=observed, indices_frame_camintrinsics_camextrinsics=indices, observations_point=None,
            indices_point_camintrinsics_camextrinsics=None, lensmodel="LENSMODEL_STEREOGRAPHIC", imagersizes=size,
            calibration_object_spacing=spacing, calobject_warp=None, do_optimize_frames=True,
            do_optimize_intrinsics_core=False, do_optimize_intrinsics_distortions=False, do_optimize_extrinsics=False,
            do_optimize_calobject_warp=False, do_apply_outlier_rejection=False, do_apply_regularization=False,
        )  # fmt: skip
        mrcal.optimize(**problem)
        problem.update(do_optimize_intrinsics_core=True)
        mrcal.optimize(**problem)
        intrinsics = np.hstack((problem["intrinsics"], np.zeros((1, 5))))
        problem.update(intrinsics=intrinsics, lensmodel="LENSMODEL_OPENCV5", do_optimize_intrinsics_distortions=True)
        checks = variant == "checks"
        problem.update(do_apply_outlier_rejection=checks, do_apply_regularization=checks)
        solved = mrcal.optimize(**problem)
        _, x, _, factorization = mrcal.optimizer_callback(**problem)
        # Intrinsics come first in the state, which is in units of its own.
        states = mrcal.num_states(**problem)
        unit = np.zeros((9, states))
        unit[:, :9] = np.eye(9)
        scale = np.ones(states)
        mrcal.unpack_state(scale, **problem)
        inverse = factorization.solve_xt_JtJ_bt(unit)[:, :9] * scale[:9] * scale[:9, np.newaxis]
        used = 2 * np.count_nonzero(observed[..., 2] > 0)
        covariance = inverse * (x @ x) / (used - states)
        walls.append(time.perf_counter() - begin[0])
        cpus.append(time.process_time() - begin[1])
    fitted = problem["intrinsics"][0]
    # Its root mean square is over coordinates.
    rms = math.sqrt(2) * solved["rms_reproj_error__pixels"]
    result = dict(walls=walls, cpus=cpus, rms=rms, pinhole=fitted[:4].tolist(), lens=fitted[4:].tolist())
    return dict(result, std_fx=float(np.sqrt(covariance[0, 0])), frames=len(frames))


def worker(peer, variant, path, threads, repeats):
    run = {"opencv": run_opencv, "mrcal": run_mrcal}[peer]
    print(json.dumps(run(path, threads, repeats, variant)))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("observations", nargs="*")
    parser.add_argument("--frames", default="34,340", help="numbers of simulated frames; empty for none")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--repeats", type=int, default=3, help="calibrations in each process")
    parser.add_argument("--opencv-python", default=sys.executable)
    parser.add_argument("--mrcal-python", default=sys.executable)
    parser.add_argument("--ours", help="the example image_corners; built if not given")
    parser.add_argument("--json")
    return parser.parse_args()


def programs(options):
    """Name and command of every program that is there; FILE, THREADS and REPEATS are replaced."""
    ours = [options.ours or build("-p", "depthcal-benches", "--bin", "image_corners"), "FILE", "--threads", "THREADS", "--repeats", "REPEATS"]
    yield "ours", [*ours, "--lens", "brown-conrady:full"]
    yield "ours, chooses", ours
    peers = [
        ("OpenCV", options.opencv_python, "cv2", "opencv", ["SVD", "LU", "LU, no covariance"]),
        ("mrcal", options.mrcal_python, "mrcal", "mrcal", ["plain", "checks"]),
    ]
    for name, python, module, peer, variants in peers:
        if not has(python, module):
            print(f"SKIPPED: {name}, because {python} cannot import {module}\n", file=sys.stderr)
            continue
        for variant in variants:
            yield f"{name}, {variant}", [python, __file__, "--worker", peer, variant, "FILE", "THREADS", "REPEATS"]


def run(command, path, threads, repeats):
    filled = {"FILE": path, "THREADS": str(threads), "REPEATS": str(repeats)}
    count = {name: str(threads) for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "RAYON_NUM_THREADS")}
    process = subprocess.run(
        [filled.get(word, word) for word in command], capture_output=True, text=True, env=dict(os.environ, **count)
    )
    lines = [json.loads(line) for line in process.stdout.splitlines() if line.startswith("{")]
    return lines[-1] if lines else dict(skipped=f"it failed: {process.stderr.strip()[-200:]}")


def main():
    options = arguments()
    everything = list(programs(options))
    threads = [int(t) for t in options.threads.split(",")]
    seen, skipped = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        corners = []
        for frames in (int(f) for f in options.frames.split(",") if f):
            path = os.path.join(folder, f"{frames}.json")
            with open(path, "w") as file:
                json.dump(simulated(frames), file)
            corners.append((f"simulated, {frames} frames", path))
        corners += [(os.path.basename(os.path.dirname(os.path.abspath(p))), p) for p in options.observations]
        for _ in range(options.rounds):
            for problem, path in corners:
                for t in threads:
                    for name, command in everything:
                        if (problem, name) in skipped:
                            continue
                        result = run(command, path, t, options.repeats)
                        if "skipped" in result:
                            skipped[problem, name] = result["skipped"]
                            print(f"SKIPPED: {name} on {problem}: {result['skipped']}", file=sys.stderr)
                        else:
                            seen.setdefault((problem, name, t), []).append(result)
    def times(key, field):
        return [1e3 * time for run in seen.get(key, []) for time in run[field]]

    def ratio(own, ours):
        return f"{own / ours:.2f}" if ours else "–"

    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}, {options.rounds} rounds of {options.repeats}\n")
    print("| corners | program | threads | median, least, ms | of ours | processor: median, least, ms | of ours | rms, px | fx ± σ, px |")
    print("|---|---|---|---|---|---|---|---|---|")
    for (problem, name, t), runs in seen.items():
        cells = []
        for field in ("walls", "cpus"):
            own, ours = times((problem, name, t), field), times((problem, "ours", t), field)
            ratios = [ratio(of(own), of(ours) if ours else None) for of in (statistics.median, min)]
            cells += [f"{statistics.median(own):.1f}, {min(own):.1f}", ", ".join(ratios)]
        last = runs[-1]
        order = f" ({last['order']})" if last.get("order") else ""
        deviation = "–" if last["std_fx"] is None else f"{last['std_fx']:.4f}"
        result = f"{last['rms']:.4f} | {last['pinhole'][0]:.4f} ± {deviation}"
        print(f"| {problem} | {name}{order} | {t} | {' | '.join(cells)} | {result} |")
    if options.json:
        with open(options.json, "w") as file:
            json.dump([dict(problem=k[0], program=k[1], threads=k[2], runs=v) for k, v in seen.items()], file, indent=1)


if sys.argv[1:2] == ["--worker"]:
    worker(sys.argv[2], sys.argv[3], sys.argv[4], int(sys.argv[5]), int(sys.argv[6]))
else:
    main()
