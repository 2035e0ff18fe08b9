//! The measurement model of depthcal: a camera is a chain of small pieces, and everything that may be wrong with it is
//! one more piece.
//!
//! ```text
//! board point P ──board──▶ P' ──pose──▶ X = R P' + t ──project──▶ (x, y, ρ) = (X/Z, Y/Z, 1/Z)
//!     (x, y) ──lens──▶ (x', y') ──pinhole──▶ (u, v) ──pixel──▶ (u, v) of the depth image
//!     (x, y, ρ) ──depth──▶ ρ_m,   z_m = 1/ρ_m
//! ```
//!
//! A [`Piece`] is one map with its parameters, written once over any [`Scalar`]; it says what it is, what its parameters mean
//! and what it needs to know of an observation. The [`Register`] finds pieces by name, from text ([`PieceSpec`],
//! [`ModelSpec`]); a [`Camera`] is pieces with values ([`Block`]); its [`chain::Chain`] predicts pixels and depths with all
//! Jacobians.
//!
//! Camera frame as in OpenCV: x right, y down, z forward. Millimetres, pixels, radians, seconds, degrees Celsius; pixel
//! centres at integer coordinates. Depth is the z coordinate, not the range; inverse depth ρ = 1/z in 1/mm.
//!
//! Invariants: this crate knows no solver, no file and no type of images, and does not allocate per observation. What a whole
//! frame determines ([`frame_covariates`]) is computed from slices.

mod block;
pub mod board;
mod builtin;
pub mod camera;
pub mod chain;
pub mod depth;
pub mod field;
pub mod frame_covariates;
mod grid;
pub mod hook;
mod imitation;
mod inverse;
pub mod lens;
mod needed_light;
mod piece;
pub mod pinhole;
pub mod pixel;
pub mod pose;
pub mod register;
mod scalar;
mod spec;
mod suggestion;
pub mod target;
mod technology;
pub mod uncertainty;

pub use block::Block;
pub use camera::{Camera, CameraError};
pub use frame_covariates::{FrameCovariates, Modulation, SURROUND_PX, StrayLight};
pub use inverse::PixelGrid;
pub use needed_light::needed_light;
pub use piece::{
    AddsTo, AnyPiece, BoardSide, Constant, ConstantTable, Context, Covariate, FormulaConstant, FormulaDefinition,
    FormulaParameter, FormulaSearch, FormulaText, MOST_QUANTITIES, Of, On, Options, Parameter, ParameterTable, Piece,
    Placement, Quantities, Quantity, REFERENCE_DEPTH_MM, Role, Scan, ScanKind, SmoothParameters, erase,
};
pub use register::{Register, RegisterError};
pub use scalar::Scalar;
pub use spec::{FreeSubset, ModelSpec, PieceSpec, SpecError};
pub use target::{BoardPart, CharucoLayout, NumberedBoard, Pattern, Target};
pub use technology::{Technology, UnknownTechnology};
