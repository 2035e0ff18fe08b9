//! Which effects these captures can tell apart, and which could pass for each other.
//!
//! Row i, column k of the matrix is the cosine of the angle between what effect i does, as far as the declared model leaves
//! it, and everything that effect k can do: `depthcal_solver::score::Linearization::mimicry`. Frames that separate two
//! effects lower it; [`super::captures`] proposes them.

use depthcal_io::Separability;
use depthcal_model::Register;
use depthcal_solver::score::ScoreError;
use nalgebra::DVector;

use super::evidence::{Entry, effect_entry, linearize};
use super::{Diagnosis, FREE_MAP};

/// The matrix over the effects that were added and all those that the captures can see, beside the declared model.
///
/// # Errors
///
/// [`ScoreError`] where the declared model cannot be linearised.
pub fn separability(d: &Diagnosis, register: &Register) -> Result<Separability, ScoreError> {
    let (mut entries, mut changes): (Vec<Entry>, Vec<DVector<f64>>) = (Vec::new(), Vec::new());
    let mut add = |name: &str, spec: &str, theta: &[f64]| {
        let entry = effect_entry(register, name, spec.to_owned()).filter(|e| e.block.theta.len() == theta.len());
        let Some(entry) = entry.filter(|_| d.first.camera.block(name).is_none()) else { return };
        let nominal = entry.block.theta.iter();
        changes.push(DVector::from_iterator(theta.len(), theta.iter().zip(nominal).map(|(t, n)| t - n)));
        entries.push(entry);
    };
    for step in d.steps.iter().filter(|s| s.effects.first().is_some_and(|n| n != FREE_MAP)) {
        if let Some(block) = d.last.camera.block(&step.effects[0]) {
            add(&step.effects[0], &step.spec, &block.theta);
        }
    }
    for evidence in d.examination.effects().filter(|e| e.score.rank > 0) {
        add(&evidence.name, &evidence.spec, &evidence.block.theta);
    }
    let linearization = linearize(&d.first, &entries)?;
    let seen: Vec<usize> = (0..entries.len())
        .filter(|i| linearization.score(*i).rank > 0 && linearization.noncentrality(*i, &changes[*i], &[]) > 0.0)
        .collect();
    let row = |i: &usize| {
        let cosine = |k: &usize| if i == k { 1.0 } else { linearization.mimicry(*i, &changes[*i], *k) };
        seen.iter().map(cosine).collect()
    };
    Ok(Separability {
        effects: seen.iter().map(|i| entries[*i].name.clone()).collect(),
        mimicry: seen.iter().map(row).collect(),
    })
}
