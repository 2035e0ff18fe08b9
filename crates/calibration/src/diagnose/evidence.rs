//! What the residuals of a fit say about every effect that its model lacks, and about free functions beside them.

use depthcal_model::{Block, Camera, Register};
use depthcal_solver::score::{Linearization, Score, ScoreError};
use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::candidates::{Effect, around, finer, missing_effects};
use super::probe::{Along, Probe, probes};
use super::sight::Sights;
use crate::adjust::adjustment::Adjustment;
use crate::calibrate::Calibrated;

/// Values of a scanned constant that are tested together.
const TOGETHER: usize = 12;
/// Level and power that minimal detectable sizes are stated for.
pub const LEVEL: f64 = 0.01;
/// Power that minimal detectable sizes are stated for.
pub const POWER: f64 = 0.8;

/// What is known about one candidate.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// Effect or free function.
    pub name: String,
    /// As on the command line, constants included; the name for free functions.
    pub spec: String,
    /// Value of the constant that was searched.
    pub value: Option<f64>,
    /// The same with parameters held of which the data see nothing of their own; `None` where they see all.
    pub reduced: Option<String>,
    /// Along what a free function is one; `None` for effects.
    pub along: Option<Along>,
    /// The score test.
    pub score: Score,
    /// p-value, corrected for the constants that were tried.
    pub p_value: f64,
    /// Fall of every frame's cost ½ Σ r² when the candidate was estimated without it.
    pub gains: Vec<f64>,
    /// Root mean square size of the effect that the data would give it, mm.
    pub expected_size_mm: f64,
    /// Size from which these captures show the effect in 80 % of cases, mm.
    pub minimal_detectable_mm: f64,
    /// The effect at its expected parameters.
    pub block: Block,
    /// Its place in the linearisation.
    pub index: usize,
}

impl Evidence {
    /// Sum of the gains.
    pub fn gain(&self) -> f64 {
        self.gains.iter().sum()
    }

    /// Mean over standard error of the frames' gains.
    pub fn t(&self) -> f64 {
        t_of(&self.gains)
    }
}

/// Mean over standard error.
pub fn t_of(gains: &[f64]) -> f64 {
    let n = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    if variance > 0.0 { mean / (variance / n).sqrt() } else { 0.0 }
}

/// Everything about a fit that a decision needs.
pub struct Examination {
    /// Effects of the catalogue and free functions, by falling gain.
    pub evidence: Vec<Evidence>,
    /// The normal equations behind it.
    pub linearization: Linearization,
    /// Number of effects tested, for the correction of p-values.
    pub tests: usize,
    /// Where observations lie.
    pub sights: Sights,
}

impl Examination {
    /// Effects alone, by falling gain.
    pub fn effects(&self) -> impl Iterator<Item = &Evidence> {
        self.evidence.iter().filter(|e| e.along.is_none())
    }

    /// Free functions alone, by falling gain.
    pub fn probes(&self) -> impl Iterator<Item = &Evidence> {
        self.evidence.iter().filter(|e| e.along.is_some())
    }

    /// ½ Σ r² of all frames.
    pub fn cost(&self) -> f64 {
        (0..self.linearization.cluster_count()).map(|c| self.linearization.cluster_cost(c)).sum()
    }
}

/// A candidate block and what it is for.
pub(super) struct Entry {
    pub name: String,
    pub spec: String,
    pub value: Option<f64>,
    pub along: Option<Along>,
    pub block: Block,
    pub smoothness: Option<nalgebra::DMatrix<f64>>,
}

/// The fit's problem with candidates released in none of their parameters, linearised.
pub(super) fn linearize(fit: &Calibrated, entries: &[Entry]) -> Result<Linearization, ScoreError> {
    // Effects act on the true depth, before the depth model: they come first.
    let mut pieces: Vec<Block> = entries.iter().map(|e| e.block.clone().hold()).collect();
    let (pinhole, own): (Vec<Block>, Vec<Block>) =
        fit.camera.blocks().iter().cloned().partition(|b| b.piece().is_none());
    pieces.extend(own);
    let pinhole = pinhole.into_iter().next().unwrap_or_else(|| Block::pinhole([f64::NAN; 5]));
    let (camera, places) = Camera::assemble(fit.camera.width, fit.camera.height, pinhole, pieces);
    let adjustment = Adjustment::new(&fit.capture, &camera, &fit.noise, true);
    adjustment.linearize(entries.iter().zip(places).map(|(e, place)| (e.spec.clone(), place, e.smoothness.clone())))
}

pub(super) fn effect_entry(register: &Register, name: &str, spec: String) -> Option<Entry> {
    let block = register.block(&spec, None).ok()?;
    Some(Entry { name: name.to_owned(), spec, value: None, along: None, block, smoothness: None })
}

/// The value of an effect's constant that explains most, searched coarsely and then finely; p-values are to be multiplied
/// by the number that comes with it.
fn best_value(fit: &Calibrated, register: &Register, effect: &Effect) -> Result<(Option<f64>, f64), ScoreError> {
    if effect.values.len() < 2 {
        return Ok((effect.values.first().copied(), 1.0));
    }
    let search = |values: &[f64]| -> Result<Vec<(f64, f64)>, ScoreError> {
        let chunks: Result<Vec<Vec<(f64, f64)>>, ScoreError> = values
            .par_chunks(TOGETHER)
            .map(|chunk| {
                let entry = |v: &f64| effect_entry(register, effect.name, effect.spec(Some(*v)));
                let entries: Vec<Entry> = chunk.iter().filter_map(entry).collect();
                let linearization = linearize(fit, &entries)?;
                Ok(chunk.iter().enumerate().map(|(i, v)| (*v, linearization.score(i).statistic)).collect())
            })
            .collect();
        Ok(chunks?.concat())
    };
    let best = |scores: &[(f64, f64)]| scores.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
    let coarse = search(&effect.values)?;
    let Some(mut found) = best(&coarse) else { return Ok((None, 1.0)) };
    if effect.refine && found.0.is_finite() {
        found = best(&search(&finer(&effect.values, found.0))?).filter(|f| f.1 > found.1).unwrap_or(found);
    }
    // Neighbouring values are correlated: about every second one is a test of its own.
    Ok((Some(found.0), (coarse.len() as f64 / 2.0).max(1.0)))
}

/// Examines a fit: every effect of `register` that its camera lacks, and free functions.
///
/// # Errors
///
/// [`ScoreError`] where the problem cannot be evaluated.
pub fn examine(fit: &Calibrated, register: &Register) -> Result<Examination, ScoreError> {
    let sights = Sights::of(fit);
    let mut entries = Vec::new();
    let mut corrections = Vec::new();
    for effect in missing_effects(register, &fit.camera, &sights) {
        let (value, correction) = best_value(fit, register, &effect)?;
        if let Some(entry) = effect_entry(register, effect.name, effect.spec(value)) {
            entries.push(Entry { value, ..entry });
            corrections.push(correction);
        }
    }
    let tests = entries.len().max(1);
    let points = fit.capture.target.points();
    let corner = |pick: fn(f64, f64) -> f64, start: f64| {
        points.iter().fold([start; 2], |c, p| [pick(c[0], p[0]), pick(c[1], p[1])])
    };
    let board = [corner(f64::min, f64::INFINITY), corner(f64::max, f64::NEG_INFINITY)];
    for Probe { name, along, block, smoothness } in probes(&sights, fit.camera.width, fit.camera.height, board) {
        let (name, smoothness) = (name.to_owned(), Some(smoothness));
        entries.push(Entry { spec: name.clone(), name, value: None, along: Some(along), block, smoothness });
        corrections.push(1.0);
    }
    let linearization = linearize(fit, &entries)?;
    let mut evidence: Vec<Evidence> = entries
        .par_iter()
        .enumerate()
        .map(|(index, entry)| weigh(&linearization, &sights, index, entry, corrections[index], tests))
        .collect();
    evidence.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
    Ok(Examination { evidence, linearization, tests, sights })
}

/// Score tests of some effects alone, with the constants that they have without a search.
///
/// # Errors
///
/// [`ScoreError`].
pub fn scores(fit: &Calibrated, register: &Register, names: &[&str]) -> Result<Vec<Score>, ScoreError> {
    let entries: Vec<Entry> = names.iter().filter_map(|n| effect_entry(register, n, (*n).to_owned())).collect();
    let linearization = linearize(fit, &entries)?;
    Ok((0..entries.len()).map(|i| linearization.score(i)).collect())
}

fn weigh(
    linearization: &Linearization,
    sights: &Sights,
    index: usize,
    entry: &Entry,
    correction: f64,
    tests: usize,
) -> Evidence {
    let score = linearization.score(index);
    let mut block = entry.block.clone();
    let change = if entry.along.is_some() { linearization.joint_change(&[index]) } else { score.change.clone() };
    block.theta.iter_mut().zip(change.iter()).for_each(|(t, d)| *t += d);
    let level = LEVEL / (tests as f64 * correction);
    Evidence {
        name: entry.name.clone(),
        spec: entry.spec.clone(),
        value: entry.value,
        reduced: reduced_spec(linearization, index, entry, &score),
        along: entry.along,
        p_value: (score.p_value * correction).min(1.0),
        gains: linearization.held_out_gain(&[index]),
        expected_size_mm: if entry.along.is_some() {
            visible_mm(linearization, index, &change, sights)
        } else {
            sights.size_mm(&block)
        },
        minimal_detectable_mm: minimal_detectable(linearization, sights, index, entry, level),
        score,
        block,
        index,
    }
}

/// Root mean square over the depth samples of what an effect does beside everything fitted, mm: a free function has parts
/// that D takes up, and these are nothing that is left.
fn visible_mm(linearization: &Linearization, index: usize, change: &DVector<f64>, sights: &Sights) -> f64 {
    let rows: usize = (0..linearization.cluster_count()).map(|c| linearization.cluster_rows(c)).sum();
    let of_noise = linearization.noncentrality(index, change, &[]) / rows.max(1) as f64;
    of_noise.sqrt() * sights.noise_mm
}

/// The spec with as many parameters free as the data see combinations: those that they see most of, one after the other.
fn reduced_spec(linearization: &Linearization, index: usize, entry: &Entry, score: &Score) -> Option<String> {
    let parameters = entry.block.parameters();
    if entry.along.is_some() || score.rank == 0 || score.rank == parameters.len() {
        return None;
    }
    // Pivoted Cholesky, scaled by typical sizes.
    let mut rest = linearization.visible_information(index);
    for (i, a) in parameters.iter().enumerate() {
        for (k, b) in parameters.iter().enumerate() {
            rest[(i, k)] *= a.scale * b.scale;
        }
    }
    let mut free = Vec::new();
    for _ in 0..score.rank {
        let pivot = (0..parameters.len()).max_by(|a, b| rest[(*a, *a)].total_cmp(&rest[(*b, *b)]))?;
        let column = rest.column(pivot).into_owned();
        let scale = column[pivot];
        rest -= &column * column.transpose() / scale;
        free.push(pivot);
    }
    let letter = |i: usize| parameters[i].name.chars().last();
    let letters: String = free.iter().filter_map(|i| letter(*i)).collect();
    // A subset is written with last letters: they have to be unambiguous.
    let named = (0..parameters.len()).filter(|i| letter(*i).is_some_and(|c| letters.contains(c))).count();
    let (name, constants) = entry.spec.split_once('@').map_or((entry.spec.as_str(), None), |(n, c)| (n, Some(c)));
    (named == free.len()).then(|| match constants {
        Some(constants) => format!("{name}:{letters}@{constants}"),
        None => format!("{name}:{letters}"),
    })
}

/// Score test and gains on left-out frames of an effect, with the constants that its spec has; `None` where it cannot be
/// linearised.
pub(super) fn weigh_alone(fit: &Calibrated, register: &Register, spec: &str) -> Option<(Score, Vec<f64>)> {
    let linearization = linearize(fit, &[effect_entry(register, spec, spec.to_owned())?]).ok()?;
    Some((linearization.score(0), linearization.held_out_gain(&[0])))
}

/// An added effect with a better value of its constant, searched beside everything that was fitted with the one it has;
/// `None` where it has no constant that is searched, has the best one, or has parameters held.
pub(super) fn refined(fit: &Calibrated, register: &Register, added: &Evidence) -> Option<Evidence> {
    if added.reduced.as_ref() == Some(&added.spec) {
        return None;
    }
    let without = Calibrated { camera: fit.camera.filtered(|b| b.name() != added.name), ..fit.clone() };
    let sights = Sights::of(fit);
    let effect = missing_effects(register, &without.camera, &sights).into_iter().find(|e| e.name == added.name)?;
    let values = if effect.afterwards.is_empty() {
        around(added.value.filter(|v| effect.refine && v.is_finite())?, &effect.values)
    } else {
        effect.afterwards.clone()
    };
    let with_spec = |v: &f64| Some((*v, effect_entry(register, effect.name, effect.spec(Some(*v)))?));
    let (values, entries): (Vec<f64>, Vec<Entry>) = values.iter().filter_map(with_spec).unzip();
    let linearization = linearize(&without, &entries).ok()?;
    let best = (0..entries.len())
        .max_by(|a, b| linearization.score(*a).statistic.total_cmp(&linearization.score(*b).statistic))?;
    let spec = entries[best].spec.clone();
    (spec != added.spec).then(|| Evidence { spec, value: Some(values[best]), ..added.clone() })
}

/// Directions that the minimal detectable size of an effect with several parameters is a median over.
const DIRECTIONS: usize = 25;

/// Median, over directions in the space of the effect's parameters that are drawn by their typical sizes, of the size that
/// is found with [`POWER`].
fn minimal_detectable(linearization: &Linearization, sights: &Sights, index: usize, entry: &Entry, level: f64) -> f64 {
    if entry.along.is_some() {
        return f64::NAN;
    }
    use rand_distr::{Distribution, StandardNormal};
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let parameters = entry.block.parameters().to_vec();
    let count = if parameters.len() == 1 { 1 } else { DIRECTIONS };
    let mut sizes: Vec<f64> = (0..count)
        .map(|_| {
            let draw = |scale: f64| {
                if count == 1 { scale } else { scale * Distribution::<f64>::sample(&StandardNormal, &mut rng) }
            };
            let direction = DVector::from_iterator(parameters.len(), parameters.iter().map(|p| p.scale).map(draw));
            let factor = linearization.detectable_factor(index, &direction, level, POWER);
            let mut block = entry.block.clone();
            block.theta.iter_mut().zip(direction.iter()).for_each(|(t, d)| *t += factor * d);
            sights.size_mm(&block)
        })
        .filter(|s| s.is_finite())
        .collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

    use super::*;
    use crate::calibrate::{CalibrateOptions, calibrate};
    use crate::simulated;

    /// Fields are laid over the image when the camera is assembled, which makes other pieces of them.
    #[test]
    fn a_field_is_scored_at_its_own_block() {
        let map = depthcal_simulate::Effect::new("smooth_map", 6.0).unwrap();
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[map], 5).frames(12);
        let capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        let fit = calibrate(&capture, &CalibrateOptions::default()).unwrap();
        let register = Register::builtin();
        let entry = |name: &str| effect_entry(&register, name, name.to_owned()).unwrap();
        let linearization = linearize(&fit, &[entry("range_offset"), entry("bspline")]).unwrap();
        let (offset, field) = (linearization.score(0), linearization.score(1));
        assert_eq!(offset.rank, 1);
        assert!(field.rank > 20, "{}", field.rank);
        assert!(field.statistic > 5.0 * field.rank as f64, "{} of rank {}", field.statistic, field.rank);
    }
}
