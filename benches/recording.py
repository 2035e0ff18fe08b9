#!/usr/bin/env python3
"""From a recording of two minutes to a calibration: are the picked frames as good as all of them, and what does it cost?

    benches/recording.py [--seconds 120] [--rate 30] [--folder FOLDER]

A simulated board is moved by hand before a camera of 640×480 at 30 Hz (`examples/moving_board.rs`); `mcap-ros2-support` writes the video as a ROS 2
recording, once uncompressed and once with zstd. `depthcal import` picks 40 frames. They and all frames of the video are calibrated, and both
calibrations are judged on the same frames of another day. Needs `pip install mcap-ros2-support numpy`.
"""
import argparse
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

from peers import build, has

TIME = "int32 sec\nuint32 nanosec"
HEADER = "builtin_interfaces/Time stamp\nstring frame_id"
RULE = "\n" + "=" * 80 + "\n"
IMAGE = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data"
    f"{RULE}MSG: std_msgs/Header\n{HEADER}{RULE}MSG: builtin_interfaces/Time\n{TIME}"
)


def pgm(path, unit_mm):
    """Values of a binary PGM, (height, width): those of 16 bits as metres."""
    import numpy as np

    _, size, most, values = path.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    if int(most) < 256:
        return np.frombuffer(values, np.uint8).reshape(height, width)
    return (np.frombuffer(values, ">u2").astype(np.float32) * np.float32(unit_mm / 1000)).reshape(height, width)


def write_recording(video, path, compression):
    """Writes the frames of a dataset as a ROS 2 recording."""
    from mcap.writer import CompressionType
    from mcap_ros2.writer import Writer

    unit_mm = float(re.search(r"unit_mm = (\S+)", (video / "dataset.toml").read_text())[1])
    with open(path, "wb") as file:
        writer = Writer(file, compression=getattr(CompressionType, compression))
        schema = writer.register_msgdef("sensor_msgs/msg/Image", IMAGE)
        for line in (video / "frames.csv").read_text().splitlines()[1:]:
            frame, seconds = line.split(",")
            nanoseconds = round(float(seconds) * 1e9) + 1_700_000_000 * 10**9
            stamp = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
            for topic, folder, encoding in [
                ("/camera/infra1/image_rect_raw", "image", "mono8"),
                ("/camera/depth/image_rect_raw", "depth", "32FC1"),
            ]:
                values = pgm(video / folder / f"{frame}.pgm", unit_mm)
                message = {
                    "header": {"stamp": stamp, "frame_id": "camera"}, "height": values.shape[0], "width": values.shape[1],
                    "encoding": encoding, "is_bigendian": 0, "step": values.strides[0], "data": values.tobytes(),
                }  # fmt: skip
                writer.write_message(topic, schema, message, log_time=nanoseconds)
        writer.finish()


def run(*command):
    """Runs a command; returns its seconds by the clock and of the processor, and its peak memory in MB."""
    begin = time.perf_counter()
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    message = process.stderr.read().decode()
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{' '.join(map(str, command))}: {message}")
    return time.perf_counter() - begin, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def errors(depthcal, calibration, other, out):
    """rms reprojection error (px) and rms depth error (mm) of a calibration on other frames."""
    run(depthcal, "evaluate", calibration, other, "--out", out)
    evaluated = json.loads((out / "evaluation.json").read_text())["datasets"][0]
    return evaluated["reprojection_px"]["rms"], evaluated["depth_rms_mm"]["after"]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=120)
    parser.add_argument("--rate", type=float, default=30)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--depthcal", help="the program; built if not given")
    parser.add_argument("--video", help="what moving_board wrote; made anew if not given")
    return parser.parse_args()


def main():
    options = arguments()
    if not has(sys.executable, "mcap_ros2"):
        sys.exit("SKIPPED: there is no mcap_ros2 (pip install mcap-ros2-support)")
    depthcal = options.depthcal or build("--bin", "depthcal")
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        made = pathlib.Path(options.video or folder / "made")
        if not options.video:
            moving_board = build("--example", "moving_board")
            run(moving_board, made, "--seconds", options.seconds, "--rate", options.rate)
        board = made / "other/dataset.toml"
        print("| step | size, MB | s by the clock | s of the processor | peak memory, MB |\n|---|---|---|---|---|")

        def row(name, size, used):
            size = "" if size is None else f"{size / 1e6:.0f}"
            print(f"| {name} | {size} | {used[0]:.1f} | {used[1]:.1f} | {used[2]:.0f} |", flush=True)

        for compression in ("ZSTD", "NONE"):
            recording = folder / "recording.mcap"
            write_recording(made / "video", recording, compression)
            picked = folder / f"picked-{compression}"
            command = (depthcal, "import", recording, "--board", board, "--frames", options.frames, "--out", picked)
            name = {"ZSTD": "`import`, compressed by zstd", "NONE": "`import`, not compressed"}[compression]
            row(name, recording.stat().st_size, run(*command))
            recording.unlink()
        results = []
        for name, dataset in (("picked", picked), ("whole", made / "video")):
            out = folder / name
            row(f"`calibrate`, {name}", None, run(depthcal, "calibrate", dataset, "--no-cache", "--out", out))
            frames = len(json.loads((out / "calibration.json").read_text())["frames"])
            results.append((name, frames, *errors(depthcal, out / "calibration.json", made / "other", folder / f"{name}-judged")))
        print("\n| calibrated with | frames | reprojection error on another day, px | depth error, mm | of the whole |\n|---|---|---|---|---|")
        whole = results[-1][3]
        for name, frames, px, mm in results:
            print(f"| {name} | {frames} | {px:.4f} | {mm:.4f} | {100 * mm / whole:.1f} % |")


if __name__ == "__main__":
    main()
