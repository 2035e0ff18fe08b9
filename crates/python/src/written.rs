//! Reports and result files.

use std::path::{Path, PathBuf};

use depthcal_io::write_atomically;
use depthcal_report::{ReportInput, render};

use crate::failure::{Failure, input};

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
