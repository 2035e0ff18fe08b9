//! The report of a calibration, an evaluation or a diagnosis, of any number of cameras.

use rayon::prelude::*;

use super::content::Content;
use super::input::{ReportCamera, ReportError, ReportInput};
use super::made::made;
use super::scope::Scope;
use super::{page, rig, sections};

/// Renders a report as one self-contained HTML file: what the cameras have in common where there are several, then the sections
/// of every camera.
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
    let cameras: Vec<&ReportCamera<'_>> = input.cameras.iter().filter(|camera| camera.has_content()).collect();
    let mut content = match (&input.rig, cameras.as_slice()) {
        (_, []) => return Err(ReportError::Nothing),
        (None, [camera]) => sections::content(&Scope::default(), camera, input.story).1,
        (rig, _) => {
            let parts = cameras.par_iter().enumerate();
            let parts: Vec<_> =
                parts.map(|(i, camera)| sections::content(&Scope::camera(i + 1), camera, &[])).collect();
            let (summaries, parts): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
            let mut content = Content::default();
            rig::verdicts(&mut content, &cameras, &summaries, rig.as_ref(), input.story);
            if let Some(rig) = rig {
                rig::section(&mut content, rig, &cameras);
            }
            let parts = cameras.iter().zip(parts).map(|(camera, part)| part.below(&camera.name));
            parts.fold(content, Content::followed_by)
        }
    };
    sections::reading(&mut content);
    page::render(&input.title, &made(&input.made), &content)
}
