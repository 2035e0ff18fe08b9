//! The joint adjustment: factors of markers and depth samples on the solver, fields and their smoothness.

pub mod adjustment;
pub mod blocks;
pub mod camera_prior;
pub mod depth_weight;
pub mod factors;
pub(crate) mod field_cells;
mod field_thresholds;
pub mod frame_rows;
pub mod leave_out;
pub mod plane_scatter;
pub mod rig_adjustment;
pub mod rig_factors;
pub mod rig_state;
pub mod smoothness_prior;
pub mod smoothness_selection;

pub use field_thresholds::FieldThresholds;
