#!/usr/bin/env bash
# Result files of a fixed list of runs, to compare two versions of the program: a change of the code's structure leaves them equal to the
# byte. Run it with the program before and after, then compare:
#
#   scripts/fixed-runs.sh PROGRAM OUT [MEASURED]     MEASURED: folder of measured captures, else those runs are left out
#   diff -r OUT_BEFORE OUT_AFTER
#
# OUT receives the JSON and TOML files of every run, and the time and peak memory of each in OUT.times. Reports are left out: they have times.
set -euo pipefail
program=$(realpath "$1") out=$2 measured=${3:-}
[ -n "$measured" ] && measured=$(realpath "$measured")
rm -rf "$out" && mkdir -p "$out"
out=$(realpath "$out")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export DEPTHCAL_CACHE="$work/cache"
: >"$out.times"

# Runs a command of the program; its files go to OUT/NAME.
run() {
    local name=$1 status=0 start=$EPOCHREALTIME
    shift
    mkdir -p "$work/results/$name"
    (cd "$work" && "$program" "$@" --out "results/$name" >/dev/null 2>"results/$name/stderr") || status=$?
    awk -v a="$start" -v b="$EPOCHREALTIME" -v n="$name" -v s="$status" \
        'BEGIN { printf "%8.2f s  exit %d  %s\n", b - a, s, n }' | tee -a "$out.times" >&2
    mkdir -p "$out/$name"
    (cd "$work/results/$name" && find . \( -name '*.json' -o -name '*.toml' -o -name '*.rs' \) -exec cp --parents {} "$out/$name" \;)
    [ "$status" -eq 0 ] || tail -3 "$work/results/$name/stderr" >"$out/$name/failed.txt"
}

capture() { (cd "$work" && "$program" simulate "${@:2}" --out "$1" >/dev/null 2>&1); }

run demo demo
if [ -n "$measured" ]; then
    for set in kinect2 truedepth/ipad4/calib; do
        [ -d "$measured/$set" ] || continue
        run "calibrate/$set" calibrate "$measured/$set"
        run "diagnose/$set" diagnose "$measured/$set"
    done
fi
capture train --camera 1 --effect cyclic_depth --seed 1
capture verify --camera 1 --effect cyclic_depth --kind plywood1 --seed 2
run compare compare train --verify verify --models none,projective,projective+bspline
for seed in 1 2 3 4 5 6; do
    capture "unit$seed" --camera 2 --kind vertical1 --effect range_offset --seed "$seed"
    run "fleet/unit$seed" calibrate "unit$seed"
done
run fleet/all fleet results/fleet/unit1 results/fleet/unit2 results/fleet/unit3 results/fleet/unit4 results/fleet/unit5 results/fleet/unit6
capture rig --rig infrared,colour,depth --seed 1
run rig/calibrate calibrate rig
run rig/diagnose diagnose rig
run rig/evaluate evaluate results/rig/calibrate/calibration.json rig
capture pair --rig infrared,infrared2 --effect infrared2:cyclic_depth --seed 2
run pair/calibrate calibrate pair
run pair/diagnose diagnose pair
