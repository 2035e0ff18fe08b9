//! Results of a task: their files, and what their report shows.

use std::path::{Path, PathBuf};

use depthcal_formula::FormulaEffect;
use depthcal_io::{Comparison, Difference, FileError, Fleet, Prior};
use depthcal_model::Register;

use super::made::Made;
use super::report_input::ReportInput;
use crate::calibrate::CalibratedCamera;

/// Contents of a report.
#[derive(Debug)]
pub enum Shown<'a> {
    /// A calibration, an evaluation or a diagnosis, of one camera or of a rig.
    Cameras(ReportInput<'a>),
    /// Depth models compared.
    Comparison {
        /// The record.
        comparison: &'a Comparison,
        /// The best model, fitted to all frames, for its maps.
        best: Option<&'a CalibratedCamera>,
        /// The pieces that the record names.
        register: &'a Register,
        /// How it was made.
        made: Made,
    },
    /// Two calibrations, compared with each other.
    Difference {
        /// The record.
        difference: &'a Difference,
        /// How it was made.
        made: Made,
    },
    /// The calibrations of many cameras of one type, joined.
    Fleet {
        /// The record.
        fleet: &'a Fleet,
        /// Prior of the next camera of this type.
        prior: &'a Prior,
        /// How it was made.
        made: Made,
    },
}

/// Results of a task.
pub trait Results {
    /// Name of the file that all others tell of.
    fn main_file(&self) -> &'static str;

    /// Writes the JSON files into a folder; returns their names.
    ///
    /// # Errors
    ///
    /// [`FileError`] with the file.
    fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError>;

    /// Contents of the report.
    fn shown(&self, made: &Made) -> Shown<'_>;

    /// Formulas that were found, which have files of their own.
    fn formulas(&self) -> Vec<&FormulaEffect> {
        Vec::new()
    }

    /// Results with files and a report of their own, each in a folder of its name.
    fn parts(&self) -> Vec<(&str, &dyn Results)> {
        Vec::new()
    }
}
