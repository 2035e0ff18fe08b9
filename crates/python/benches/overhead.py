"""Time of a Corrector call at 640×480, and the part of it that is not correction: the time of the same call for a camera of 4×3 pixels.

python overhead.py; python overhead.py --threads 1
"""

import argparse
import functools
import json
import time

import numpy as np

import depthcal

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--threads", type=int, help="of the corrector's own; those of the process otherwise")
parser.add_argument("--calls", type=int, default=2000)
arguments = parser.parse_args()

fit = depthcal.calibrate(depthcal.simulate_points(frames=16, samples=150, seed=3))
record = json.loads(fit.calibration._native.json())


def corrector(width, height):
    camera = {**record["camera"], "width": width, "height": height}
    native = depthcal._depthcal.Calibration.parse(json.dumps({**record, "camera": camera}), [])
    return depthcal.Corrector(depthcal.Calibration(native), threads=arguments.threads)


def microseconds(call):
    times = []
    for _ in range(arguments.calls):
        start = time.perf_counter_ns()
        call()
        times.append(time.perf_counter_ns() - start)
    return [1e-3 * float(q) for q in np.quantile(times, [0.1, 0.5])]


large, tiny = corrector(640, 480), corrector(4, 3)
print("one call, µs: 10 % quantile, median; share of what is not correction (medians)")
for name, dtype, method in [
    ("uint16 → uint16", np.uint16, "correct"),
    ("float32 → float32", np.float32, "correct"),
    ("uint16 → points", np.uint16, "points"),
]:
    times = {}
    for size, native in (("large", large), ("tiny", tiny)):
        shape = (native.height, native.width)
        depth = np.full(shape, 1500, dtype)
        out = np.empty((*shape, 3), np.float32) if method == "points" else np.empty(shape, dtype)
        call = getattr(native, method)
        times[size] = microseconds(functools.partial(call, depth, 1.0, out=out))
        if size == "large":
            fresh = microseconds(functools.partial(call, depth, 1.0))
    quick, median = times["large"]
    overhead = times["tiny"][1]
    print(
        f"{name:18} {quick:8.1f} {median:8.1f}   of it {overhead:5.2f} µs: {overhead / median:.1%}; new result each: {fresh[1]:.1f}"
    )
