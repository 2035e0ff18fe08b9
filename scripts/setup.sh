#!/usr/bin/env bash
# Installs what depthcal needs in addition to the Rust toolchain: OpenCV with its headers, libclang and clang (the opencv crate
# generates its bindings with them), pkg-config and a C++ compiler. Quiet and fast when everything is there already. On Debian, numpy and
# pytest for the tests of the Python package as well, which are skipped where these cannot be installed.
set -euo pipefail

say() { printf 'setup: %s\n' "$*" >&2; }

have_command() { command -v "$1" >/dev/null 2>&1; }

# libclang is loaded at build time: look where the distributions and Homebrew put it.
have_libclang() {
    [ -n "${LIBCLANG_PATH:-}" ] && return 0
    have_command llvm-config && return 0
    local candidate
    for candidate in /usr/lib/llvm-*/lib/libclang*.so* /usr/lib*/libclang*.so* /usr/lib/*/libclang*.so* \
        /opt/homebrew/opt/llvm/lib/libclang.dylib /usr/local/opt/llvm/lib/libclang.dylib \
        /Library/Developer/CommandLineTools/usr/lib/libclang.dylib; do
        [ -e "$candidate" ] && return 0
    done
    return 1
}

have_opencv() {
    have_command pkg-config && { pkg-config --exists opencv4 || pkg-config --exists opencv5; }
}

have_python_tests() {
    local python
    for python in ${DEPTHCAL_PYTHON:-python3 /usr/bin/python3}; do
        "$python" -c 'import numpy, pytest' >/dev/null 2>&1 && return 0
    done
    return 1
}

missing=()
have_command pkg-config || missing+=(pkg-config)
have_opencv || missing+=(libopencv-dev)
have_libclang || missing+=(libclang-dev)
have_command clang || missing+=(clang)
have_command c++ || missing+=(g++)

if ! have_command cargo; then
    say "cargo was not found; install the Rust toolchain from https://rustup.rs and run this again"
    exit 1
fi
# Nobody is asked for a password for what is not necessary.
optional=()
if have_command apt-get && [ "$(id -u)" -eq 0 ] && ! have_python_tests; then
    optional=(python3-numpy python3-pytest)
fi
[ "${#missing[@]}" -eq 0 ] && [ "${#optional[@]}" -eq 0 ] && exit 0

if have_command apt-get; then
    as_root=()
    if [ "$(id -u)" -ne 0 ]; then
        have_command sudo || { say "missing: ${missing[*]}; as root: apt-get install ${missing[*]}"; exit 1; }
        as_root=(sudo)
    fi
    wanted=("${missing[@]}" "${optional[@]}")
    say "installing ${wanted[*]} with apt-get (a few minutes the first time)"
    log=$(mktemp)
    trap 'rm -f "$log"' EXIT
    install() {
        "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
            apt-get install -y --no-install-recommends "$@" >>"$log" 2>&1
    }
    update_and_install() {
        : >"$log"
        "${as_root[@]}" apt-get update >>"$log" 2>&1 && install "$@"
    }
    # The package lists of a fresh container are empty: update only when the first attempt fails.
    if [ "${#missing[@]}" -gt 0 ] && ! install "${missing[@]}" && ! update_and_install "${missing[@]}"; then
        cat "$log" >&2
        say "apt-get could not install ${missing[*]}; its messages are above"
        exit 1
    fi
    if [ "${#optional[@]}" -gt 0 ] && ! install "${optional[@]}" && ! update_and_install "${optional[@]}"; then
        say "apt-get could not install ${optional[*]}: the tests of the Python package will be skipped"
    fi
    if ! have_opencv; then
        say "OpenCV was installed, but pkg-config does not find opencv4; see PKG_CONFIG_PATH"
        exit 1
    fi
    exit 0
fi

say "missing: ${missing[*]}"
if have_command dnf; then
    say "Fedora: sudo dnf install opencv-devel clang-devel clang pkgconf-pkg-config gcc-c++"
elif have_command pacman; then
    say "Arch: sudo pacman -S opencv vtk clang pkgconf gcc"
elif have_command zypper; then
    say "openSUSE: sudo zypper install opencv-devel clang-devel clang pkg-config gcc-c++"
elif have_command brew || [ "$(uname -s)" = Darwin ]; then
    say "macOS: xcode-select --install; brew install opencv llvm pkg-config"
    say "macOS: then export DYLD_FALLBACK_LIBRARY_PATH=\"\$(brew --prefix llvm)/lib\""
else
    say "install OpenCV 4 with its headers and the contrib module aruco, libclang, clang, pkg-config and a C++ compiler"
fi
say "everything but the detection of boards builds without them: cargo build --no-default-features"
exit 1
