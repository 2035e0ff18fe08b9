//! Runs the built program on folders that tests make.

pub mod measured;
pub mod schemas;

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use depthcal::io::{DepthImage, GrayImage, write_depth, write_gray};

pub const WIDTH: usize = 64;
pub const HEIGHT: usize = 48;
/// fx, fy, cx, cy of [`CALIBRATION`].
pub const PINHOLE: [f64; 4] = [60.0, 62.0, 31.0, 24.5];
/// dx, dy, dz (1/mm) and dw of [`CALIBRATION`].
pub const D: [f64; 4] = [1.5e-4, -2e-5, 1e-5, 1.02];

/// A calibration by hand: pinhole and projective depth, without a depth unit.
pub const CALIBRATION: &str = r#"{
  "format": "depthcal-calibration",
  "version": 1,
  "camera": {
    "width": 64, "height": 48,
    "pieces": [
      { "hook": "pixel", "name": "pinhole", "parameters": [
        { "name": "fx", "unit": "px", "value": 60.0, "fixed": false },
        { "name": "fy", "unit": "px", "value": 62.0, "fixed": false },
        { "name": "cx", "unit": "px", "value": 31.0, "fixed": false },
        { "name": "cy", "unit": "px", "value": 24.5, "fixed": false },
        { "name": "skew", "unit": "px", "value": 0.0, "fixed": true } ] },
      { "hook": "depth", "name": "projective", "parameters": [
        { "name": "dx", "unit": "1/mm", "value": 1.5e-4, "std_dev": 1e-7, "fixed": false },
        { "name": "dy", "unit": "1/mm", "value": -2e-5, "fixed": false },
        { "name": "dz", "unit": "1/mm", "value": 1e-5, "fixed": false },
        { "name": "dw", "unit": "1", "value": 1.02, "fixed": false } ] }
    ]
  },
  "noise": { "pixel_sigma": 0.1 },
  "fit": { "estimator": "joint", "model": "projective", "reprojection_rms_px": 0.1, "frames_used": 9,
           "termination": "converged", "cost": 1.0, "iterations": 5 },
  "frames": [],
  "dataset": { "path": "captures", "digest": "00" },
  "target": { "kind": "chessboard", "columns": 7, "rows": 5, "spacing_mm": 30.0 }
}"#;

/// [`CALIBRATION`] with a further depth piece, written in its JSON.
pub fn calibration_with(piece: &str) -> String {
    let changed = CALIBRATION.replace(
        "\"value\": 1.02, \"fixed\": false } ] }",
        &format!("\"value\": 1.02, \"fixed\": false }} ] }},\n{piece}"),
    );
    assert_ne!(changed, CALIBRATION);
    changed
}

/// [`CALIBRATION`], fitted to depth of this unit.
pub fn calibration_with_unit(unit_mm: f64) -> String {
    CALIBRATION.replace("\"frames\": []", &format!("\"depth_unit_mm\": {unit_mm}, \"frames\": []"))
}

pub const BOARD: &str = "[board]\nkind = \"asymmetric-circles\"\ncolumns = 4\nrows = 11\nspacing_mm = 36.0\n\
                         circle_diameter_mm = 20.0\n";
pub const FRAMES: &str = "[frames]\nimage = \"image/*.png\"\ndepth = \"depth/*.png\"\n";
pub const UNIT: &str = "[depth]\nunit_mm = 1.0\n";

/// Runs the program; detections are neither read from nor written to the user's cache.
pub fn command<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_depthcal"));
    command.args(arguments).env("DEPTHCAL_CACHE", std::env::temp_dir().join("depthcal-tests-no-cache"));
    command.env_remove("RUST_BACKTRACE").env_remove("DEPTHCAL_LOG");
    command
}

pub fn run<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Output {
    command(arguments).output().unwrap()
}

/// Runs the program with these bytes on standard input.
pub fn run_with_input<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>, input: &[u8]) -> Output {
    let mut child =
        command(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_vec();
    // Whoever refuses its arguments does not read.
    let writer = std::thread::spawn(move || _ = stdin.write_all(&input));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    output
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs the program and expects success.
pub fn succeeds<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Output {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    output
}

/// Runs the program and expects the user's mistake to be told, in words of which `parts` are some.
pub fn fails<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>, parts: &[&str]) {
    let output = run(arguments);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(!text.contains("panicked") && !text.contains("RUST_BACKTRACE"), "{text}");
    for part in parts {
        assert!(text.contains(part), "'{part}' is missing in: {text}");
    }
}

pub fn gray(value: u16) -> GrayImage {
    GrayImage { width: WIDTH, height: HEIGHT, data: vec![value; WIDTH * HEIGHT], bits: 16 }
}

pub fn depth(value: u16) -> DepthImage {
    DepthImage { width: WIDTH, height: HEIGHT, data: vec![value; WIDTH * HEIGHT] }
}

/// A folder of the test's own.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// A dataset of four empty walls, with what `dataset.toml` says.
    pub fn dataset(sections: &[&str]) -> Self {
        let folder = Self::new();
        for i in 0..4 {
            write_gray(folder.path(&format!("data/image/{i}.png")), &gray(1000)).unwrap();
            write_depth(folder.path(&format!("data/depth/{i}.png")), &depth(1000)).unwrap();
        }
        folder.write("data/dataset.toml", sections.join("\n"));
        folder
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A path as an argument.
    pub fn arg(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> &Self {
        std::fs::create_dir_all(self.path(name).parent().unwrap()).unwrap();
        std::fs::write(self.path(name), content).unwrap();
        self
    }

    /// Cuts a file in half.
    pub fn truncate(&self, name: &str) -> &Self {
        let bytes = std::fs::read(self.path(name)).unwrap();
        self.write(name, &bytes[..bytes.len() / 2])
    }

    /// Names of everything in a subfolder, hidden files too; none where it does not exist.
    pub fn names(&self, name: &str) -> Vec<String> {
        names(&self.path(name))
    }
}

pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
