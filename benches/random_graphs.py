"""The optimum of bundle adjustment on random graphs, against another solver's.

    python3 benches/random_graphs.py --peer 'ceres_bal {file} dense 1 1 200' [--graphs 200] [--seed 1]

The peer is a command that reads a problem of Bundle Adjustment in the Large and prints a line of JSON with `cost`, half the sum of
squares. Cameras, points, which camera sees which point, noise and start values are drawn at random; some points are seen twice only, some cameras
see few. Prints a table, and fails where our cost is higher than the peer's by more than 1e-4 of it.
"""
import argparse
import json
import math
import os
import random
import subprocess
import sys
import tempfile

import peers

TOLERANCE = 1e-4


def rotated(w, x):
    """Rodrigues' formula."""
    angle = math.sqrt(sum(a * a for a in w))
    if angle < 1e-12:
        return x
    k = [a / angle for a in w]
    cross = [k[1] * x[2] - k[2] * x[1], k[2] * x[0] - k[0] * x[2], k[0] * x[1] - k[1] * x[0]]
    dot = sum(a * b for a, b in zip(k, x))
    c, s = math.cos(angle), math.sin(angle)
    return [x[i] * c + cross[i] * s + k[i] * dot * (1 - c) for i in range(3)]


def pixel(camera, point):
    """The projection of the format, whose cameras look along -z; None for what lies behind."""
    p = [a + t for a, t in zip(rotated(camera[:3], point), camera[3:6])]
    if p[2] > -0.5:
        return None
    x, y = -p[0] / p[2], -p[1] / p[2]
    r2 = x * x + y * y
    scale = camera[6] * (1 + camera[7] * r2 + camera[8] * r2 * r2)
    return [scale * x, scale * y]


def problem(rng):
    """The text of a random problem."""
    normal = rng.gauss
    cameras = [
        [normal(0, 0.2), normal(0, 0.2), normal(0, 0.5), normal(0, 1), normal(0, 1), normal(-6, 0.5)]
        + [rng.uniform(400, 900), normal(0, 0.05), normal(0, 0.02)]
        for _ in range(rng.randint(3, 25))
    ]
    points = [[rng.uniform(-2, 2) for _ in range(3)] for _ in range(rng.randint(40, 400))]
    noise, share = rng.choice([0.0, 0.3, 1.0]), rng.uniform(0.3, 1.0)
    seen = []
    for j, point in enumerate(points):
        views = [i for i in range(len(cameras)) if pixel(cameras[i], point)]
        rng.shuffle(views)
        for i in sorted(views[: max(2, round(rng.uniform(0, 1) * share * len(views)))]):
            u, v = pixel(cameras[i], point)
            seen.append((i, j, u + normal(0, noise), v + normal(0, noise)))
    sigma = [0.01] * 3 + [0.05] * 3 + [10.0, 0.01, 0.002]
    start = [[a + normal(0, s) for a, s in zip(camera, sigma)] for camera in cameras]
    moved = [[a + normal(0, 0.05) for a in point] for point in points]
    lines = [f"{len(cameras)} {len(points)} {len(seen)}"]
    lines += [f"{i} {j} {u!r} {v!r}" for i, j, u, v in seen]
    lines += [repr(a) for row in start + moved for a in row]
    return "\n".join(lines) + "\n", (len(cameras), len(points), len(seen), noise)


def cost(command):
    """What a program says that its cost is."""
    done = subprocess.run(command, capture_output=True, text=True)
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode or not lines:
        sys.exit(f"{' '.join(command)}: {done.stderr or done.stdout}")
    return json.loads(lines[-1])["cost"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peer", required=True)
    parser.add_argument("--graphs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    ours = peers.build("-p", "depthcal-solver", "--example", "bal")
    rng = random.Random(arguments.seed)
    lower = higher = equal = 0
    worst = (0.0, "")
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "problem.txt")
        for number in range(arguments.graphs):
            text, size = problem(rng)
            with open(path, "w") as file:
                file.write(text)
            a = cost([ours, path, "--threads", "1"])
            b = cost([part.replace("{file}", path) for part in arguments.peer.split()])
            # Without noise both costs are rounding errors and leftovers of the last step.
            difference = (a - b) / max(a, b, 1e-3 * size[2])
            equal += abs(difference) <= TOLERANCE
            lower += difference < -TOLERANCE
            higher += difference > TOLERANCE
            if abs(difference) > TOLERANCE:
                print(f"graph {number}, {size}: ours {a:.9g}, the peer's {b:.9g}", file=sys.stderr)
            worst = max(worst, (difference, f"graph {number}"))
    print("| graphs | costs equal to 1e-4 | ours lower | ours higher | most that ours is higher |")
    print("|---|---|---|---|---|")
    print(f"| {arguments.graphs} | {equal} | {lower} | {higher} | {worst[0]:.2g} |")
    sys.exit(higher > 0)


if __name__ == "__main__":
    main()
