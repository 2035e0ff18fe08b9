//! Search for the modulation frequencies of a camera of which light goes astray: nothing in a dataset says them, and how the
//! light of the scene turns a pixel's phase depends on them.

use depthcal_io::ImageError;
use depthcal_model::{Covariate, Modulation, PieceSpec, Register};
use depthcal_solver::score::ScoreError;
use depthcal_statistics::mean_to_standard_error;
use rayon::prelude::*;
use thiserror::Error;

use super::candidate_blocks::{CandidateBlock, linearize};
use super::evidence::{Evidence, difference};
use super::thresholds::Thresholds;
use crate::calibrate::CalibratedCamera;
use crate::observe::frame_light::relit;
use crate::observe::{PixelRays, SampledFrame};

/// Frequencies of common time-of-flight cameras, MHz, and single ones between them: the effect of a set is nearly that of a
/// frequency about its mean.
const KNOWN_MHZ: [&[f64]; 12] = [
    &[16.0, 80.0, 120.0],
    &[10.0],
    &[15.0],
    &[20.0],
    &[30.0],
    &[40.0],
    &[50.0],
    &[60.0],
    &[80.0],
    &[60.0, 80.0],
    &[20.0, 100.0],
    &[120.0],
];
/// So many of the best sets are fitted.
const FITTED: usize = 4;
/// Frames, evenly over the capture, that are searched: their light is computed anew for every set.
const FRAMES: usize = 8;

/// The light of frames cannot be computed anew, or the problem not be evaluated with it.
#[derive(Debug, Error)]
pub(super) enum ModulationError {
    /// An image has become unreadable.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The problem cannot be evaluated.
    #[error(transparent)]
    Score(#[from] ScoreError),
}

/// The specs of an added effect with those known modulation frequencies that explain most, where any explains more than those
/// that it has; none for effects that do not depend on them.
///
/// # Errors
///
/// [`ModulationError`].
pub(super) fn promising_modulations(
    fit: &CalibratedCamera,
    register: &Register,
    added: &Evidence,
    thresholds: &Thresholds,
) -> Result<Vec<PieceSpec>, ModulationError> {
    let Some(piece) = added.block.piece().filter(|piece| piece.needs().contains(&Covariate::StrayLight)) else {
        return Ok(Vec::new());
    };
    let constants = piece.constants();
    let with_mhz = |mhz: &[f64]| {
        let plain = PieceSpec::new(added.name.as_str());
        constants.iter().zip(mhz).fold(plain, |spec, (constant, f)| spec.with(constant.name, *f))
    };
    let step = fit.capture.frames.len().div_ceil(FRAMES).max(1);
    let capture = fit.capture.subset(|i, _| i % step == 0);
    let camera = fit.camera.filtered(|block| block.name() != added.name);
    let without = CalibratedCamera { camera, capture, ..fit.clone() };
    let rays = PixelRays::new(&without.camera, &without.capture.target);
    let gains = |spec: &PieceSpec| gains(&without, &rays, register, spec);
    let tested = KNOWN_MHZ.iter().map(|mhz| {
        let spec = with_mhz(mhz);
        Ok((gains(&spec)?, spec))
    });
    let mut tested: Vec<(Vec<f64>, PieceSpec)> = tested.collect::<Result<_, ModulationError>>()?;
    tested.sort_by(|a, b| b.0.iter().sum::<f64>().total_cmp(&a.0.iter().sum::<f64>()));
    let present = gains(&added.spec)?;
    let explains_more = tested
        .first()
        .is_some_and(|(best, _)| mean_to_standard_error(&difference(best, &present)) > thresholds.distinguishing_t);
    let best = tested.into_iter().map(|(_, spec)| spec).take(if explains_more { FITTED } else { 0 });
    Ok(best.collect())
}

/// Gains of an effect with the frequencies of a spec over a fit without it, on frames whose light is computed for these.
fn gains(
    without: &CalibratedCamera,
    rays: &PixelRays<'_>,
    register: &Register,
    spec: &PieceSpec,
) -> Result<Vec<f64>, ModulationError> {
    let Some(candidate) = CandidateBlock::effect(register, spec.clone()) else { return Ok(Vec::new()) };
    let Some(modulation) = candidate.block.piece().map(|piece| Modulation::of(&piece.options())) else {
        return Ok(Vec::new());
    };
    let unit_mm = without.capture.depth_unit_mm.unwrap_or(1.0);
    let frames: Result<Vec<SampledFrame>, ImageError> =
        without.capture.frames.par_iter().map(|frame| relit(frame, modulation, unit_mm, rays)).collect();
    let mut lit = without.clone();
    lit.capture.frames = frames?;
    Ok(linearize(&lit, &[candidate])?.held_out_gain(&[0]))
}
