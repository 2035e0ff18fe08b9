//! The files of a fleet.

use std::path::{Path, PathBuf};

use depthcal_calibration::task::{Made, Results, Shown};
use depthcal_io::{FileError, Fleet, Prior};

/// The calibrations of a fleet, joined, with their files.
#[derive(Debug, Clone, Copy)]
pub struct FleetResults<'a> {
    /// `fleet.json`.
    pub fleet: &'a Fleet,
    /// `prior.json`: what the units say of the next one.
    pub prior: &'a Prior,
}

impl Results for FleetResults<'_> {
    fn main_file(&self) -> &'static str {
        "fleet.json"
    }

    fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        self.fleet.write(folder.join("fleet.json"))?;
        self.prior.write(folder.join("prior.json"))?;
        Ok(["fleet.json", "prior.json"].map(PathBuf::from).to_vec())
    }

    fn shown(&self, made: &Made) -> Shown<'_> {
        Shown::Fleet { fleet: self.fleet, prior: self.prior, made: made.clone() }
    }
}
