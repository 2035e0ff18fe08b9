#!/usr/bin/env python3
"""The per-pixel paths beside those of other programs, in turns, in one run: ratios as Markdown tables.

  pixel_peers.py OURS PEER... [--rounds 5] [--width 640]

OURS and PEER are command lines that print one JSON object a line with case, mode, w, h, threads, ms, as
`target/release/pixel 0.1 640` does. Rows are matched by the pairs below. On a busy machine the least of many short
repeats says more than the median; times printed are the least.
"""
import argparse, collections, json, shlex, statistics, subprocess

# Ours, theirs, and the largest ratio of times that is aimed at.
PAIRS = [
    ("correct_projective", "Dcorr_map(u16,f32map->u16)", 1.15),
    ("correct_projective", "Dcorr_map cv2 primitives", 0.25),
    ("correct_multiplier", "multmap(u16,f32map->u16)", 1.15),
    ("correct_multiplier", "multmap: multiply(u16,f32,dtype=u16)", 0.25),
    ("correct_and_points", "cloud_rays_avx512(u16,2xf32->f32x3)", 1.15),
    ("correct_and_points", "depthTo3d u16->f32x3", 0.33),
    ("correct_and_points", "librealsense pointcloud", 0.33),
    ("points", "cloud_rays_avx512(u16,2xf32->f32x3)", 1.15),
    ("remap_nearest", "remap_nearest(u16,i32idx->u16)", 1.1),
    ("remap_nearest", "remap_nearest/u16/16SC2", 1.0),
    ("remap_linear", "remap_linear/u8/16SC2", 0.77),
    ("rays", "undistort_points_5it(->f32x2)", 1.0),
    ("rays", "undistortPoints/f32 all px", 0.04),
    ("rays_1e-9", "undistort_points_5it(->f32x2)", 3.0),
]

arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
arguments.add_argument("ours")
arguments.add_argument("peer", nargs="+")
arguments.add_argument("--rounds", type=int, default=5)
arguments.add_argument("--width", type=int, default=640)
options = arguments.parse_args()

times, least = collections.defaultdict(list), collections.defaultdict(lambda: float("inf"))
for _ in range(options.rounds):
    for command in [options.ours, *options.peer]:
        run = subprocess.run(shlex.split(command), capture_output=True, text=True, check=True)
        for line in run.stdout.splitlines():
            row = json.loads(line) if line.startswith("{") else {}
            if row.get("w") == options.width:
                key = row["case"], row["mode"], row["threads"]
                times[key].append(row["ms"])
                least[key] = min(least[key], row.get("ms_min", row["ms"]))

median = {key: statistics.median(values) for key, values in times.items()}
print("| ours | beside | mode, threads | ours, ms | theirs, ms | ratio of medians | of the least | aim |")
print("|---|---|---|---|---|---|---|---|")
for ours, theirs, aim in PAIRS:
    for mode in ("hot", "cold"):
        for threads in (1, 2):
            a, b = (ours, mode, threads), (theirs, mode, threads)
            if a in median and b in median:
                ratios = f"{median[a] / median[b]:.2f} | {least[a] / least[b]:.2f}"
                print(f"| {ours} | {theirs} | {mode}, {threads} | {least[a]:.3f} | {least[b]:.3f} | {ratios} | ≤ {aim} |")
print("\n| path | 1 thread, least ms | 2 threads, least ms | gain hot | gain cold |\n|---|---|---|---|---|")
for case in sorted({case for case, _, _ in median}):
    gains = [least[case, mode, 1] / least[case, mode, 2] for mode in ("hot", "cold") if (case, mode, 2) in median]
    if gains and (case, "hot", 1) in median:
        row = f"{least[case, 'hot', 1]:.3f} | {least[case, 'hot', 2]:.3f}"
        print(f"| {case} | {row} | {' | '.join(f'{gain:.2f}' for gain in gains)} |")
