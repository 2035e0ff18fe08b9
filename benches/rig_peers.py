#!/usr/bin/env python3
"""Two cameras on a rig from corners alone beside OpenCV and mrcal, in turns, in one run: times, and whether the optima agree.

    benches/rig_peers.py [--frames 30,300,3000] [--threads 1,2] [--rounds 3]
        [--opencv-python PYTHON] [--mrcal-python PYTHON] [--ours PROGRAM] [--json FILE]

Corners are simulated by our example `rig_corners` (10 by 7 corners, infrared 640x480 px, colour 1280x720 px, noise), in single precision,
which is what OpenCV takes. OpenCV has to be importable in one Python, mrcal in one (Debian: python3-mrcal); a peer that is not is left
out and named. Our example is built first, unless `--ours` names it.

All fit fx fy cx cy k1 k2 p1 p2 k3 of both cameras, their relative pose and a pose of the board per frame, without a loss:

- ours: `whole` is `calibrate_rig`, from corners to covariance, with the search for frames that contradict, two estimates of the noise and a
  robust loss; `adjust` is the joint adjustment alone by plain least squares from a start one per cent off.
- OpenCV: `whole` is `calibrateCamera` of each camera, then `stereoCalibrate` with CALIB_USE_INTRINSIC_GUESS; `adjust` is the latter, from the
  same start one per cent off as ours. Its normal equations of all frames are dense: sizes beyond --opencv-most frames are left out.
- mrcal: `whole` is `seed_stereographic` and the solves of `mrcal-calibrate-cameras` without regularisation and rejection of outliers, then two
  more from the best poses of the boards under these lenses, without which some boards end in the second pose of a plane; `adjust` is one
  more solve, from a start one per cent off as that of OpenCV. The search for start values is a Python program: with more than --mrcal-most
  frames there is `adjust` alone, with the boards and the cameras' places of our optimum and lenses one per cent off it.

The optimum is compared by its root mean square over the corners of both cameras, and by the parameters.
"""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time

from peers import build, has
# What the cameras of the corners roughly are: focal lengths that a user would give to mrcal, px.
FOCAL_PX = 640.0


def run_opencv(path, start_path):
    import cv2
    import numpy as np

    cv2.setNumThreads(int(os.environ["RAYON_NUM_THREADS"]))
    problem = json.load(open(path))
    columns, spacing = problem["columns"], problem["spacing_mm"]
    objects, images = [], [[], []]
    for frame in problem["frames"]:
        points = [[i % columns * spacing, i // columns * spacing, 0] for i in frame["index"]]
        objects.append(np.array(points, np.float32))
        for own, pixels in zip(images, frame["pixels"]):
            own.append(np.array(pixels, np.float32))
    sizes = [tuple(size) for size in problem["sizes"]]
    criteria = cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-16
    begin = time.perf_counter(), time.process_time()
    alone = [cv2.calibrateCamera(objects, own, size, None, None)[1:3] for own, size in zip(images, sizes)]
    (k1, d1), (k2, d2) = alone
    flags = cv2.CALIB_USE_INTRINSIC_GUESS
    cv2.stereoCalibrate(objects, *images, k1, d1.ravel()[:5], k2, d2.ravel()[:5], sizes[0], flags=flags)
    whole = time.perf_counter() - begin[0], time.process_time() - begin[1]
    start = json.load(open(start_path))
    matrices = []
    for pinhole in start["pinhole"]:
        fx, fy, cx, cy = [1.01 * v for v in pinhole]
        matrices.append(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]))
    lenses = [1.01 * np.array(lens) for lens in start["lens"]]
    begin = time.perf_counter(), time.process_time()
    solved = cv2.stereoCalibrate(
        objects, *images, matrices[0], lenses[0], matrices[1], lenses[1], sizes[0], flags=flags, criteria=criteria
    )
    adjust = time.perf_counter() - begin[0], time.process_time() - begin[1]
    rms, k1, d1, k2, d2, r, t = solved[:7]
    return dict(
        walls=[whole[0]], cpus=[whole[1]], adjust=[adjust[0]], adjust_cpus=[adjust[1]], rms=rms, lens=[d1.ravel()[:5].tolist(), d2.ravel()[:5].tolist()],
        pinhole=[[k[0, 0], k[1, 1], k[0, 2], k[1, 2]] for k in (k1, k2)], rotation=cv2.Rodrigues(r)[0].ravel().tolist(),
        translation_mm=t.ravel().tolist(),
    )  # fmt: skip


def mrcal_from_corners(given, sizes, indices, corners, spacing, shape):
    """Solves of `mrcal-calibrate-cameras` from a guess: its optimum is left in `given`."""
    import mrcal
    import numpy as np

    intrinsics, extrinsics, poses = mrcal.seed_stereographic(
        sizes, [FOCAL_PX] * 2, indices[:, :2].copy(), corners.copy(), spacing
    )
    given.update(intrinsics=intrinsics, extrinsics_rt_fromref=extrinsics, frames_rt_toref=poses)
    given.update(lensmodel="LENSMODEL_STEREOGRAPHIC", do_optimize_intrinsics_core=False, do_optimize_intrinsics_distortions=False)
    mrcal.optimize(**given)
    given.update(do_optimize_intrinsics_core=True)
    mrcal.optimize(**given)
    given.update(intrinsics=np.hstack((given["intrinsics"], np.zeros((2, 5)))), lensmodel="LENSMODEL_OPENCV5")
    given.update(do_optimize_intrinsics_distortions=True)
    mrcal.optimize(**given)
    # Some boards end in the second of the two poses that a plane nearly has: each starts again from the best of its present pose and those
    # that either camera's corners give under these lenses.
    board = mrcal.ref_calibration_object(*shape, spacing)
    for _ in range(2):
        models = [(given["lensmodel"], lens) for lens in given["intrinsics"]]
        alone = mrcal.estimate_monocular_calobject_poses_Rt_tocam(indices[:, :2].copy(), corners.copy(), spacing, models)
        second = mrcal.Rt_from_rt(given["extrinsics_rt_fromref"][0])
        first_from_second = mrcal.invert_Rt(second)
        chosen = []
        for number, present in enumerate(given["frames_rt_toref"]):
            candidates = [mrcal.Rt_from_rt(present), alone[2 * number], mrcal.compose_Rt(first_from_second, alone[2 * number + 1])]

            def error(pose):
                total = 0.0
                for camera, rt in enumerate([mrcal.identity_Rt(), second]):
                    seen = corners[2 * number + camera]
                    pixels = mrcal.project(mrcal.transform_point_Rt(mrcal.compose_Rt(rt, pose), board), *models[camera])
                    total += np.sum(((pixels - seen[..., :2]) ** 2).sum(-1)[seen[..., 2] > 0])
                return total

            chosen.append(mrcal.rt_from_Rt(min(candidates, key=error)))
        given.update(frames_rt_toref=np.array(chosen))
        mrcal.optimize(**given)


def run_mrcal(path, start_path, most_searched):
    import mrcal
    import numpy as np

    problem, start = json.load(open(path)), json.load(open(start_path))
    columns, rows, frames = problem["columns"], problem["rows"], problem["frames"]
    spacing = problem["spacing_mm"] / 1000
    # Corners that were not seen have no weight.
    corners = np.zeros((2 * len(frames), rows, columns, 3))
    corners[..., 2] = -1
    indices = np.zeros((2 * len(frames), 3), np.int32)
    for number, frame in enumerate(frames):
        for camera in range(2):
            indices[2 * number + camera] = number, camera, camera - 1
            for index, pixel in zip(frame["index"], frame["pixels"][camera]):
                corners[2 * number + camera, index // columns, index % columns] = [*pixel, 1]
    sizes = np.array(problem["sizes"], np.int32)
    given = dict(
        points=None, observations_board=corners, indices_frame_camintrinsics_camextrinsics=indices, observations_point=None,
        indices_point_camintrinsics_camextrinsics=None, imagersizes=sizes, calibration_object_spacing=spacing,
        calobject_warp=None, do_optimize_frames=True, do_optimize_extrinsics=True, do_optimize_calobject_warp=False,
        do_apply_outlier_rejection=False, do_apply_regularization=False,
    )  # fmt: skip
    whole = None
    if len(frames) <= int(most_searched):
        begin = time.perf_counter(), time.process_time()
        mrcal_from_corners(given, sizes, indices, corners, spacing, (columns, rows))
        whole = time.perf_counter() - begin[0], time.process_time() - begin[1]
    else:
        scale = np.array([1, 1, 1, 1e-3, 1e-3, 1e-3])
        place = np.array([[*start["rotation"], *start["translation_mm"]]]) * scale
        lenses = np.hstack((start["pinhole"], start["lens"]))
        given.update(intrinsics=lenses, extrinsics_rt_fromref=place, frames_rt_toref=np.array(start["boards"]) * scale)
        given.update(lensmodel="LENSMODEL_OPENCV5", do_optimize_intrinsics_core=True, do_optimize_intrinsics_distortions=True)
    given.update(intrinsics=1.01 * given["intrinsics"])
    last = time.perf_counter(), time.process_time()
    solved = mrcal.optimize(**given)
    adjust = time.perf_counter() - last[0], time.process_time() - last[1]
    # Again from there, until nothing changes: what it stops at is not compared with where others do.
    for _ in range(3):
        solved = mrcal.optimize(**given)
    used = np.count_nonzero(corners[..., 2] > 0)
    residuals = solved["x"]
    rt = given["extrinsics_rt_fromref"][0]
    result = dict(walls=[whole[0]], cpus=[whole[1]]) if whole else {}
    return dict(
        result, adjust=[adjust[0]], adjust_cpus=[adjust[1]], rms=math.sqrt(float(residuals @ residuals) / used),
        pinhole=given["intrinsics"][:, :4].tolist(), lens=given["intrinsics"][:, 4:].tolist(), rotation=rt[:3].tolist(),
        translation_mm=(1000 * rt[3:]).tolist(),
    )  # fmt: skip


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", default="30,300,3000")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--opencv-most", type=int, default=300, help="most frames that OpenCV is given")
    parser.add_argument("--mrcal-most", type=int, default=300, help="most frames from which mrcal searches start values")
    parser.add_argument("--opencv-python", default=sys.executable)
    parser.add_argument("--mrcal-python", default=sys.executable)
    parser.add_argument("--ours", help="the example rig_corners; built if not given")
    parser.add_argument("--json")
    return parser.parse_args()


def run(command, threads):
    count = {name: str(threads) for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "RAYON_NUM_THREADS")}
    process = subprocess.run(command, capture_output=True, text=True, env=dict(os.environ, **count))
    lines = [json.loads(line) for line in process.stdout.splitlines() if line.startswith("{")]
    if not lines:
        print(f"SKIPPED: {' '.join(command)}: {process.stderr.strip()[-300:]}", file=sys.stderr)
    return lines[-1] if lines else None


def difference(ours, theirs):
    """Largest difference of parameters: of focal lengths and centres in focal lengths, of the lens in its terms, of the pose in its size."""
    parts = []
    for camera in range(2):
        focal = ours["pinhole"][camera][0]
        parts += [abs(a - b) / focal for a, b in zip(ours["pinhole"][camera], theirs["pinhole"][camera])]
        parts += [abs(a - b) for a, b in zip(ours["lens"][camera], theirs["lens"][camera])]
    parts += [abs(a - b) for a, b in zip(ours["rotation"], theirs["rotation"])]
    size = math.sqrt(sum(x * x for x in ours["translation_mm"]))
    parts += [abs(a - b) / size for a, b in zip(ours["translation_mm"], theirs["translation_mm"])]
    return max(parts)


def main():
    options = arguments()
    ours = options.ours or build("-p", "depthcal-benches", "--bin", "rig_corners")
    peers = []
    for name, python, module, peer, more in [
        ("OpenCV", options.opencv_python, "cv2", "opencv", []),
        ("mrcal", options.mrcal_python, "mrcal", "mrcal", [str(options.mrcal_most)]),
    ]:
        if has(python, module):
            peers.append((name, [python, __file__, "--worker", peer], more))
        else:
            print(f"SKIPPED: {name}, because {python} cannot import {module}", file=sys.stderr)
    seen = {}
    with tempfile.TemporaryDirectory() as folder:
        for frames in (int(f) for f in options.frames.split(",")):
            path, start = os.path.join(folder, f"{frames}.json"), os.path.join(folder, f"{frames}-start.json")
            subprocess.run([ours, "simulate", str(frames), path], check=True)
            for _ in range(options.rounds):
                for threads in (int(t) for t in options.threads.split(",")):
                    own = run([ours, "fit", path, "--threads", str(threads)], threads)
                    with open(start, "w") as file:
                        json.dump(own, file)
                    seen.setdefault((frames, "depthcal", threads), []).append(own)
                    for name, command, more in peers:
                        if name == "OpenCV" and frames > options.opencv_most:
                            continue
                        seen.setdefault((frames, name, threads), []).append(run([*command, path, start, *more], threads))
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}, least of {options.rounds} rounds\n")
    print("s by the clock, and of the processor in brackets; ratios to ours of the latter\n")
    print("| frames | program | threads | whole | of ours | adjust | of ours | rms, px | rms against ours | parameters against ours |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for (frames, name, threads), runs in seen.items():
        runs, own = [r for r in runs if r], [r for r in seen[frames, "depthcal", threads] if r]
        if not runs or not own:
            continue
        least = lambda of, field: min(min(r[field]) for r in of)
        cells = []
        for wall, cpu in [("walls", "cpus"), ("adjust", "adjust_cpus")]:
            if wall not in runs[0]:
                cells += ["", ""]
                continue
            ratio = least(runs, cpu) / max(least(own, cpu), 0.01)
            cells += [f"{least(runs, wall):.3f} ({least(runs, cpu):.3f})", f"{ratio:.2f}"]
        a, b = own[-1], runs[-1]
        cells += [f"{b['rms']:.6f}", f"{b['rms'] / a['rms'] - 1:+.1e}", f"{difference(a, b):.1e}"]
        print(f"| {a['frames']} | {name} | {threads} | {' | '.join(cells)} |")
    if options.json:
        with open(options.json, "w") as file:
            json.dump([dict(frames=k[0], program=k[1], threads=k[2], runs=v) for k, v in seen.items()], file, indent=1)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        print(json.dumps({"opencv": run_opencv, "mrcal": run_mrcal}[sys.argv[2]](*sys.argv[3:])))
    else:
        main()
