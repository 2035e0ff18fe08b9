//! The report of a calibration, an evaluation or a diagnosis, of one camera or of a rig.

use super::input::{ReportError, ReportInput};
use super::made::made;
use super::{page, rig, sections};

/// Renders a report as one self-contained HTML file. That of a rig has the sections of its reference camera, and one of the rig.
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
    let mut content = sections::content(input);
    if let Some(rig) = &input.rig {
        content = content.followed_by(rig::content(rig));
    }
    page::render(&input.title, &made(&input.made), &content)
}
