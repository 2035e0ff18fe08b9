//! The report of a calibration or an evaluation.

use super::input::{ReportError, ReportInput};
use super::made::made;
use super::{page, sections};

/// Renders a report as one self-contained HTML file.
///
/// ```
/// use depthcal_report::{ReportInput, render};
///
/// let nothing = ReportInput { title: "empty".to_owned(), ..ReportInput::default() };
/// assert!(render(&nothing).unwrap_err().to_string().contains("nothing to report"));
/// ```
///
/// # Errors
///
/// [`ReportError::Nothing`] where there is neither a calibration nor an evaluated frame.
pub fn render(input: &ReportInput<'_>) -> Result<String, ReportError> {
    let evaluated = input.evaluations.iter().any(|d| !d.evaluated.frames.is_empty() || !d.evaluated.dropped.is_empty());
    if input.calibrated.is_none() && !evaluated {
        return Err(ReportError::Nothing);
    }
    page::render(&input.title, &made(&input.command_line, &input.stages), &sections::content(input))
}
