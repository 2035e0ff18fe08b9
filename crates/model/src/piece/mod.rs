//! Pieces: small smooth maps of the chain's state, each with a few parameters of its own, that describe themselves.
//!
//! A piece is written once, as [`Piece`], generic over [`Scalar`]. [`erase`] makes it an [`AnyPiece`], which the chain
//! calls once per batch of observations. Its Jacobians come from static dual numbers, four directions at a time, which
//! costs about as much as derivatives by hand.

mod any;
pub(crate) mod constant;
mod context;
mod covariate;
mod definition;
mod erased;
mod formula;
mod parameter;
mod placed;
mod placement;
mod quantity;
mod role;
mod smooth;

pub use crate::scalar::Scalar;
pub use any::AnyPiece;
pub(crate) use constant::worded;
pub use constant::{BoardSide, Constant, Options, Scan, ScanKind};
pub use context::Context;
pub use covariate::Covariate;
pub use definition::Piece;
pub(crate) use erased::Erased;
pub use erased::erase;
pub use formula::{
    AddsTo, ConstantTable, FormulaConstant, FormulaDefinition, FormulaParameter, FormulaSearch, FormulaText,
    ParameterTable,
};
pub use parameter::Parameter;
pub(crate) use placed::placed;
pub use placement::{Of, On, Placement, REFERENCE_DEPTH_MM};
pub use quantity::{MOST_QUANTITIES, Quantities, Quantity};
pub use role::Role;
pub use smooth::SmoothParameters;
