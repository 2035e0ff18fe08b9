//! `report.html`: one file that tells a researcher how wrong the depth was, where, how wrong it is after correction on
//! frames that the fit did not see, how sure that is, and whether the calibration may be trusted.
//!
//! The file needs no network: its plots are drawn by plotly.js, which ships inside the `plotly` crate and is written
//! into
//! the page, and a content security policy forbids the page to load anything. Every number and sentence is in the HTML
//! itself and readable without scripts; the scripts draw the figures. Same input, same bytes: nothing in it depends on
//! time, and resampling has a fixed seed.
//!
//! Intervals come from resampling whole frames, because the pixels of a frame share the errors of its pose and are
//! correlated with their neighbours: they count as one observation, not as thousands.

mod binned;
mod checks;
mod comparison;
mod covariates;
mod diagnosis;
mod figures;
mod frame_noise;
mod headline;
mod html;
mod leftover;
mod page;
mod parameters;
mod pool;
#[cfg(feature = "rerun")]
pub mod rerun;
mod sections;
mod statistics;
mod tables;
mod uncertainty;

use thiserror::Error;

use depthcal_calibration::calibrate::Calibrated;
use depthcal_calibration::judge::evaluate::Evaluated;

pub use checks::{Check, Level};
pub use comparison::render_comparison;
pub use diagnosis::ReportDiagnosis;
pub use headline::Direction;

/// What a dataset was to the calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The camera was fitted to these frames: their errors flatter it.
    Fitted,
    /// Frames of the same capture that the fit did not see.
    HeldOut,
    /// Another capture, which the fit did not see.
    Other,
}

impl Role {
    /// The word that the report uses.
    pub fn name(self) -> &'static str {
        match self {
            Role::Fitted => "fitted",
            Role::HeldOut => "held out",
            Role::Other => "other capture",
        }
    }
}

/// An evaluated dataset and what it was to the calibration.
#[derive(Debug, Clone, Copy)]
pub struct ReportDataset<'a> {
    /// Its errors.
    pub evaluated: &'a Evaluated,
    /// What it was to the calibration.
    pub role: Role,
}

/// Everything that a report is made from.
///
/// With `calibrated` the report has parameters, uncertainty and noise; with `evaluations` errors before and after; each
/// of them may be missing, but not both.
#[derive(Debug, Clone, Default)]
pub struct ReportInput<'a> {
    /// Heading, usually the dataset's name.
    pub title: String,
    /// The command that made the report, for the record.
    pub command_line: String,
    /// The calibration, where it is at hand.
    pub calibrated: Option<&'a Calibrated>,
    /// Evaluated datasets, in the order in which they are shown.
    pub evaluations: &'a [ReportDataset<'a>],
    /// The diagnosis that led to the calibration, where there was one.
    pub diagnosis: Option<ReportDiagnosis<'a>>,
    /// Plain sentences that introduce the report, for example what was simulated and what the model does not declare.
    pub story: &'a [String],
}

/// Why there is no report.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ReportError {
    /// There is neither a calibration nor an evaluated frame.
    #[error(
        "there is nothing to report: neither a calibration nor an evaluated frame was given; evaluate the calibration \
         on a dataset in which the board was found"
    )]
    Nothing,
    /// The plotting library has no script to embed.
    #[error("the plotting library of this build has no script to embed: build with the locked dependencies")]
    NoScript,
}

/// Renders a report as one self-contained HTML file.
///
/// ```
/// use depthcal::report::{ReportInput, render};
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
    page::page(input)
}

#[cfg(test)]
mod tests;
