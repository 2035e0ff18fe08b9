//! Separability: which effects these captures can distinguish, and which could be mistaken for each other.
//!
//! Row i, column k of the matrix is the cosine of the angle between the residuals that effect i causes, the fitted parameters
//! of the declared model adjusted, and the space of all residuals that effect k can cause:
//! [`depthcal_solver::score::Linearization::mimicry`]. Frames that distinguish the two lower it;
//! [`super::experiment_design`] proposes them.

use depthcal_io::Separability;
use depthcal_model::{PieceSpec, Register};
use depthcal_solver::score::ScoreError;
use nalgebra::DVector;

use super::candidate_blocks::{CandidateBlock, linearize};
use super::diagnosis::CameraDiagnosis;
use super::free_map::FREE_MAP;

/// The matrix over the effects that were added and all others that the captures show, given the declared model.
///
/// # Errors
///
/// [`ScoreError`] where the declared model cannot be linearised.
pub fn separability(d: &CameraDiagnosis, register: &Register) -> Result<Separability, ScoreError> {
    let (mut candidates, mut changes): (Vec<CandidateBlock>, Vec<DVector<f64>>) = (Vec::new(), Vec::new());
    let mut add = |name: &str, spec: &PieceSpec, theta: &[f64]| {
        let candidate = CandidateBlock::effect(register, spec.clone());
        let candidate = candidate.filter(|c| c.block.theta.len() == theta.len());
        let Some(candidate) = candidate.filter(|_| d.first.camera.block(name).is_none()) else { return };
        let nominal = candidate.block.theta.iter();
        changes.push(DVector::from_iterator(theta.len(), theta.iter().zip(nominal).map(|(t, n)| t - n)));
        candidates.push(candidate);
    };
    for step in d.steps.iter().filter(|s| s.effects.first().is_some_and(|n| n != FREE_MAP)) {
        if let Some(block) = d.last.camera.block(&step.effects[0]) {
            add(&step.effects[0], &step.spec, &block.theta);
        }
    }
    for evidence in d.examination.effects().filter(|e| e.score.rank > 0) {
        add(&evidence.name, &evidence.spec, &evidence.block.theta);
    }
    let linearization = linearize(&d.first, &candidates)?;
    let seen: Vec<usize> = (0..candidates.len())
        .filter(|i| linearization.score(*i).rank > 0 && linearization.noncentrality(*i, &changes[*i], &[]) > 0.0)
        .collect();
    let row = |i: &usize| {
        let cosine = |k: &usize| if i == k { 1.0 } else { linearization.mimicry(*i, &changes[*i], *k) };
        seen.iter().map(cosine).collect()
    };
    Ok(Separability {
        effects: seen.iter().map(|i| candidates[*i].name.clone()).collect(),
        mimicry: seen.iter().map(row).collect(),
    })
}
