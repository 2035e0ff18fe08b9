//! Finds out which frames of an interrupted `apply` are complete.
//!
//! During a run, a hidden file in the folder of the results records what it was started with. Results are written under
//! temporary names and renamed, so that a file is either complete or absent. A result that is newer than its input, with the
//! same calibration and the same settings, is not computed again. The file is removed at the end of a run.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use depthcal_io::{read_json, write_json};
use serde::{Deserialize, Serialize};

use super::images::stem;
use crate::failure::{Failure, input};

const FILE: &str = ".depthcal-apply.json";

/// What a run was started with: version, calibration, frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Started {
    version: String,
    /// Digest of the calibration's file.
    calibration: String,
    /// Everything else that a frame's results depend on, by the frame's name without extension.
    frames: BTreeMap<String, String>,
}

/// An interrupted run, and the present one.
pub(super) struct Resume {
    file: PathBuf,
    before: Option<Started>,
    now: Started,
}

impl Resume {
    /// Looks for an interrupted run in a folder. `frames` are names without extension, and what their results depend on.
    pub(super) fn open(
        folder: &Path,
        calibration: &Path,
        frames: impl Iterator<Item = (String, String)>,
    ) -> Result<Self, Failure> {
        let bytes = fs::read(calibration)
            .map_err(|error| Failure::Input(format!("{}: cannot read the file: {error}", calibration.display())))?;
        let now = Started {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            calibration: blake3::hash(&bytes).to_string(),
            frames: frames.collect(),
        };
        let file = folder.join(FILE);
        // Without a readable record everything is computed again.
        let before = if file.is_file() { read_json(&file).ok() } else { None };
        Ok(Self { file, before, now })
    }

    /// Whether the interrupted run has completed a frame, whose results are `outputs`, as the present one would.
    pub(super) fn is_done(&self, depth: &Path, outputs: &[PathBuf]) -> bool {
        let Some(before) = &self.before else { return false };
        let stem = stem(depth);
        let same = before.version == self.now.version
            && before.calibration == self.now.calibration
            && before.frames.contains_key(&stem)
            && before.frames.get(&stem) == self.now.frames.get(&stem);
        let changed = |path: &Path| -> Option<SystemTime> { fs::metadata(path).ok()?.modified().ok() };
        let input = changed(depth);
        same && input.is_some() && outputs.iter().all(|output| changed(output) >= input)
    }

    /// Records the present run. Results of the interrupted one that differ from those of this run are removed first, so that
    /// no later run mistakes them for results of this one.
    pub(super) fn begin(&self) -> Result<(), Failure> {
        if let Some(before) = self.before.as_ref().filter(|before| **before != self.now) {
            let same_run = before.version == self.now.version && before.calibration == self.now.calibration;
            let folder = self.file.parent().unwrap_or(Path::new("."));
            for (stem, key) in &before.frames {
                if !same_run || self.now.frames.get(stem).is_some_and(|now| now != key) {
                    for extension in ["png", "pgm", "tif", "tiff", "npy", "exr", "ply", "pcd"] {
                        // Fails where there is no such file, which is fine.
                        let _ = fs::remove_file(folder.join(format!("{stem}.{extension}")));
                    }
                }
            }
        }
        write_json(&self.file, &self.now).map_err(input)
    }

    /// The run is complete.
    pub(super) fn end(&self) {
        let _ = fs::remove_file(&self.file);
    }
}
