//! Examination of a fit: the evidence for every effect that its camera lacks, and for free functions that compete with them.

use depthcal_model::{PieceSpec, Register};
use depthcal_solver::score::{Linearization, Score, ScoreError};
use depthcal_statistics::upper_median;
use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::candidate_blocks::{CandidateBlock, linearize};
use super::candidates::missing_effects;
use super::effect_size::EffectSizes;
use super::evidence::Evidence;
use super::free_functions::{FreeFunction, free_functions};
use super::observed_states::ObservedStates;
use super::thresholds::Thresholds;
use super::variant_search::best_candidates;
use crate::calibrate::CalibratedCamera;

/// Directions in the parameters of an effect over which its minimal detectable size is a median.
const DIRECTIONS: usize = 25;
/// Seed of these directions: the same input gives the same sizes.
const DIRECTIONS_SEED: u64 = 7;

/// The evidence for all candidates in the residuals of one fit.
pub struct Examination {
    /// Effects and free functions by falling gain.
    pub evidence: Vec<Evidence>,
    /// The normal equations of the fit, frame by frame, with the candidates held.
    pub linearization: Linearization,
    /// Number of effects tested, by which p-values are corrected.
    pub tests: usize,
    /// Chain states and covariates of the observations.
    pub states: ObservedStates,
}

impl Examination {
    /// The effects by falling gain.
    pub fn effects(&self) -> impl Iterator<Item = &Evidence> {
        self.evidence.iter().filter(|e| e.along.is_none())
    }

    /// The free functions by falling gain.
    pub fn free_functions(&self) -> impl Iterator<Item = &Evidence> {
        self.evidence.iter().filter(|e| e.along.is_some())
    }

    /// Cost of all frames, ½ Σ r².
    pub fn cost(&self) -> f64 {
        cost(&self.linearization)
    }
}

/// Cost of all frames, ½ Σ r².
fn cost(linearization: &Linearization) -> f64 {
    (0..linearization.cluster_count()).map(|c| linearization.cluster_cost(c)).sum()
}

/// Examines a fit: every effect of `register` that its camera lacks, and free functions.
///
/// # Errors
///
/// [`ScoreError`] where the problem cannot be evaluated.
pub fn examine(
    fit: &CalibratedCamera,
    register: &Register,
    thresholds: &Thresholds,
) -> Result<Examination, ScoreError> {
    let states = ObservedStates::of(fit);
    let effects = missing_effects(register, fit, &states);
    // With factors by which p-values are corrected for a search.
    let (mut candidates, mut corrections): (Vec<CandidateBlock>, Vec<f64>) =
        best_candidates(fit, register, &effects, thresholds)?.into_iter().unzip();
    let tests = candidates.len().max(1);
    let board = fit.capture.target.marker_rectangle();
    for function in free_functions(&states, fit.camera.width, fit.camera.height, board, thresholds) {
        let FreeFunction { name, along, block, smoothness } = function;
        let (name, smoothness) = (name.to_owned(), Some(smoothness));
        candidates.push(CandidateBlock {
            spec: PieceSpec::new(name.as_str()),
            name,
            value: None,
            along: Some(along),
            block,
            smoothness,
        });
        corrections.push(1.0);
    }
    let linearization = linearize(fit, &candidates)?;
    let sizes = EffectSizes::new(&states, None);
    let mut evidence: Vec<Evidence> = candidates
        .par_iter()
        .enumerate()
        .map(|(index, candidate)| {
            let test = Test {
                linearization: &linearization,
                sizes: &sizes,
                noise_mm: states.noise_mm,
                index,
                candidate,
                thresholds,
            };
            test.evidence(corrections[index], tests)
        })
        .collect();
    evidence.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
    Ok(Examination { evidence, linearization, tests, states })
}

/// Score tests of single effects, with the constants of their specs and no search.
///
/// # Errors
///
/// [`ScoreError`] where the problem cannot be evaluated.
pub fn scores(fit: &CalibratedCamera, register: &Register, specs: &[PieceSpec]) -> Result<Vec<Score>, ScoreError> {
    let candidates: Vec<CandidateBlock> =
        specs.iter().filter_map(|s| CandidateBlock::effect(register, s.clone())).collect();
    let linearization = linearize(fit, &candidates)?;
    Ok((0..candidates.len()).map(|i| linearization.score(i)).collect())
}

/// Test of one effect, with the constants of its spec and no search, that a fit lacks.
pub(super) struct EffectTest {
    /// Its score test.
    pub score: Score,
    /// Its gain on every frame.
    pub gains: Vec<f64>,
    /// Cost of the fit, ½ Σ r².
    pub cost: f64,
}

/// Tests one effect; `None` where the problem cannot be evaluated.
pub(super) fn test_effect(fit: &CalibratedCamera, register: &Register, spec: &PieceSpec) -> Option<EffectTest> {
    let linearization = linearize(fit, &[CandidateBlock::effect(register, spec.clone())?]).ok()?;
    let (score, gains) = (linearization.score(0), linearization.held_out_gain(&[0]));
    Some(EffectTest { score, gains, cost: cost(&linearization) })
}

/// One candidate in the linearisation of all.
struct Test<'a> {
    linearization: &'a Linearization,
    sizes: &'a EffectSizes<'a>,
    /// Root mean square noise of single depth pixels, mm.
    noise_mm: f64,
    /// Number of the candidate in the linearisation.
    index: usize,
    candidate: &'a CandidateBlock,
    thresholds: &'a Thresholds,
}

impl Test<'_> {
    /// The evidence; p-values are multiplied by `correction`, detectable sizes are those of one among `tests` effects.
    fn evidence(&self, correction: f64, tests: usize) -> Evidence {
        let Self { linearization, sizes, index, candidate, thresholds, .. } = *self;
        let score = linearization.score(index);
        let mut block = candidate.block.clone();
        let is_free_function = candidate.along.is_some();
        let change = if is_free_function { linearization.joint_change(&[index]) } else { score.change.clone() };
        block.theta.iter_mut().zip(change.iter()).for_each(|(t, d)| *t += d);
        let level = thresholds.level / (tests as f64 * correction);
        Evidence {
            name: candidate.name.clone(),
            spec: candidate.spec.clone(),
            value: candidate.value,
            reduced: self.reduced_spec(&score),
            along: candidate.along,
            p_value: (score.p_value * correction).min(1.0),
            gains: linearization.held_out_gain(&[index]),
            expected_size_mm: if is_free_function { self.visible_mm(&change) } else { sizes.rms_mm(&block) },
            minimal_detectable_mm: self.minimal_detectable(level),
            score,
            block,
            index,
        }
    }

    /// Root mean square over the depth samples of the part of a change of parameters that the fitted parameters cannot take
    /// up, mm. A free function has parts that D takes up, and these are no error that is left.
    fn visible_mm(&self, change: &DVector<f64>) -> f64 {
        let lin = self.linearization;
        let rows: usize = (0..lin.cluster_count()).map(|c| lin.cluster_rows(c)).sum();
        let of_noise = lin.noncentrality(self.index, change, &[]) / rows.max(1) as f64;
        of_noise.sqrt() * self.noise_mm
    }

    /// The spec with as many parameters free as the data determine combinations, the best determined ones first (pivoted
    /// Cholesky decomposition of the information, scaled by the parameters' typical sizes); `None` where all are determined,
    /// or none.
    fn reduced_spec(&self, score: &Score) -> Option<PieceSpec> {
        let parameters = self.candidate.block.parameters();
        if self.candidate.along.is_some() || score.rank == 0 || score.rank == parameters.len() {
            return None;
        }
        let mut remaining = self.linearization.visible_information(self.index);
        for (i, a) in parameters.iter().enumerate() {
            for (k, b) in parameters.iter().enumerate() {
                remaining[(i, k)] *= a.scale * b.scale;
            }
        }
        let mut free = Vec::new();
        for _ in 0..score.rank {
            let pivot = (0..parameters.len()).max_by(|a, b| remaining[(*a, *a)].total_cmp(&remaining[(*b, *b)]))?;
            let column = remaining.column(pivot).into_owned();
            let scale = column[pivot];
            remaining -= &column * column.transpose() / scale;
            free.push(pivot);
        }
        let letter = |i: usize| parameters[i].name.chars().last();
        let letters: String = free.iter().filter_map(|i| letter(*i)).collect();
        // A spec names free parameters by their last letters: these have to be unambiguous.
        let named = (0..parameters.len()).filter(|i| letter(*i).is_some_and(|c| letters.contains(c))).count();
        (named == free.len()).then(|| self.candidate.spec.clone().only(letters))
    }

    /// Size that a test at `level` detects with [`Thresholds::power`], mm: the median over random directions in the space of
    /// the effect's parameters, scaled by their typical sizes. NaN for free functions.
    fn minimal_detectable(&self, level: f64) -> f64 {
        if self.candidate.along.is_some() {
            return f64::NAN;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(DIRECTIONS_SEED);
        let parameters = self.candidate.block.parameters().to_vec();
        let count = if parameters.len() == 1 { 1 } else { DIRECTIONS };
        let mut draw = |scale: f64| {
            if count == 1 { scale } else { scale * Distribution::<f64>::sample(&StandardNormal, &mut rng) }
        };
        let scales = || parameters.iter().map(|p| p.scale);
        let directions: Vec<DVector<f64>> =
            (0..count).map(|_| DVector::from_iterator(parameters.len(), scales().map(&mut draw))).collect();
        let factors = self.linearization.detectable_factors(self.index, &directions, level, self.thresholds.power);
        let square_mm2 = self.sizes.square_mm2(&self.candidate.block);
        let size = |(direction, factor): (&DVector<f64>, f64)| {
            factor * direction.dot(&(&square_mm2 * direction)).max(0.0).sqrt()
        };
        let mut sizes: Vec<f64> = directions.iter().zip(factors).map(size).filter(|s| s.is_finite()).collect();
        upper_median(&mut sizes).unwrap_or(f64::INFINITY)
    }
}
