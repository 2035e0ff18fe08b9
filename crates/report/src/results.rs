//! Results of a task, written with their report.

use std::path::{Path, PathBuf};

use depthcal_calibration::compare::tables::tables;
use depthcal_calibration::progress::ProgressHandle;
use depthcal_calibration::task::{Made, Results, Shown};
use depthcal_io::{Displaced, FileError, StagedResults, write_atomically};
use thiserror::Error;

use super::comparison::render_comparison;
use super::difference::render_difference;
use super::effect_files::effect_files;
use super::fleet::render_fleet;
use super::input::ReportError;
use super::render::render;

/// Folder of the files of formulas that were found.
const EFFECTS: &str = "effects";

/// Why results are not written.
#[derive(Debug, Error)]
pub enum SaveError {
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// There is no report.
    #[error(transparent)]
    Report(#[from] ReportError),
}

/// The report of results as one self-contained HTML file.
///
/// # Errors
///
/// [`ReportError`].
pub fn report_of(results: &dyn Results, made: &Made) -> Result<String, ReportError> {
    match results.shown(made) {
        Shown::Cameras(input) => render(&input),
        Shown::Comparison { comparison, best, register, made } => {
            render_comparison(comparison, &tables(comparison), best, register, &made)
        }
        Shown::Difference { difference, made } => render_difference(difference, &made),
        Shown::Fleet { fleet, prior, made } => render_fleet(fleet, prior, &made),
    }
}

/// Results that are written but have not replaced earlier ones yet. Dropped without [`commit`](Self::commit), they leave the
/// earlier ones as they were.
#[derive(Debug)]
pub struct SavedResults {
    staged: StagedResults,
    main_file: &'static str,
    out: PathBuf,
    names: Vec<PathBuf>,
}

impl SavedResults {
    /// Writes all files of results for the folder `out`, which is created if it does not exist: the records, `report.html`,
    /// formulas that were found, and the same of all parts in folders of their names. The report is a stage of `progress`.
    ///
    /// # Errors
    ///
    /// [`SaveError`].
    pub fn write(results: &dyn Results, made: &Made, out: &Path, progress: &ProgressHandle) -> Result<Self, SaveError> {
        let staged = StagedResults::within(out)?;
        let names = write_all(results, made, staged.folder(), progress).map_err(|error| match error {
            // Errors name the place where files will be in the end.
            SaveError::File(error) => SaveError::File(staged.located(error)),
            report => report,
        })?;
        Ok(Self { staged, main_file: results.main_file(), out: out.to_owned(), names })
    }

    /// Paths that the files have in the end.
    pub fn paths(&self) -> Vec<PathBuf> {
        self.names.iter().map(|name| self.out.join(name)).collect()
    }

    /// Replaces the earlier results: of a calibration all that tells of it, else the files that were written alone.
    ///
    /// # Errors
    ///
    /// [`FileError::Write`].
    pub fn commit(self) -> Result<Displaced, FileError> {
        self.staged.commit(self.main_file)
    }
}

/// Writes the files of results and of their parts into a folder; returns their names.
fn write_all(
    results: &dyn Results,
    made: &Made,
    folder: &Path,
    progress: &ProgressHandle,
) -> Result<Vec<PathBuf>, SaveError> {
    let mut names = Vec::new();
    for (name, part) in results.parts() {
        let within = write_all(part, made, &folder.join(name), progress)?;
        names.extend(within.into_iter().map(|file| Path::new(name).join(file)));
    }
    names.extend(results.write(folder)?);
    let stage = progress.stage("report");
    let report = report_of(results, made)?;
    drop(stage);
    let texts = results.formulas().into_iter().flat_map(effect_files);
    let texts = texts.map(|(name, text)| (Path::new(EFFECTS).join(name), text));
    for (name, text) in std::iter::once((PathBuf::from("report.html"), report)).chain(texts) {
        write_atomically(folder.join(&name), |file| file.write_all(text.as_bytes()))?;
        names.push(name);
    }
    Ok(names)
}
