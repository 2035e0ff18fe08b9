#!/usr/bin/env bash
# Builds the wheel of the Python package, installs it into a fresh virtual environment, and runs its tests, notebooks and examples for
# fleets there; then builds a wheel from the source distribution.
# Prints a line that begins with SKIPPED, and succeeds, where Python, venv or the network is missing.
#
#   scripts/python-tests.sh [--release] [ARGUMENTS OF PYTEST]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

skip() {
    echo "SKIPPED: tests of the Python package: $1"
    exit 0
}

profile=dev
if [ "${1:-}" = --release ]; then
    profile=release
    shift
fi
# A stripped build of the development profile would build all dependencies again.
export MATURIN_STRIP=false
[ "$profile" = dev ] || MATURIN_STRIP=true
python=${PYTHON:-python3}
command -v "$python" >/dev/null || skip "there is no $python"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 9))' || skip "$python is older than 3.9"

# Tools are kept between runs; the environment of the tests is made anew.
target=${CARGO_TARGET_DIR:-target}
tools=$target/python/tools
fresh=$target/python/fresh
if [ ! -x "$tools/bin/maturin" ]; then
    "$python" -m venv "$tools" || skip "$python has no venv (apt-get install python3-venv)"
    "$tools/bin/pip" install --quiet 'maturin>=1.16,<2' || skip "maturin cannot be installed (no network?)"
fi
"$python" -m venv --clear "$fresh"

"$tools/bin/maturin" build --quiet --profile "$profile" --manifest-path crates/python/Cargo.toml --out "$target/python/wheels"
wheel=$(ls -t "$target"/python/wheels/depthcal-*.whl | head -n 1)
"$fresh/bin/pip" install --quiet "$wheel[test,fleet]" || skip "packages of the tests cannot be installed (no network?)"

# Licences are in the wheel and, below, in the source distribution; links of the page of a package index work there.
has_licences() {
    local listed
    listed=$(cat)
    for licence in LICENSE-MIT LICENSE-APACHE; do
        grep -q "$licence" <<<"$listed" || { echo "error: $1 has no $licence" && exit 1; }
    done
}
"$python" -m zipfile --list "$wheel" | has_licences "$wheel"
if grep -nE '\]\((\.|[a-z]+/)' crates/python/README.md; then
    echo "error: crates/python/README.md has a link that works in the repository only"
    exit 1
fi

# The wheel is one for all versions of Python and brings no OpenCV.
case $wheel in *abi3*) ;; *) echo "error: $wheel is not abi3" && exit 1 ;; esac
if "$python" -m zipfile --list "$wheel" | grep -qi opencv; then
    echo "error: $wheel contains OpenCV"
    exit 1
fi
native=$("$fresh/bin/python" -c 'from depthcal import _depthcal; print(_depthcal.__file__)')
if command -v ldd >/dev/null && ldd "$native" | grep -qiE 'opencv|libpython'; then
    echo "error: $native is linked to OpenCV or libpython"
    exit 1
fi
export DEPTHCAL_BIN=${DEPTHCAL_BIN:-$target/debug/depthcal}
[ -x "$DEPTHCAL_BIN" ] || echo "SKIPPED: comparison of the Python package with the command line: there is no $DEPTHCAL_BIN"
DEPTHCAL_BIN=$(realpath -m "$DEPTHCAL_BIN")
"$fresh/bin/python" -m pytest -q crates/python/tests "$@"

# The source distribution has all that the wheel is built from.
sources=$target/python/sources
rm -rf "$sources" && mkdir -p "$sources"
"$tools/bin/maturin" sdist --manifest-path crates/python/Cargo.toml --out "$sources"
tar -tzf "$sources"/depthcal-*.tar.gz | has_licences "the source distribution"
tar -xzf "$sources"/depthcal-*.tar.gz -C "$sources"
maturin=$(realpath "$tools/bin/maturin")
out=$(realpath "$sources")
shared=$(realpath "$target") # so that dependencies are not built again
(cd "$sources"/depthcal-*/ && CARGO_TARGET_DIR="$shared" "$maturin" build --quiet --profile "$profile" --out "$out")
"$python" -m venv --clear "$fresh"
"$fresh/bin/pip" install --quiet "$sources"/depthcal-*.whl
"$fresh/bin/python" -c 'import depthcal; print("from the source distribution:", depthcal.simulate_points(frames=6))'
