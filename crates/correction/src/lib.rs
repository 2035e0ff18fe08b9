//! Correction of depth images and point clouds with a calibrated depth camera.
//!
//! The camera is a chain of pieces that maps a true point to the measured depth z_m at a pixel. A [`Corrector`] inverts
//! that chain: measured depth becomes the true depth z on the pixel's true ray.
//!
//! ```
//! use depthcal_correction::{Corrector, FrameContext};
//! use depthcal_io::DepthImage;
//! use depthcal_model::{Camera, Register};
//!
//! // A camera that measures depth 2 % too small: ρ_m = 1.02 ρ, with inverse depth ρ = 1/z.
//! let mut projective = Register::builtin().block("projective", None)?;
//! projective.theta = vec![0.0, 0.0, 0.0, 1.02];
//! let camera = Camera::new(4, 3, [500.0, 500.0, 1.5, 1.0, 0.0], vec![projective]);
//! let corrector = Corrector::new(&camera)?;
//!
//! let measured = DepthImage { width: 4, height: 3, data: vec![1000; 12] };
//! let mut corrected = measured.clone();
//! let summary = corrector.correct_u16(&measured, 1.0, &FrameContext::default(), &mut corrected)?;
//! assert_eq!((summary.corrected, corrected.data[0]), (12, 1020));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # How a frame is corrected
//!
//! What does not change from frame to frame is computed once, by [`Corrector::new`]: the true ray of every pixel, and
//! the inverse of the depth pieces as a sequence of stages with tables. A frame then takes one pass through these
//! stages, in bands that run on the threads of the current rayon pool. Each band is worked off in chunks that fit the
//! first-level cache, by loops compiled for several instruction sets. A pixel that the tables do not cover is inverted
//! by [`depthcal_model::Camera`] in f64, against which the tables are also checked when they are built.
//!
//! # Conventions
//!
//! Images are row-major, one value per pixel of the calibrated resolution. Depth is z, not range. Lengths are in mm,
//! 16-bit depth in steps of a given size (`unit_mm`). The camera frame is that of OpenCV: x right, y down, z forward.
//!
//! - Corrected depth stays at its pixel of the depth image. Pieces at the hook `pixel` change the ray that belongs to a
//!   depth pixel; no value is moved to another pixel.
//! - Invalid depth stays invalid: 0 and 65535, which cameras write where they measure nothing, and for f32 also negative,
//!   infinite and NaN, become 0 in images and NaN in points.
//! - A pixel without a ray, or with a depth that the model cannot invert, becomes invalid and is counted
//!   ([`CorrectionSummary::not_correctable`]).
//! - A result beyond the range of its type is set to the nearest end of that range. It never wraps.
//!
//! # Where things are
//!
//! | module | what it is |
//! |---|---|
//! | `corrector` | [`Corrector`]: the public functions, which check their arguments |
//! | `prepared` | a camera with everything that does not change from frame to frame |
//! | `plan` | the stages that invert the depth pieces, and how a stage is chosen for a piece |
//! | `light` | the light of a frame that the lens spreads over all pixels, for effects that depend on it |
//! | `rays` | [`Rays`]: true rays of all pixels |
//! | `pass` | a frame on its way through the stages |
//! | `depth_u16`, `points` | faster loops for the usual case: 16-bit depth corrected by a single Möbius map |
//! | `register` | depth in another camera's image, and colours of depth pixels |
//! | `remap` | [`Remap`]: undistorted images |
//! | `uncertainty` | standard deviation of corrected depth, and where the calibration is supported |
//! | `bands`, `simd` | threads and instruction sets |

mod bands;
mod conventions;
mod corrector;
mod depth_u16;
mod error;
mod frame_context;
mod light;
mod needs;
mod pass;
mod plan;
mod points;
mod prepared;
mod rays;
mod register;
mod remap;
mod simd;
mod summary;
#[cfg(test)]
mod tests;
mod uncertainty;

pub use corrector::Corrector;
pub use error::CorrectorError;
pub use frame_context::{AmplitudeImage, FrameContext};
pub use needs::Needs;
pub use points::PointsMut;
pub use rays::Rays;
pub use register::{RegisteredDepth, colours_of, depth_into};
pub use remap::{Remap, Texel};
pub use summary::CorrectionSummary;
pub use uncertainty::Supported;
