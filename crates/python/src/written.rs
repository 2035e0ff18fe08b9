//! Reports and result files.

use std::path::{Path, PathBuf};

use depthcal_calibration::progress::ProgressHandle;
use depthcal_calibration::task::{Made, Results};
use depthcal_io::{StagedResults, write_atomically};
use depthcal_report::{SavedResults, report_of};
use pyo3::prelude::*;

use crate::failure::{Failure, input};

/// Has the files of results written into `out` together, as the command line does; returns their paths. Earlier files that tell
/// of a `calibration.json` that is replaced are removed.
pub(crate) fn save(results: &dyn Results, made: &Made, out: &Path) -> Result<Vec<PathBuf>, Failure> {
    let saved = SavedResults::write(results, made, out, &ProgressHandle::default()).map_err(input)?;
    let paths = saved.paths();
    saved.commit().map_err(input)?;
    Ok(paths)
}

/// The report of results as HTML.
pub(crate) fn html(results: &dyn Results, made: &Made) -> Result<String, Failure> {
    report_of(results, made).map_err(input)
}

/// Writes files into a folder together, or none of them; `main` is the one that the others tell of. Returns their paths.
#[pyfunction]
pub(crate) fn write_files(out: PathBuf, main: &str, files: Vec<(PathBuf, Vec<u8>)>) -> PyResult<Vec<PathBuf>> {
    let staged = StagedResults::within(&out).map_err(input)?;
    for (name, bytes) in &files {
        let path = staged.folder().join(name);
        let folder = path.parent().unwrap_or(&path);
        std::fs::create_dir_all(folder).map_err(|error| input(format!("{}: {error}", out.join(name).display())))?;
        write_atomically(&path, |file| file.write_all(bytes)).map_err(|error| input(staged.located(error)))?;
    }
    staged.commit(main).map_err(input)?;
    Ok(files.into_iter().map(|(name, _)| out.join(name)).collect())
}
