//! Reports and result files.

use std::path::{Path, PathBuf};

use depthcal_calibration::progress::ProgressHandle;
use depthcal_calibration::task::{Made, Results};
use depthcal_report::{SavedResults, report_of};

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
