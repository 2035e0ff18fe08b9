//! The measurement model of depthcal: a camera is a chain of small pieces, and everything that may be wrong with it is
//! one more piece.
//!
//! Camera frame as in OpenCV: x right, y down, z forward. Millimetres, pixels, radians, seconds, degrees Celsius; pixel
//! centres at integer coordinates. Depth is the z coordinate, not the range; inverse depth ρ = 1/z in 1/mm.
//!
//! Invariants: this crate knows no solver, no file and no image, and does not allocate per observation.

pub mod board;
pub mod camera;
pub mod chain;
pub mod depth;
pub mod field;
pub mod hook;
pub mod lens;
mod piece;
pub mod pixel;
pub mod register;
mod scalar;
pub mod target;

pub use camera::{Block, Camera, CameraError};
pub use piece::{AnyPiece, Context, Covariate, Parameter, Piece, Role, SURROUND_PX, Scan, ScanKind, erase};
pub use register::{Register, RegisterError};
pub use scalar::Scalar;
pub use target::{Pattern, Target};
