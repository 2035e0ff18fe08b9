//! Finds out where this OpenCV has its fiducials: in contrib's `aruco` until 4.6, in `objdetect` since 4.7.

use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=PKG_CONFIG_PATH");
    println!("cargo::rustc-check-cfg=cfg(fiducials, values(\"contrib\", \"objdetect\"))");
    let version = ["opencv4", "opencv5"].iter().find_map(|name| {
        let output = Command::new("pkg-config").args(["--modversion", name]).output().ok()?;
        let text = String::from_utf8(output.stdout).ok().filter(|_| output.status.success())?;
        let mut parts = text.trim().split('.').map(|part| part.parse::<u32>());
        Some((parts.next()?.ok()?, parts.next()?.ok()?))
    });
    // Without an answer the version that the project is built for is assumed.
    let place = if version.unwrap_or((4, 6)) >= (4, 7) { "objdetect" } else { "contrib" };
    println!("cargo::rustc-cfg=fiducials=\"{place}\"");
}
