//! Candidates as held blocks of a fitted camera's chain, and the linearisation that score tests are made from.

use std::sync::Arc;

use depthcal_model::hook::HookKind;
use depthcal_model::{AnyPiece, Block, Camera, Context, Of, Options, Parameter, PieceSpec, Placement, Register};
use depthcal_solver::score::{Linearization, ScoreError};
use nalgebra::DMatrix;

use super::free_functions::Along;
use crate::adjust::adjustment::Adjustment;
use crate::adjust::smoothness_prior::precision_of_smooth_functions;
use crate::calibrate::CalibratedCamera;
use crate::observe::{CameraFrames, SampledFrame};

/// An effect or a free function whose parameters could be released.
pub(super) struct CandidateBlock {
    /// Name of the effect or of the free function.
    pub name: String,
    /// Its specification, with the constant; the name alone for free functions.
    pub spec: PieceSpec,
    /// Value of the constant, where it was searched.
    pub value: Option<f64>,
    /// Covariate of a free function; `None` for effects.
    pub along: Option<Along>,
    /// The block at its nominal parameters.
    pub block: Block,
    /// Precision matrix of the smoothness prior, where the parameters need one.
    pub smoothness: Option<DMatrix<f64>>,
}

impl CandidateBlock {
    /// An effect of the register; `None` where the spec is wrong.
    pub fn effect(register: &Register, spec: PieceSpec) -> Option<Self> {
        let block = register.make(&spec, None).ok()?;
        let smoothness = precision_of_smooth_functions(&block);
        Some(Self { name: spec.name.clone(), spec, value: None, along: None, block, smoothness })
    }
}

/// A fitted camera, alone or among others, whose candidates are tested.
pub(super) trait Fit: Sync {
    /// Says that the problem cannot be evaluated.
    type Error: Send;

    /// Linearises the problem with all candidates held at their nominal values. Candidates are numbered as given.
    ///
    /// # Errors
    ///
    /// Where the problem cannot be evaluated.
    fn linearize(&self, candidates: &[CandidateBlock]) -> Result<Linearization, Self::Error>;

    /// This fit with every so many samples of the camera's frames only.
    fn thinned(&self, step: usize) -> Self;
}

impl Fit for CalibratedCamera {
    type Error = ScoreError;

    fn linearize(&self, candidates: &[CandidateBlock]) -> Result<Linearization, ScoreError> {
        linearize(self, candidates)
    }

    fn thinned(&self, step: usize) -> Self {
        let mut thinned = self.clone();
        thin(&mut thinned.capture, step);
        thinned
    }
}

/// Leaves every so many samples of the frames of a capture.
pub(super) fn thin(capture: &mut CameraFrames<SampledFrame>, step: usize) {
    for frame in &mut capture.frames {
        frame.samples = Arc::new(frame.samples.iter().step_by(step).copied().collect());
    }
}

/// Linearises the problem of a fit with all candidates held at their nominal values. Candidates are numbered as given.
///
/// # Errors
///
/// [`ScoreError`] where the problem cannot be evaluated.
pub(super) fn linearize(fit: &CalibratedCamera, candidates: &[CandidateBlock]) -> Result<Linearization, ScoreError> {
    linearize_with(fit, candidates, true)
}

/// [`linearize`] of the markers alone, without depth.
///
/// # Errors
///
/// [`ScoreError`] where the problem cannot be evaluated.
pub(super) fn linearize_images(
    fit: &CalibratedCamera,
    candidates: &[CandidateBlock],
) -> Result<Linearization, ScoreError> {
    linearize_with(fit, candidates, false)
}

fn linearize_with(
    fit: &CalibratedCamera,
    candidates: &[CandidateBlock],
    with_depth: bool,
) -> Result<Linearization, ScoreError> {
    let (camera, places) = with_pieces(&fit.camera, candidates.iter().map(|c| c.block.clone().hold()));
    let adjustment = Adjustment::new(&fit.capture, &camera, &fit.noise, with_depth).with_prior(fit.prior.as_deref());
    let held = candidates.iter().zip(places);
    adjustment.linearize(held.map(|(c, place)| (c.spec.to_string(), place, c.smoothness.clone())))
}

/// A camera with further pieces before its own, and the places of all pieces among its blocks, those of the further ones first.
pub(super) fn with_pieces(camera: &Camera, further: impl Iterator<Item = Block>) -> (Camera, Vec<usize>) {
    // Effects act on the true depth, before the depth model: they come first.
    let mut pieces: Vec<Block> = further.collect();
    let (pinhole, with_piece): (Vec<Block>, Vec<Block>) =
        camera.blocks().iter().cloned().partition(|b| b.piece().is_none());
    pieces.extend(with_piece);
    let pinhole = pinhole.into_iter().next().unwrap_or_else(|| Block::pinhole([f64::NAN; 5]));
    Camera::assemble(camera.width, camera.height, pinhole, pieces)
}

/// A camera with two held pieces that add their parameter to inverse depth, before the depth model and behind it, and their
/// places among its blocks.
pub(super) fn with_probes(camera: &Camera) -> (Camera, [usize; 2]) {
    let blocks = Of::ALL.map(|of| Block::new(Arc::new(Probe::new(of)) as Arc<dyn AnyPiece>).hold());
    let (camera, places) = with_pieces(camera, blocks.into_iter());
    (camera, [places[0], places[1]])
}

/// ρ + e: shows how residuals change with inverse depth in a place.
#[derive(Debug)]
struct Probe {
    of: Of,
    parameters: [Parameter; 1],
}

impl Probe {
    fn new(of: Of) -> Self {
        Self { of, parameters: [Parameter::new("e", "1/mm", 0.0, 1e-6)] }
    }
}

impl AnyPiece for Probe {
    fn name(&self) -> &'static str {
        "probe"
    }
    fn source(&self) -> &'static str {
        "a constant"
    }
    fn hook(&self) -> HookKind {
        HookKind::Depth
    }
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }
    fn options(&self) -> Options {
        Options::new()
    }
    fn placement(&self) -> Placement {
        Placement { of: self.of, on: None }
    }
    fn evaluate(&self, theta: &[f64], states: &[f64], _: &[Context], out: &mut [f64]) {
        states.chunks_exact(4).zip(out).for_each(|(state, out)| *out = state[2] + theta[0]);
    }
    fn linearize(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        d_theta: Option<&mut [f64]>,
    ) {
        self.evaluate(theta, states, contexts, out);
        d_state.chunks_exact_mut(4).for_each(|d| d.copy_from_slice(&[0.0, 0.0, 1.0, 0.0]));
        if let Some(d_theta) = d_theta {
            d_theta.fill(1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Candidates at every hook, in an order other than the chain's; fields are laid over the image anew and are found none
    /// the less.
    #[test]
    fn candidates_are_found_in_the_chain() {
        let register = Register::builtin();
        let block = |name: &str| register.block(name, None).unwrap();
        let of_camera = ["brown_conrady", "cyclic_depth", "projective", "print_scale"].map(block);
        let camera = Camera::new(640, 480, [500.0, 500.0, 320.0, 240.0, 0.0], of_camera.to_vec());
        let names = ["range_offset", "thin_prism", "bspline", "board_bow", "depth_registration", "tilted_sensor"];
        let (extended, places) = with_pieces(&camera, names.map(|name| block(name).hold()).into_iter());
        assert_eq!(extended.blocks().len(), camera.blocks().len() + names.len());
        let placed: Vec<&str> = places.iter().map(|p| extended.blocks()[*p].name()).collect();
        let of_camera = camera.blocks().iter().filter(|block| block.piece().is_some()).map(Block::name);
        assert_eq!(placed, names.into_iter().chain(of_camera).collect::<Vec<_>>());
        assert!(places[..names.len()].iter().all(|p| extended.blocks()[*p].free.iter().all(|free| !free)));
    }
}
