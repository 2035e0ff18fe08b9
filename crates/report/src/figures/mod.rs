//! The figures: data and layout in the schema of plotly.js, with a title, a caption and a text for those who cannot see them.
//!
//! One file per kind of figure; `figure` is the type that they all make, `plotly` has the colours, axes and numbers that they
//! share. Colours of text, axes and grid are set in the page, which knows whether it is light, dark or printed.

mod bars;
mod by_model;
mod candidates;
mod comparison;
mod correction_maps;
mod correlation;
mod coverage;
mod curves;
mod differences;
mod field;
mod figure;
mod fleet;
mod histogram;
mod maps;
mod noise;
mod per_frame;
mod plotly;
mod poses;
mod rig;
mod stages;
mod two_calibrations;
mod uncertainty;

pub(super) use bars::{by_dataset, headline_bars};
pub(super) use by_model::{Taken, frames_by_model, model_curve};
pub(super) use candidates::{ranking, separability, sizes};
pub(super) use comparison::{learning_curve, model_ranking};
pub(super) use correction_maps::correction_maps;
pub(super) use correlation::correlation;
pub(super) use coverage::{coverage, distance_and_tilt};
pub(super) use curves::{curves, image_trend};
pub(super) use differences::{differences, differences_by_model};
pub(super) use field::reprojection_field;
pub(super) use figure::Figure;
pub(super) use fleet::{fleet_effects, fleet_parameters};
pub(super) use histogram::residual_histogram;
pub(super) use maps::{board_map, board_maps_by_model, image_maps, image_maps_by_model};
pub(super) use noise::noise;
pub(super) use per_frame::per_frame;
pub(super) use plotly::round_factor;
pub(super) use poses::poses;
pub(super) use rig::{rig_in_space, transfer_by_distance, transfer_over_image};
pub(super) use stages::{stage_bars, step_gains};
pub(super) use two_calibrations::{depth_difference_maps, difference_by_distance, projection_maps};
pub(super) use uncertainty::{projection_uncertainty, uncertainty_curves, uncertainty_map};
