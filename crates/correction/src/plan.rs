//! What is done to measured depth, and in which order: the stages of a camera's correction.
//!
//! The depth pieces of a camera are tried one by one, because pieces are open to extension and no list of names could know
//! them: does the piece depend on the pixel, on the frame, on amplitude or angle of incidence; is it affine in depth or in
//! inverse depth? Each becomes a stage that is fast for what it is, in the reverse order of the chain; neighbours that are
//! Möbius maps become one. A camera with a piece that fits nowhere is corrected pixel by pixel.

use std::sync::Arc;

use depthcal_model::hook::HookKind;

use depthcal_model::{AnyPiece, Camera, Context};

use super::bins::Bins;
use super::curve::Curve;
use super::lookup::{ByAmplitude, ByCosine};
use super::moebius::{self, Matrix, Moebius, Tables};
use super::probe::{self, Probed, Shape};
use super::separable::Separable;
use super::simd::Isa;
use super::{FrameContext, pixel};

/// One step from measured to true depth.
#[derive(Debug, Clone)]
pub(super) enum Stage {
    /// The same in every frame.
    Moebius(Moebius),
    /// The same at all pixels.
    Curve(Curve),
    /// A factor that is linear between nodes of depth.
    Bins(Bins),
    /// Anything else that depends on pixel and depth.
    Separable(Separable),
    /// The same at all pixels of a frame, depending on its time or temperature.
    Frame(FramePiece),
    /// Depends on the amplitude of the pixel.
    Amplitude(ByAmplitude, FramePiece),
    /// Depends on the angle of incidence at the pixel.
    Cosine(ByCosine, FramePiece),
}

/// The stages of a camera.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub stages: Vec<Stage>,
    /// Largest deviation from the camera's own inverse that was found within the working range, beside that of f32, mm.
    pub error_mm: f64,
}

/// Most stages: as many coefficients per frame are kept without allocating.
const MOST_STAGES: usize = 16;

/// What a frame adds to the plan.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame<'a> {
    /// p, q, r of the stages that are the same at all pixels of this frame.
    alike: [[f32; 3]; MOST_STAGES],
    amplitudes: Option<&'a [u16]>,
    cosines: Option<&'a [f32]>,
}

/// A depth piece with its parameters.
#[derive(Debug, Clone)]
pub(super) struct FramePiece {
    piece: Arc<dyn AnyPiece>,
    theta: Vec<f64>,
    shape: Shape,
}

impl FramePiece {
    /// Measured inverse depth (1/mm) of a true one.
    pub fn measured(&self, context: &Context, [x, y]: [f64; 2], cosine: f64, rho: f64) -> f64 {
        let mut out = [0.0];
        self.piece.evaluate(&self.theta, &[x, y, rho, cosine], std::slice::from_ref(context), &mut out);
        out[0]
    }

    /// Its inverse in depth, where it is affine in depth or in inverse depth.
    fn inverse(&self, context: &Context, ray: [f64; 2], cosine: f64) -> Matrix {
        let measured = |rho: f64| self.measured(context, ray, cosine, rho);
        match self.shape {
            Shape::AffineInInverse => {
                let [a, b] = probe::affine_in_inverse(measured);
                [b, 0.0, -a, 1.0]
            }
            _ => {
                let [m, c] = probe::affine_in_depth(measured);
                [1.0, -c, 0.0, m]
            }
        }
    }

    fn affine_in_depth(&self, context: &Context, cosine: f64) -> [f64; 2] {
        probe::affine_in_depth(|rho| self.measured(context, [0.0; 2], cosine, rho))
    }
}

impl Plan {
    /// The stages of a camera whose rays are known and the same at every depth; `None` where a piece fits nowhere.
    pub fn of_pieces(camera: &Camera, rays: &[[f64; 2]]) -> Option<Self> {
        let pieces: Vec<(FramePiece, Probed)> = camera
            .blocks()
            .iter()
            .filter(|block| block.hook() == HookKind::Depth)
            .filter_map(|block| {
                let piece = block.piece()?.clone();
                let mut piece = FramePiece { piece, theta: block.theta.clone(), shape: Shape::Other };
                let probed =
                    probe::piece(camera, rays, |context, ray, cosine, rho| piece.measured(context, ray, cosine, rho));
                piece.shape = probed.shape;
                Some((piece, probed))
            })
            .collect();
        let width = camera.width;
        let context = |index: usize| Context { pixel: pixel(index, width), ..Context::default() };
        let mut stages = Vec::new();
        let mut knows_rays = false;
        let mut rest = pieces.as_slice();
        while let Some((piece, probed)) = rest.last() {
            // The pieces at the end of the chain that are static Möbius maps.
            let run = rest.iter().rev().take_while(|(_, p)| p.is_static() && p.shape != Shape::Other).count();
            if run > 0 {
                let (before, run) = rest.split_at(rest.len() - run);
                let matrix = |index: usize| {
                    let inverses = run.iter().map(|(piece, _)| piece.inverse(&context(index), rays[index], 1.0));
                    inverses.fold([1.0, 0.0, 0.0, 1.0], moebius::compose)
                };
                stages.push(Stage::Moebius(Moebius::new(matrix, rays)));
                knows_rays = true;
                rest = before;
                continue;
            }
            let piece = piece.clone();
            stages.push(if probed.is_static() && !probed.pixel {
                Stage::Curve(Curve::new(|rho| piece.measured(&Context::default(), [0.0; 2], 1.0, rho)))
            } else if probed.is_static() {
                let measured = |index: usize, rho: f64| piece.measured(&context(index), rays[index], 1.0, rho);
                let usable = |index: usize| !rays[index][0].is_nan();
                knows_rays = true;
                let (samples, pixels) = (probe::samples(camera, rays), rays.len());
                match Bins::new(&piece.piece.options(), &measured, &samples, pixels, usable) {
                    Some(bins) => Stage::Bins(bins),
                    None => Stage::Separable(Separable::new(&measured, &samples, pixels, usable)?),
                }
            } else if probed.pixel || probed.shape == Shape::Other {
                return None;
            } else if probed.frame && !probed.amplitude && !probed.incidence {
                Stage::Frame(piece)
            } else if probed.shape == Shape::AffineInDepth && probed.amplitude && !probed.frame && !probed.incidence {
                let affine = |amplitude: f64| piece.affine_in_depth(&Context { amplitude, ..Context::default() }, 1.0);
                Stage::Amplitude(ByAmplitude::over_amplitude(affine), piece)
            } else if probed.shape == Shape::AffineInDepth && probed.incidence && !probed.frame && !probed.amplitude {
                let affine = |cosine: f64| piece.affine_in_depth(&Context::default(), cosine);
                Stage::Cosine(ByCosine::over_cosine(affine), piece)
            } else {
                return None;
            });
            rest = &rest[..rest.len() - 1];
        }
        // Pixels without a ray have no true depth, whatever the pieces say.
        if !knows_rays && (stages.is_empty() || rays.iter().any(|ray| ray[0].is_nan())) {
            stages.push(Stage::Moebius(Moebius::new(|_| [1.0, 0.0, 0.0, 1.0], rays)));
        }
        (stages.len() <= MOST_STAGES).then_some(Self { stages, error_mm: 0.0 })
    }

    /// The one stage of a camera whose rays depend on the depth: its whole chain as a function of pixel and depth.
    pub fn of_chain(camera: &Camera, samples: &[usize], usable: impl Fn(usize) -> bool + Sync) -> Option<Self> {
        let measured = |index: usize, rho: f64| {
            let context = Context { pixel: pixel(index, camera.width), ..Context::default() };
            let ray = camera.ray(camera.image_pixel(&context), rho);
            ray.map_or(f64::NAN, |ray| camera.measured_inverse_depth(&context, ray, 1.0, rho))
        };
        let separable = Separable::new(&measured, samples, camera.width * camera.height, usable)?;
        Some(Self { stages: vec![Stage::Separable(separable)], error_mm: 0.0 })
    }

    /// The Möbius map that is all of the plan, where it is.
    pub fn only_moebius(&self) -> Option<&Moebius> {
        match self.stages.as_slice() {
            [Stage::Moebius(map)] => Some(map),
            _ => None,
        }
    }

    /// What the plan needs of a frame.
    pub fn frame<'a>(&self, context: &FrameContext<'a>, cosines: Option<&'a [f32]>) -> Frame<'a> {
        let of_frame = context.of_frame();
        let mut alike = [[0.0; 3]; MOST_STAGES];
        for (stage, alike) in self.stages.iter().zip(&mut alike) {
            if let Stage::Frame(piece) | Stage::Amplitude(_, piece) | Stage::Cosine(_, piece) = stage {
                *alike = moebius::coefficients(piece.inverse(&of_frame, [0.0; 2], 1.0)).map(|k| k as f32);
            }
        }
        Frame { alike, amplitudes: context.amplitude.map(|image| image.data.as_slice()), cosines }
    }

    /// Measured to true depth (mm) of neighbouring pixels from `first` on, in place. 0 stays 0; NaN where a stage does not
    /// know the answer, or there is none.
    #[inline(always)]
    pub fn correct<I: Isa>(&self, isa: I, frame: &Frame<'_>, first: usize, z: &mut [f32]) {
        let pixels = first..first + z.len();
        for (stage, alike) in self.stages.iter().zip(&frame.alike) {
            match stage {
                Stage::Moebius(map) => moebius::correct(isa, map.tables(), map.slices(first, z.len()), z),
                Stage::Curve(curve) => curve.correct(isa, z),
                Stage::Bins(bins) => bins.correct(isa, first, z),
                Stage::Separable(separable) => separable.correct(isa, first, z),
                Stage::Frame(_) => moebius::correct_alike(isa, *alike, z),
                Stage::Amplitude(table, _) => match frame.amplitudes {
                    Some(amplitudes) => table.correct(&amplitudes[pixels.clone()], z),
                    None => moebius::correct_alike(isa, *alike, z),
                },
                Stage::Cosine(table, _) => match frame.cosines {
                    Some(cosines) => table.correct(&cosines[pixels.clone()], z),
                    None => moebius::correct_alike(isa, *alike, z),
                },
            }
        }
    }

    /// p and the coefficients of r over the rays, where those are all of the plan.
    #[inline(always)]
    pub fn map_on_rays(&self) -> Option<(f32, [f32; 3])> {
        let map = self.only_moebius().filter(|map| map.tables() == Tables::Pole)?;
        Some((map.p_everywhere, map.r_from_ray?))
    }

    /// [`Plan::correct`] where the rays of the pixels are at hand.
    #[inline(always)]
    pub fn correct_on_rays<I: Isa>(&self, isa: I, frame: &Frame<'_>, first: usize, rays: [&[f32]; 2], z: &mut [f32]) {
        match self.map_on_rays() {
            Some((p, d)) => moebius::correct_on_rays(isa, p, d, rays, z),
            None => self.correct(isa, frame, first, z),
        }
    }
}
