#!/usr/bin/env python3
"""Draws cost over time of the solver and its peers for one problem, as SVG.

    benches/draw_costs.py PROBLEM --peers FOLDER --out FILE.svg [--rounds 3] [--threads 1] [--most 30]

PROBLEM is a file of bundle adjustment (.txt) or a pose graph (.g2o); FOLDER is one that benches/setup_peers.sh has made. Every
program is run with at most 1, 2, 3, ... iterations, and each run is a point: the median time of its solve and its cost. No
program has to tell what it did when, and what a run costs before its first iteration is in all points alike. Costs are drawn
above the least of all, relatively, on logarithmic axes. Costs of pose graphs are evaluated here, from the poses that are written.
"""
import argparse
import math
import os
import statistics
import tempfile

import pose_graph_peers as graphs
from peers import build

COLOURS = ("#c0392b", "#2471a3", "#229954", "#7d3c98", "#b9770e")
LEAST = 1e-9


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("problem")
    parser.add_argument("--peers", required=True)
    parser.add_argument("--ours", help="folder of the examples; built if not given")
    parser.add_argument("--out", required=True)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--most", type=int, default=30, help="iterations")
    return parser.parse_args()


def programs(options, folder):
    """name: function from the number of iterations to a command and what evaluates its cost."""
    t, problem, peers = str(options.threads), options.problem, os.path.abspath(options.peers)
    ours = options.ours or os.path.dirname(build("-p", "depthcal-solver", "--example", "bal", "--example", "pose_graph"))
    if not problem.endswith(".g2o"):
        found = {"this crate": lambda n: [f"{ours}/bal", problem, "--threads", t, "--max-iterations", str(n)]}
        for variant in ("dense", "sparse", "iterative"):
            found[f"Ceres, {variant} Schur"] = lambda n, v=variant: [f"{peers}/ceres_bal", problem, v, t, "1", str(n)]
        return found, lambda name, run: run["cost"]
    start, result = f"{folder}/start.g2o", f"{folder}/result.g2o"
    measurements = graphs.read(problem)[0]
    own = [f"{ours}/pose_graph", problem, "--threads", t, "--write-start", start, "--write", result]
    found = {"this crate": lambda n: [*own, "--max-iterations", str(n)]}
    for variant in ("gauss-newton", "levenberg-marquardt", "between"):
        worker = [f"{peers}/venv/bin/python", graphs.__file__, "--worker", problem, start, result, variant]
        found[f"GTSAM, {variant}"] = lambda n, w=worker: ["env", f"MAX_ITERATIONS={n}", *w]
    return found, lambda name, run: graphs.objective(measurements, graphs.read(result)[1])


def curve(command, cost, options):
    """Points (seconds, cost) of one program."""
    points = []
    for n in range(1, options.most + 1):
        runs = [graphs.run(command(n), options.threads) for _ in range(options.rounds)]
        if "failed" in runs[0]:
            break
        # The start of a pose graph is the same for all.
        points.append((statistics.median(r["wall"] - r.get("start", 0.0) for r in runs), cost(runs[-1])))
        if runs[0]["iters"] < n:
            break
    return points


def draw(curves, title):
    """An SVG of points above the least cost."""
    least = min(cost for points in curves.values() for _, cost in points)
    above = {name: [(t, max((cost - least) / abs(least), LEAST)) for t, cost in points] for name, points in curves.items()}
    every = [point for points in above.values() for point in points]
    t0, t1 = math.floor(math.log10(min(t for t, _ in every))), math.ceil(math.log10(max(t for t, _ in every)))
    c0, c1 = math.log10(LEAST), max(math.ceil(math.log10(max(c for _, c in every))), 0)
    x = lambda t: 70 + 520 * (math.log10(t) - t0) / max(t1 - t0, 1)
    y = lambda c: 340 - 300 * (math.log10(c) - c0) / (c1 - c0)
    lines = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 620 400" font-family="sans-serif" font-size="12">']
    lines += ['<rect width="620" height="400" fill="white"/>', f'<text x="70" y="24" font-size="14">{title}</text>']
    for k in range(t0, t1 + 1):
        lines.append(f'<line x1="{x(10.0**k):.1f}" y1="40" x2="{x(10.0**k):.1f}" y2="340" stroke="#ddd"/>')
        lines.append(f'<text x="{x(10.0**k):.1f}" y="358" text-anchor="middle">{10.0 ** k:g} s</text>')
    for k in range(int(c0), int(c1) + 1, 2):
        lines.append(f'<line x1="70" y1="{y(10.0**k):.1f}" x2="590" y2="{y(10.0**k):.1f}" stroke="#ddd"/>')
        lines.append(f'<text x="62" y="{y(10.0**k) + 4:.1f}" text-anchor="end">1e{k}</text>')
    for (name, points), colour in zip(above.items(), COLOURS):
        path = " ".join(f"{x(t):.1f},{y(c):.1f}" for t, c in points)
        lines.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        lines += [f'<circle cx="{x(t):.1f}" cy="{y(c):.1f}" r="2.5" fill="{colour}"/>' for t, c in points]
    for i, (name, colour) in enumerate(zip(above, COLOURS)):
        lines.append(f'<text x="580" y="{58 + 16 * i}" text-anchor="end" fill="{colour}">{name}</text>')
    lines.append('<text x="330" y="386" text-anchor="middle">time of the solve; cost above the least of all, relatively</text></svg>')
    return "\n".join(lines)


def main():
    options = arguments()
    with tempfile.TemporaryDirectory() as folder:
        found, cost = programs(options, folder)
        curves = {name: curve(command, lambda run, name=name: cost(name, run), options) for name, command in found.items()}
    curves = {name: points for name, points in curves.items() if points}
    for name, points in curves.items():
        print(name, " ".join(f"{1e3 * t:.2f} ms {c:.9g};" for t, c in points))
    with open(options.out, "w") as file:
        file.write(draw(curves, os.path.basename(options.problem)))


main()
