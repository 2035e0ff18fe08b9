//! The stages that invert a camera's depth pieces, and how a stage is chosen for each piece.

pub(crate) mod classify;
mod covariate_table;
mod curve;
mod depth_table;
mod moebius;
mod piece;
mod piecewise_factor;
mod scalar_inverse;
mod separable;
mod stages;
mod stray_light;

pub(crate) use moebius::{Coefficients, ForTables, Moebius, NEAREST_POLE, for_tables, true_depth};
pub(crate) use stages::{F32_ROUNDING, FrameInputs, Plan};
pub(crate) use stray_light::slants;
