#!/bin/sh
# Runs every fuzz target for SECONDS and prints a Markdown table. Inputs that reach new code are kept in `corpus/`, inputs that fail in
# `artifacts/`. The exit code is 1 where a target failed.
#
#     fuzz/run-all.sh SECONDS [TARGET ...]
set -eu

seconds=${1:?usage: fuzz/run-all.sh SECONDS [TARGET ...]}
shift
cd "$(dirname "$0")"
[ $# -gt 0 ] || set -- $(ls fuzz_targets | sed 's/\.rs$//')

# SQLite has two tables of one name in its amalgamation.
export ASAN_OPTIONS="detect_odr_violation=0${ASAN_OPTIONS:+:$ASAN_OPTIONS}"
cargo +nightly fuzz build
memory=/dev/shm
[ -d "$memory" ] || memory=/tmp
TMPDIR=$(mktemp -d "$memory/depthcal-fuzz-XXXXXX")
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
host=$(rustc -vV | sed -n 's/^host: //p')
failed=0
echo "| target | executions | coverage | crashes |"
echo "|---|---|---|---|"
for target in "$@"; do
    mkdir -p "corpus/$target" "artifacts/$target"
    log="artifacts/$target.log"
    # Containers compress by a thousand: longer inputs would meet the limits of memory with images that are what they claim.
    "target/$host/release/$target" "corpus/$target" -artifact_prefix="artifacts/$target/" -max_total_time="$seconds" -max_len=65536 \
        -timeout=10 -rss_limit_mb=1024 -malloc_limit_mb=512 -print_final_stats=1 >"$log" 2>&1 || failed=1
    executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    coverage=$(grep -a -o 'cov: [0-9]*' "$log" | tail -1 | cut -c6-)
    crashes=$(find "artifacts/$target" -type f | wc -l)
    echo "| $target | ${executions:-0} | ${coverage:-0} | $crashes |"
done
exit $failed
