//! The joint adjustment of one camera or a rig: factors of markers and depth samples on the solver, fields and their smoothness.

pub mod adjustment;
pub mod blocks;
mod camera_keys;
pub mod camera_prior;
pub mod depth_weight;
pub mod factors;
pub(crate) mod field_cells;
mod field_thresholds;
pub mod frame_information;
pub mod frame_rows;
pub mod leave_out;
pub(crate) mod observations;
pub mod plane_scatter;
pub mod problem;
mod redundancy;
pub mod smoothness_prior;
pub mod smoothness_selection;
pub mod state;

pub use field_thresholds::FieldThresholds;
