#!/bin/sh
# Installs and builds the peers of the solver in a folder (Debian, as root, some minutes), and writes the problems.
#   benches/setup_peers.sh FOLDER
# FOLDER then has ceres_board and ceres_bal (Ceres of the distribution), venv (Python with GTSAM and OpenCV), data with boards of 30,
# 300 and 3000 frames and synthetic streets of 50, 200 and 1000 cameras. Public problems are to be put beside them:
#   FOLDER/data/problem-16-22106-pre.txt and others of Bundle Adjustment in the Large, as plain text
#   FOLDER/graphs/*.g2o or *.g2o.xz, such as the ones that come with SE-Sync
set -e
[ -n "$1" ] || { sed -n 2,8p "$0"; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1/data" "$1/graphs"
folder=$(cd "$1" && pwd)
export DEBIAN_FRONTEND=noninteractive
apt-get update -qq
apt-get install -y -qq --no-install-recommends g++ python3-venv libceres-dev libgoogle-glog-dev libeigen3-dev xz-utils >/dev/null
[ -d "$folder/venv" ] || python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" -q install numpy gtsam opencv-contrib-python-headless
for program in board bal; do
    g++ -O3 -march=native -std=c++17 -DNDEBUG -I/usr/include/eigen3 "$here/ceres/ceres_$program.cpp" -o "$folder/ceres_$program" \
        -lceres -lglog -pthread
done
"$folder/venv/bin/python" "$here/ceres/board_problems.py" "$folder/data"
cd "$here/.."
for cameras in 50 200 1000; do
    cargo run -q --release -p depthcal-solver --example bal -- --generate $cameras "$folder/data/street-$cameras.txt"
done
echo "$folder is ready: benches/solver_peers.sh $folder"
