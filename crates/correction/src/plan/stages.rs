//! The sequence of stages that takes measured depth to true depth.
//!
//! Every depth piece of a camera is classified (`classify`) and becomes a stage of the fastest kind that can invert it.
//! Stages run in the reverse order of the chain; neighbouring Möbius maps are composed into one. Where a piece fits no
//! kind of stage there is no plan, and the camera inverts every pixel on its own.

use depthcal_model::hook::HookKind;
use depthcal_model::{Camera, Context};

use super::classify::{self, PieceClass, Shape};
use super::covariate_table::{ByAmplitude, ByCosine};
use super::curve::Curve;
use super::moebius::{self, IDENTITY, Moebius, Tables};
use super::piece::DepthPiece;
use super::piecewise_factor::PiecewiseFactor;
use super::separable::Separable;
use super::stray_light::StrayLight;
use crate::conventions::pixel;
use crate::frame_context::FrameContext;
use crate::light::FrameLight;
use crate::simd::Isa;

/// Bound on the sum of the roundings of f32 on the way through the stages, as a share of depth.
pub(crate) const F32_ROUNDING: f32 = 2.5e-7;

/// A step on the way from measured to true depth.
#[derive(Debug, Clone)]
pub(crate) enum Stage {
    /// A Möbius map at every pixel, the same in every frame.
    Moebius(Moebius),
    /// A function of depth, the same at all pixels and in every frame.
    Curve(Curve),
    /// At every pixel, a factor that is linear between nodes of depth.
    PiecewiseFactor(PiecewiseFactor),
    /// Any other function of pixel and depth, the same in every frame.
    Separable(Separable),
    /// A Möbius map, the same at all pixels of a frame, that depends on the frame's time, temperature or another of
    /// its quantities.
    Frame(DepthPiece),
    /// An affine function of depth that depends on the pixel's amplitude.
    Amplitude(ByAmplitude, DepthPiece),
    /// An affine function of depth that depends on the angle of incidence at the pixel.
    Cosine(ByCosine, DepthPiece),
    /// Stray light, which depends on the light of the whole frame; nothing where that is not known.
    StrayLight(StrayLight),
}

/// The stages of a camera, in the order in which they are applied to measured depth.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    stages: Vec<Stage>,
    /// Largest deviation from the camera's own inverse at sampled pixels within the working range, less what
    /// [`F32_ROUNDING`] explains, mm.
    pub error_mm: f64,
}

/// Most stages of a plan. Coefficients of a frame are kept in an array of this length, so that a frame allocates
/// nothing.
const MOST_STAGES: usize = 16;

/// Data of one frame that the stages read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrameInputs<'a> {
    /// p, q, r of the Möbius map of each stage that depends on the frame as a whole.
    uniform: [[f32; 3]; MOST_STAGES],
    amplitudes: Option<&'a [u16]>,
    cosines: Option<&'a [f32]>,
    light: Option<&'a FrameLight>,
}

impl Plan {
    /// The stages of a camera whose rays, given for all pixels, are the same at every depth. `None` where a piece fits
    /// no kind of stage.
    pub fn of_pieces(camera: &Camera, rays: &[[f64; 2]]) -> Option<Self> {
        let pieces: Vec<(DepthPiece, PieceClass)> = camera
            .blocks()
            .iter()
            .filter(|block| block.hook() == HookKind::Depth)
            .filter_map(|block| {
                let piece = block.piece()?.clone();
                let mut piece = DepthPiece { piece, theta: block.theta.clone(), shape: Shape::Other };
                let class = classify::piece(camera, rays, |observations| piece.measured_of(observations));
                piece.shape = class.shape;
                Some((piece, class))
            })
            .collect();
        let width = camera.width;
        let context = |index: usize| Context { pixel: pixel(index, width), ..Context::default() };
        let mut stages = Vec::new();
        // Whether a stage makes pixels without a ray NaN.
        let mut marks_pixels_without_ray = false;
        let mut remaining = pieces.as_slice();
        while let Some((piece, class)) = remaining.last() {
            // The number of pieces at the end of the chain that are static Möbius maps.
            let run = remaining.iter().rev().take_while(|(_, c)| c.is_static() && c.shape != Shape::Other).count();
            if run > 0 {
                let (before, run) = remaining.split_at(remaining.len() - run);
                let matrices = |indices: &[usize]| {
                    let mut matrices = vec![IDENTITY; indices.len()];
                    for (piece, _) in run {
                        let inverses = piece.inverses(indices.iter().map(|index| (context(*index), rays[*index])));
                        for (matrix, inverse) in matrices.iter_mut().zip(inverses) {
                            *matrix = moebius::compose(*matrix, inverse);
                        }
                    }
                    matrices
                };
                stages.push(Stage::Moebius(Moebius::new(matrices, rays)));
                marks_pixels_without_ray = true;
                remaining = before;
                continue;
            }
            if class.surroundings {
                return None;
            }
            let piece = piece.clone();
            stages.push(if class.light {
                if class.frame || class.amplitude || class.incidence {
                    return None;
                }
                Stage::StrayLight(StrayLight::new(&piece, width, rays)?)
            } else if class.is_static() && !class.pixel {
                Stage::Curve(Curve::new(|rho| piece.measured(&Context::default(), [0.0; 2], 1.0, rho)))
            } else if class.is_static() {
                let measured = |index: usize, rho: f64| piece.measured(&context(index), rays[index], 1.0, rho);
                let usable = |index: usize| !rays[index][0].is_nan();
                marks_pixels_without_ray = true;
                let (samples, pixels) = (classify::samples(camera, rays), rays.len());
                match PiecewiseFactor::new(&piece.piece.options(), &measured, &samples, pixels, usable) {
                    Some(factor) => Stage::PiecewiseFactor(factor),
                    None => Stage::Separable(Separable::new(&measured, &samples, pixels, usable)?),
                }
            } else if class.pixel || class.shape == Shape::Other {
                return None;
            } else if class.frame && !class.amplitude && !class.incidence {
                Stage::Frame(piece)
            } else if class.shape == Shape::AffineInDepth && class.amplitude && !class.frame && !class.incidence {
                let affine = |amplitude: f64| piece.affine_in_depth(&Context { amplitude, ..Context::default() }, 1.0);
                Stage::Amplitude(ByAmplitude::over_amplitude(affine), piece)
            } else if class.shape == Shape::AffineInDepth && class.incidence && !class.frame && !class.amplitude {
                let affine = |cosine: f64| piece.affine_in_depth(&Context::default(), cosine);
                Stage::Cosine(ByCosine::over_cosine(affine), piece)
            } else {
                return None;
            });
            remaining = &remaining[..remaining.len() - 1];
        }
        // Pixels without a ray have no true depth, whatever the value of the pieces there.
        if !marks_pixels_without_ray && (stages.is_empty() || rays.iter().any(|ray| ray[0].is_nan())) {
            stages.push(Stage::Moebius(Moebius::new(|indices| vec![IDENTITY; indices.len()], rays)));
        }
        (stages.len() <= MOST_STAGES).then_some(Self { stages, error_mm: 0.0 })
    }

    /// The single stage of a camera whose rays depend on depth: its whole chain as a function of pixel and depth.
    /// `samples` are the pixels that the stage is built from, `usable` tells which pixels have a ray. `None` where the
    /// function is not separable.
    pub fn of_chain(camera: &Camera, samples: &[usize], usable: impl Fn(usize) -> bool + Sync) -> Option<Self> {
        let measured = |index: usize, rho: f64| {
            let context = Context { pixel: pixel(index, camera.width), ..Context::default() };
            let ray = camera.ray(camera.image_pixel(&context), rho);
            ray.map_or(f64::NAN, |ray| camera.measured_inverse_depth(&context, ray, 1.0, rho))
        };
        let separable = Separable::new(&measured, samples, camera.width * camera.height, usable)?;
        Some(Self { stages: vec![Stage::Separable(separable)], error_mm: 0.0 })
    }

    /// Names of the kinds of stages, in the order in which they are applied.
    #[cfg(test)]
    pub fn kinds(&self) -> Vec<&'static str> {
        let kind = |stage: &Stage| match stage {
            Stage::Moebius(_) => "moebius",
            Stage::Curve(_) => "curve",
            Stage::PiecewiseFactor(_) => "piecewise_factor",
            Stage::Separable(_) => "separable",
            Stage::Frame(_) => "frame",
            Stage::Amplitude(..) => "amplitude",
            Stage::Cosine(..) => "cosine",
            Stage::StrayLight(_) => "stray_light",
        };
        self.stages.iter().map(kind).collect()
    }

    /// The Möbius map, where the plan has this single stage.
    pub fn only_moebius(&self) -> Option<&Moebius> {
        match self.stages.as_slice() {
            [Stage::Moebius(map)] => Some(map),
            _ => None,
        }
    }

    /// Data of a frame for the stages. `cosines` are those of the angle of incidence, one per pixel; 1 where they are not given.
    /// `light` is that of the frame, where it is known.
    pub fn inputs<'a>(
        &self,
        context: &FrameContext<'a>,
        cosines: Option<&'a [f32]>,
        light: Option<&'a FrameLight>,
    ) -> FrameInputs<'a> {
        let of_frame = context.of_frame();
        let mut uniform = [[0.0; 3]; MOST_STAGES];
        for (stage, uniform) in self.stages.iter().zip(&mut uniform) {
            if let Stage::Frame(piece) | Stage::Amplitude(_, piece) | Stage::Cosine(_, piece) = stage {
                *uniform = moebius::coefficients(piece.inverse(&of_frame, [0.0; 2], 1.0)).map(|k| k as f32);
            }
        }
        FrameInputs { uniform, amplitudes: context.amplitude.map(|image| image.data), cosines, light }
    }

    /// Takes measured to true depth (mm), in place, for consecutive pixels from `first` on. 0 stays 0; NaN where the
    /// tables of a stage do not reach or there is no true depth.
    #[inline(always)]
    pub fn correct<I: Isa>(&self, isa: I, inputs: &FrameInputs<'_>, first: usize, z: &mut [f32]) {
        let pixels = first..first + z.len();
        for (stage, uniform) in self.stages.iter().zip(&inputs.uniform) {
            match stage {
                Stage::Moebius(map) => moebius::correct(isa, map.tables(), map.coefficients(first, z.len()), z),
                Stage::Curve(curve) => curve.correct(z),
                Stage::PiecewiseFactor(factor) => factor.correct(isa, first, z),
                Stage::Separable(separable) => separable.correct(isa, first, z),
                Stage::Frame(_) => moebius::correct_uniform(isa, *uniform, z),
                Stage::Amplitude(table, _) => match inputs.amplitudes {
                    Some(amplitudes) => table.correct(&amplitudes[pixels.clone()], z),
                    None => moebius::correct_uniform(isa, *uniform, z),
                },
                Stage::Cosine(table, _) => match inputs.cosines {
                    Some(cosines) => table.correct(&cosines[pixels.clone()], z),
                    None => moebius::correct_uniform(isa, *uniform, z),
                },
                Stage::StrayLight(stage) => {
                    if let Some(light) = inputs.light {
                        stage.correct(light, first, z);
                    }
                }
            }
        }
    }

    /// p, and (dx, dy, dz) of r = dx x + dy y + dz over the rays, where the plan is a single Möbius map of this form:
    /// the projective model.
    #[inline(always)]
    pub fn map_on_rays(&self) -> Option<(f32, [f32; 3])> {
        let map = self.only_moebius().filter(|map| map.tables() == Tables::Pole)?;
        Some((map.p_everywhere, map.r_from_ray?))
    }

    /// [`Plan::correct`] given x and y of the pixels' rays, from which the projective model is computed without its
    /// table.
    #[inline(always)]
    pub fn correct_on_rays<I: Isa>(
        &self,
        isa: I,
        inputs: &FrameInputs<'_>,
        first: usize,
        rays: [&[f32]; 2],
        z: &mut [f32],
    ) {
        match self.map_on_rays() {
            Some((p, d)) => moebius::correct_on_rays(isa, p, d, rays, z),
            None => self.correct(isa, inputs, first, z),
        }
    }
}
