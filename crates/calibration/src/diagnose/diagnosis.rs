//! The result of one camera's diagnosis.

use depthcal_formula::FormulaError;
use depthcal_io::{DiagnosisSearched, Verdict};
use depthcal_model::Register;

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
use crate::calibrate::{CalibratedCamera, ImplausibleScale};

/// The result of one camera's diagnosis. Findings are data; their `Display` words them.
pub struct CameraDiagnosis {
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
    pub first: CalibratedCamera,
    /// The last model, fitted to the same frames.
    pub last: CalibratedCamera,
    /// Held-out errors of the declared model.
    pub before: HeldOut,
    /// Held-out errors of the last model.
    pub after: HeldOut,
    /// The plane by which every frame deviates from the last model.
    pub planes: Vec<FramePlane>,
    /// The last examination.
    pub examination: Examination,
}

impl CameraDiagnosis {
    /// A register with the formulas that were found.
    ///
    /// # Errors
    ///
    /// [`FormulaError`] where a formula cannot be a piece.
    pub fn register(&self, declared: &Register) -> Result<Register, FormulaError> {
        let mut register = declared.clone();
        for formula in &self.formulas {
            formula.effect.register(&mut register)?;
        }
        Ok(register)
    }
}
