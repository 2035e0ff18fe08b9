//! Effects of one camera, tested with all parameters of the rig free.
//!
//! The loop of one camera holds pinhole, lens and place of a camera without images. These come from its depth alone: what its
//! depth model lacks has bent them, and the constant that explains the rest best is not that of the effect. Here the problem of
//! the rig is linearised with every candidate held at its nominal values, so that a score is what pinhole, lens, place and poses
//! cannot take up.

use depthcal_model::{Block, PieceSpec, Register};
use depthcal_solver::score::Linearization;
use depthcal_statistics::mean_to_standard_error;

use crate::adjust::adjustment::Adjustment;
use crate::adjust::state::{ParameterPrior, State};
use crate::calibrate::CalibratedCamera;
use crate::diagnose::candidate_blocks::{CandidateBlock, Fit, thin, with_pieces};
use crate::diagnose::candidates::missing_effects;
use crate::diagnose::observed_states::ObservedStates;
use crate::diagnose::variant_search::best_candidates;
use crate::diagnose::{DiagnoseError, Thresholds};

/// An effect with the constant, the place and the form in which it explains most.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct JointEvidence {
    /// The effect.
    pub spec: PieceSpec,
    /// Its score statistic.
    pub statistic: f64,
    /// p-value of its score test, corrected for the number of its variants and of effects.
    pub p_value: f64,
    /// Mean over standard error of the frames' gains when the effect is estimated from all other frames.
    pub gain_t: f64,
}

/// The effects of `register` that a camera lacks, by falling score statistic, each in its best variant. `fit` is the camera's
/// part of the fit that `state` holds.
///
/// # Errors
///
/// [`DiagnoseError`] where the problem cannot be evaluated.
pub(super) fn joint_search(
    state: &State,
    camera: usize,
    fit: &CalibratedCamera,
    register: &Register,
    thresholds: &Thresholds,
) -> Result<Vec<JointEvidence>, DiagnoseError> {
    let in_rig = InRig { state: state.clone(), camera };
    let effects = missing_effects(register, fit, &ObservedStates::of(fit));
    let (blocks, corrections): (Vec<CandidateBlock>, Vec<f64>) =
        best_candidates(&in_rig, register, &effects, thresholds)?.into_iter().unzip();
    let linearization = in_rig.linearize(&blocks)?;
    let tests = blocks.len() as f64;
    let evidence = |(number, (block, correction)): (usize, (CandidateBlock, f64))| {
        let score = linearization.score(number);
        JointEvidence {
            spec: block.spec,
            statistic: score.statistic,
            p_value: (score.p_value * correction * tests).min(1.0),
            gain_t: mean_to_standard_error(&linearization.held_out_gain(&[number])),
        }
    };
    let mut evidence: Vec<JointEvidence> = blocks.into_iter().zip(corrections).enumerate().map(evidence).collect();
    evidence.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
    Ok(evidence)
}

/// A camera of a fitted rig.
struct InRig {
    state: State,
    /// Its number.
    camera: usize,
}

impl Fit for InRig {
    type Error = DiagnoseError;

    fn linearize(&self, candidates: &[CandidateBlock]) -> Result<Linearization, DiagnoseError> {
        let mut with = self.state.clone();
        let camera = &mut with.cameras[self.camera];
        let (extended, places) = with_pieces(&camera.camera, candidates.iter().map(|c| c.block.clone().hold()));
        let (of_candidates, of_pieces) = places.split_at(candidates.len());
        // Priors name blocks by their numbers.
        let is_pinhole = |block: &Block| block.piece().is_none();
        let of_pinhole = extended.blocks().iter().position(is_pinhole).unwrap_or(0);
        let mut of_pieces = of_pieces.iter().copied();
        let place = |block: &Block| if is_pinhole(block) { None } else { of_pieces.next() }.unwrap_or(of_pinhole);
        let moved: Vec<usize> = camera.camera.blocks().iter().map(place).collect();
        let moved = |prior: &ParameterPrior| ParameterPrior { block: moved[prior.block], ..*prior };
        camera.priors = camera.priors.iter().map(moved).collect();
        camera.camera = extended;
        let held = candidates.iter().zip(of_candidates);
        let named = held.map(|(c, place)| (c.spec.to_string(), *place, c.smoothness.clone()));
        Ok(Adjustment::of_state(&with, true)?.linearize_camera(self.camera, named)?)
    }

    fn thinned(&self, step: usize) -> Self {
        let mut thinned = self.state.clone();
        thin(&mut thinned.cameras[self.camera].capture, step);
        Self { state: thinned, camera: self.camera }
    }
}
