//! The closed loop: fit the declared model, examine its residuals, add the effect that explains them, fit again, and report the
//! errors before and after on held-out frames; until the residuals show nothing that the model lacks.
//!
//! | step | module |
//! |---|---|
//! | frames that do not belong to the others | [`bad_frames`], [`frame_planes`] |
//! | declarations that cannot be right | [`implausible_scale`](crate::calibrate::implausible_scale) |
//! | effects that may be missing | [`candidates`] |
//! | free functions that compete with them | [`free_functions`] |
//! | the free function of an effect's own covariate | `own_function` |
//! | whether images alone show an effect of the lens | `lens_in_image` |
//! | the evidence for each in the residuals | [`evidence`], [`examination`] |
//! | scores of all effects, for fleets | [`effect_scores`] |
//! | effects that explain the residuals together | `stepwise_selection` |
//! | the decision: which effect to add, if any | [`decision`] |
//! | effects that are not certain | `possible` |
//! | the loop: its state and its steps | [`diagnose`], `closed_loop` |
//! | what frames share, and pure error | [`pure_error`] |
//! | captures that would answer open questions | [`experiment_design`] |
//! | effects that these captures can distinguish | [`separability`] |
//! | formulas for what no effect explains | [`discovery`] |
//! | the record for files | [`record`] |
//!
//! Every threshold of the rules is in [`Thresholds`]. Findings are data; `depthcal-report` words them.

mod added_effect;
mod along;
pub mod bad_frames;
mod candidate_blocks;
pub mod candidates;
mod capture_diagnosis;
mod closed_loop;
pub mod decision;
mod diagnosis;
pub mod discovery;
mod driver;
pub mod effect_scores;
mod effect_size;
mod error;
pub mod evidence;
pub mod examination;
pub mod experiment_design;
pub mod frame_planes;
pub mod free_functions;
mod free_map;
mod held_out;
mod left_over;
mod lens_in_image;
#[cfg(test)]
mod linear_examination;
pub mod merit;
mod modulation_search;
pub mod observed_states;
mod options;
mod own_function;
mod possible;
pub mod pure_error;
mod pure_noise;
pub mod record;
mod residual_cells;
pub mod rig;
mod round;
pub mod separability;
mod spline_piece;
mod step;
mod stepwise_selection;
mod thresholds;
mod variant_search;

pub use capture_diagnosis::{CameraInRig, DiagnosedCamera, Diagnosis, RigDiagnosis};
pub use closed_loop::diagnose_camera;
pub use diagnosis::CameraDiagnosis;
pub use driver::diagnose;
pub use error::DiagnoseError;
pub use free_map::FREE_MAP;
pub use held_out::HeldOut;
pub use left_over::LeftOver;
pub use options::{CameraDiagnoseOptions, DiagnoseOptions};
pub use possible::Possible;
pub use pure_noise::PureNoise;
pub use round::{Refutation, Refuted, Round, RoundOutcome};
pub use step::Step;
pub use thresholds::Thresholds;
