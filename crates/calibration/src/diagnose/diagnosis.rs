//! The result of a diagnosis.

use depthcal_io::{DiagnosisSearched, Verdict};

use super::bad_frames::BadFrame;
use super::discovery::Discovery;
use super::examination::Examination;
use super::experiment_design::CaptureProposal;
use super::frame_planes::FramePlane;
use super::held_out::HeldOut;
use super::left_over::LeftOver;
use super::possible::Possible;
use super::pure_error::PureError;
use super::round::Round;
use super::step::Step;
use crate::calibrate::{Calibrated, ImplausibleScale};

/// The result of a diagnosis. Findings are data; their `Display` words them.
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// The effects that were added, in order.
    pub steps: Vec<Step>,
    /// Effects that may be missing too, but are not certain.
    pub possible: Vec<Possible>,
    /// The residual of the last model, and the part of it that no function of one covariate could remove; `None` where frames
    /// or pixels are too few to tell.
    pub pure_error: Option<PureError>,
    /// Findings and decision of every round.
    pub rounds: Vec<Round>,
    /// Frames that were excluded.
    pub bad_frames: Vec<BadFrame>,
    /// Declarations of the dataset that cannot be right.
    pub declarations: Vec<ImplausibleScale>,
    /// Structure in the residuals that no effect explains.
    pub left_over: Vec<LeftOver>,
    /// The formulas among the steps.
    pub formulas: Vec<Discovery>,
    /// The functions that were searched in what is left; `None` where none were.
    pub searched: Option<DiagnosisSearched>,
    /// Why no formula was found for what is left; `None` where none was searched.
    pub formula_refused: Option<String>,
    /// Captures that would answer open questions.
    pub capture_next: Vec<CaptureProposal>,
    /// The declared model, fitted to all frames that were not excluded.
    pub first: Calibrated,
    /// The last model, fitted to the same frames.
    pub last: Calibrated,
    /// Held-out errors of the declared model.
    pub before: HeldOut,
    /// Held-out errors of the last model.
    pub after: HeldOut,
    /// The plane by which every frame deviates from the last model.
    pub planes: Vec<FramePlane>,
    /// The last examination.
    pub examination: Examination,
}
