//! Effects of one camera, tested with all parameters of the rig free.
//!
//! The loop of one camera holds pinhole, lens and place of a camera without images. These come from its depth alone: what its
//! depth model lacks has bent them, and the constant that explains the rest best is not that of the effect. Here the problem of
//! the rig is linearised with every candidate held at its nominal values, so that a score is what pinhole, lens, place and poses
//! cannot take up.

use crate::calibrate::CalibratedCamera;
use crate::diagnose::Thresholds;
use crate::diagnose::candidates::{Effect, finer, missing_effects};
use crate::diagnose::observed_states::ObservedStates;
use depthcal_model::{Block, Camera, PieceSpec, Placement, Register};
use depthcal_solver::score::Linearization;
use depthcal_statistics::mean_to_standard_error;
use rayon::prelude::*;

use crate::adjust::adjustment::Adjustment;
use crate::adjust::state::{ParameterPrior, State};
use crate::diagnose::DiagnoseError;

/// Variants that are tested in one linearisation: enough to share its cost, few enough to share the variants among threads.
const VARIANTS_PER_LINEARIZATION: usize = 24;

/// An effect with the constant and the place in which it explains most.
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

/// One of the searched effects, by its number, in one variant.
type Variant = (usize, PieceSpec, Option<f64>, Placement);

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
    let effects = missing_effects(register, fit, &ObservedStates::of(fit));
    let problem = Problem { state, camera, register };
    let mut scores = problem.scored(&effects.iter().enumerate().flat_map(variants).collect::<Vec<_>>())?;
    let best = |scores: &[(Variant, f64)], i: usize| -> Option<(Variant, f64)> {
        let of_effect = scores.iter().filter(|((k, ..), _)| *k == i).cloned();
        of_effect.reduce(|a, b| if b.1 > a.1 { b } else { a })
    };
    let fine = effects.iter().enumerate().filter(|(_, effect)| effect.refine).flat_map(|(i, effect)| {
        let coarse =
            best(&scores, i).and_then(|((_, _, value, place), _)| Some((value.filter(|v| v.is_finite())?, place)));
        let (values, place) = coarse.map_or_else(Default::default, |(v, place)| (finer(&effect.values, v), place));
        values.into_iter().map(move |value| (i, effect.spec(Some(value), place), Some(value), place))
    });
    let fine: Vec<Variant> = fine.collect();
    scores.extend(problem.scored(&fine)?);
    let finals: Vec<Variant> =
        (0..effects.len()).filter_map(|i| best(&scores, i)).map(|(variant, _)| variant).collect();
    let count = finals.len() as f64;
    let mut evidence = problem.read(&finals, |linearization, number, (i, spec, ..)| {
        let score = linearization.score(number);
        let effect = &effects[*i];
        let searched = (effect.values.len().max(1) * effect.placements.len()) as f64;
        let correction = (searched / thresholds.values_per_test).max(1.0) * count;
        JointEvidence {
            spec: spec.clone(),
            statistic: score.statistic,
            p_value: (score.p_value * correction).min(1.0),
            gain_t: mean_to_standard_error(&linearization.held_out_gain(&[number])),
        }
    })?;
    evidence.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
    Ok(evidence)
}

/// All values of an effect's constant, in both places where its value depends on the place.
fn variants((number, effect): (usize, &Effect)) -> Vec<Variant> {
    let values = if effect.values.is_empty() { vec![None] } else { effect.values.iter().copied().map(Some).collect() };
    let places = if effect.shifts { &effect.placements[..] } else { &effect.placements[..1] };
    let own_form = places.iter().filter(|place| place.on.is_none());
    let of_place = |place: &Placement| {
        let variant = |value: &Option<f64>| (number, effect.spec(*value, *place), *value, *place);
        values.iter().map(variant).collect::<Vec<_>>()
    };
    own_form.flat_map(of_place).collect()
}

/// A fitted rig, one of whose cameras is examined.
struct Problem<'a> {
    state: &'a State,
    camera: usize,
    register: &'a Register,
}

impl Problem<'_> {
    fn scored(&self, variants: &[Variant]) -> Result<Vec<(Variant, f64)>, DiagnoseError> {
        self.read(variants, |linearization, number, variant| (variant.clone(), linearization.score(number).statistic))
    }

    /// Results of `read` for every variant, given a linearisation that has it as the candidate of this number.
    fn read<T: Send>(
        &self,
        variants: &[Variant],
        read: impl Fn(&Linearization, usize, &Variant) -> T + Sync,
    ) -> Result<Vec<T>, DiagnoseError> {
        let chunks: Result<Vec<Vec<T>>, DiagnoseError> = variants
            .par_chunks(VARIANTS_PER_LINEARIZATION)
            .map(|chunk| {
                let made = chunk.iter().filter_map(|v| Some((v, self.register.make(&v.1, None).ok()?)));
                let (tested, blocks): (Vec<&Variant>, Vec<Block>) = made.unzip();
                let (state, places) = with_candidates(self.state, self.camera, &blocks);
                let named = tested.iter().zip(&places).map(|(variant, place)| (variant.1.to_string(), *place, None));
                let linearization = Adjustment::of_state(&state, true)?.linearize_camera(self.camera, named)?;
                Ok(tested.iter().enumerate().map(|(number, variant)| read(&linearization, number, variant)).collect())
            })
            .collect();
        Ok(chunks?.into_iter().flatten().collect())
    }
}

/// The state whose camera has these blocks, held, before its own pieces, and their places among its blocks.
fn with_candidates(state: &State, camera: usize, candidates: &[Block]) -> (State, Vec<usize>) {
    let mut with = state.clone();
    let camera_state = &mut with.cameras[camera];
    // Effects act on the true depth, before the depth model: they come first.
    let mut pieces: Vec<Block> = candidates.iter().map(|block| block.clone().hold()).collect();
    let (pinhole, of_camera): (Vec<Block>, Vec<Block>) =
        camera_state.camera.blocks().iter().cloned().partition(|b| b.piece().is_none());
    let pinhole = pinhole.into_iter().next().unwrap_or_else(|| Block::pinhole(camera_state.camera.pinhole()));
    pieces.extend(of_camera);
    let (extended, mut places) =
        Camera::assemble(camera_state.camera.width, camera_state.camera.height, pinhole, pieces);
    // Priors name blocks by their numbers.
    let mut of_pieces = places.split_off(candidates.len()).into_iter();
    let of_pinhole = extended.blocks().iter().position(|b| b.piece().is_none()).unwrap_or(0);
    let moved: Vec<usize> = camera_state
        .camera
        .blocks()
        .iter()
        .map(|block| if block.piece().is_none() { of_pinhole } else { of_pieces.next().unwrap_or(of_pinhole) })
        .collect();
    camera_state.priors =
        camera_state.priors.iter().map(|prior| ParameterPrior { block: moved[prior.block], ..*prior }).collect();
    camera_state.camera = extended;
    (with, places)
}
