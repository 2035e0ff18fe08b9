//! Reports and result files.

use std::path::{Path, PathBuf};

use depthcal_io::{StagedResults, write_atomically};
use depthcal_report::{ReportInput, render};

use crate::failure::{Failure, input};

/// Has result files written into a hidden folder and then puts them into `out` together, as the command line does; `write` returns
/// their names. Earlier files that tell of a `calibration.json` that is replaced are removed. `first` is the file that the others tell of.
pub(crate) fn save_together(
    out: &Path,
    first: &str,
    write: impl FnOnce(&Path) -> Result<Vec<PathBuf>, Failure>,
) -> Result<Vec<PathBuf>, Failure> {
    let staged = StagedResults::within(out).map_err(input)?;
    let names = write(staged.folder()).map_err(|failure| match failure {
        // Errors name the place where files will be in the end.
        Failure::Input(message) => {
            let [hidden, shown] = [staged.folder(), out].map(|path| path.display().to_string());
            Failure::Input(message.replace(&hidden, &shown))
        }
        other => other,
    })?;
    staged.commit(first).map_err(input)?;
    Ok(names.into_iter().map(|name| out.join(name)).collect())
}

/// Writes a text file; returns its path.
pub(crate) fn write_text(path: PathBuf, text: &str) -> Result<PathBuf, Failure> {
    write_atomically(&path, |file| file.write_all(text.as_bytes())).map_err(input)?;
    Ok(path)
}

/// A report as HTML.
pub(crate) fn html(report: &ReportInput<'_>) -> Result<String, Failure> {
    render(report).map_err(input)
}

/// Writes `report.html` into a folder; returns its path.
pub(crate) fn write_report(report: &ReportInput<'_>, out: &Path) -> Result<PathBuf, Failure> {
    write_text(out.join("report.html"), &html(report)?)
}
