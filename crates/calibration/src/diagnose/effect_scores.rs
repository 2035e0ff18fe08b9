//! Scores of all effects that a model lacks, with the constants that they have by default, for pooling over the units of a fleet.

use depthcal_io::{FileReference, ModelValue, ScoredEffect, ScoredParameter, Scores};
use depthcal_model::{Block, PieceSpec, Register, Role};
use depthcal_solver::score::{Linearization, ScoreError};
use nalgebra::DMatrix;

use super::candidate_blocks::{CandidateBlock, linearize};
use super::effect_size::EffectSizes;
use super::observed_states::ObservedStates;
use crate::calibrate::CalibratedCamera;

/// Scores of every effect of `register` that the model of a fit lacks and that its captures show, with the constants, place and
/// form that the effect has by default: those of a diagnosis are searched and differ from unit to unit. `None` where no effect
/// can be scored: without depth, with fields, which have a prior of their own, or with a single frame.
///
/// # Errors
///
/// [`ScoreError`] where the problem cannot be evaluated.
pub fn effect_scores(
    fit: &CalibratedCamera,
    register: &Register,
    dataset: FileReference,
) -> Result<Option<Scores>, ScoreError> {
    if !fit.with_depth || !fit.smoothness.fields.is_empty() || fit.capture.frames.len() < 2 {
        return Ok(None);
    }
    let register = register.clone().for_board(&fit.capture.target);
    let missing = register.names().filter(|name| fit.camera.block(name).is_none());
    let candidates: Vec<CandidateBlock> = missing
        .filter_map(|name| CandidateBlock::effect(&register, PieceSpec::new(name)))
        .filter(|c| c.block.piece().is_some_and(|p| p.role() == Role::Effect && p.field().is_none()))
        .collect();
    let Some((candidates, linearization)) = testable(fit, candidates)? else { return Ok(None) };
    let model = model_values(fit);
    if candidates.is_empty() || linearization.shared_count() != model.len() {
        return Ok(None);
    }
    let all: Vec<usize> = (0..candidates.len()).collect();
    let joint = linearization.efficient_scores(&all);
    let states = ObservedStates::of(fit);
    let sizes = EffectSizes::new(&states, None);
    let mut first = 0;
    let effects = candidates
        .iter()
        .map(|candidate| {
            let count = candidate.block.theta.len();
            let scatter = joint.scatter.view((first, first), (count, count)).into_owned();
            first += count;
            scored(candidate, &scatter, &sizes)
        })
        .collect();
    Ok(Some(Scores {
        dataset,
        model,
        frames: fit.capture.frames.len(),
        effects,
        score: joint.score.iter().copied().collect(),
        information: rows(&joint.information),
        response: rows(&joint.response),
    }))
}

/// The candidates whose derivatives are numbers, and show in these captures at all, with their linearisation.
fn testable(
    fit: &CalibratedCamera,
    candidates: Vec<CandidateBlock>,
) -> Result<Option<(Vec<CandidateBlock>, Linearization)>, ScoreError> {
    let shows = |candidate: &CandidateBlock| {
        let Ok(linearization) = linearize(fit, std::slice::from_ref(candidate)) else { return false };
        let information = linearization.efficient_scores(&[0]).information;
        information.iter().all(|v| v.is_finite()) && information.diagonal().iter().all(|v| *v > 0.0)
    };
    let shown: Vec<CandidateBlock> = candidates.into_iter().filter(shows).collect();
    if shown.is_empty() {
        return Ok(None);
    }
    let linearization = linearize(fit, &shown)?;
    Ok(Some((shown, linearization)))
}

/// Names and values of the free parameters of a fit, in the order of the linearisation's shared columns.
fn model_values(fit: &CalibratedCamera) -> Vec<ModelValue> {
    let of_block = |block: &Block| -> Vec<ModelValue> {
        let name = |i: usize| format!("{}.{}", block.name(), block.parameters()[i].name);
        let free = (0..block.theta.len()).filter(|i| block.free[*i]);
        free.map(|i| ModelValue { name: name(i), value: block.theta[i] }).collect()
    };
    fit.camera.blocks().iter().flat_map(of_block).collect()
}

fn scored(candidate: &CandidateBlock, scatter: &DMatrix<f64>, sizes: &EffectSizes<'_>) -> ScoredEffect {
    let parameters = candidate.block.parameters();
    let nominal = |i: usize| ScoredParameter {
        name: parameters[i].name.to_string(),
        unit: parameters[i].unit.to_owned(),
        nominal: candidate.block.theta[i],
    };
    ScoredEffect {
        effect: candidate.name.clone(),
        with: candidate.spec.to_string(),
        options: candidate.block.piece().map(|piece| piece.options()).unwrap_or_default(),
        parameters: (0..parameters.len()).map(nominal).collect(),
        scatter: rows(scatter),
        square_mm2: rows(&sizes.square_mm2(&candidate.block)),
        formula: candidate.block.piece().and_then(|piece| piece.formula().cloned()),
    }
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}
