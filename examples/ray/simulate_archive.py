"""Writes shards of simulated depth frames: a tilted, moving wall. For trying and measuring `fleet.py correct`.

python simulate_archive.py --frames 10000 --shard 250 --out shards/
"""

import argparse
from pathlib import Path

import numpy as np

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--frames", type=int, default=10_000)
parser.add_argument("--shard", type=int, default=250, help="frames per file")
parser.add_argument("--size", type=int, nargs=2, default=(640, 480), metavar=("WIDTH", "HEIGHT"))
parser.add_argument("--out", type=Path, required=True)
arguments = parser.parse_args()

width, height = arguments.size
v, u = np.mgrid[:height, :width].astype(np.float32)
random = np.random.default_rng(1)
noise = random.normal(0, 2, (8, height, width)).astype(np.float32)
arguments.out.mkdir(parents=True, exist_ok=True)
for number, first in enumerate(range(0, arguments.frames, arguments.shard)):
    count = min(arguments.shard, arguments.frames - first)
    shard = np.empty((count, height, width), np.uint16)
    for i in range(count):
        t = (first + i) / 30.0
        wall = 1500 + 400 * np.sin(t / 3) + (0.8 * np.cos(t / 5)) * (u - width / 2) + 0.4 * (v - height / 2)
        shard[i] = wall + noise[i % len(noise)]
    shard[:, ::23, ::19] = 0
    np.save(arguments.out / f"shard-{number:05d}.npy", shard)
