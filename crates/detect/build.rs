//! Determines where the installed OpenCV has its reader of ArUco and AprilTag markers: in contrib's `aruco` until 4.6,
//! in
//! `objdetect` since 4.7, or nowhere (a build without contrib). The result is the cfg `fiducials`.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=PKG_CONFIG_PATH");
    println!("cargo::rustc-check-cfg=cfg(fiducials, values(\"contrib\", \"objdetect\", \"none\"))");
    if std::env::var_os("CARGO_FEATURE_OPENCV").is_none() {
        return;
    }
    let has = |headers: &str, file: &str| Path::new(headers).join("opencv2").join(file).exists();
    let place = match ["opencv4", "opencv5"].iter().find_map(|name| pkg_config("--cflags-only-I", name)) {
        Some(flags) => {
            let folders: Vec<&str> = flags.split_whitespace().filter_map(|flag| flag.strip_prefix("-I")).collect();
            if folders.iter().any(|folder| has(folder, "objdetect/aruco_detector.hpp")) {
                "objdetect"
            } else if folders.iter().any(|folder| has(folder, "aruco.hpp")) {
                "contrib"
            } else {
                "none"
            }
        }
        // OpenCV is not known to pkg-config. Assume the version that this crate is developed with.
        None => "contrib",
    };
    println!("cargo::rustc-cfg=fiducials=\"{place}\"");
}

/// The answer of pkg-config about a package; `None` when it does not know the package.
fn pkg_config(question: &str, package: &str) -> Option<String> {
    let output = Command::new("pkg-config").args([question, package]).output().ok()?;
    output.status.success().then(|| String::from_utf8(output.stdout).ok()).flatten()
}
