//! Fields of very many nodes, whose covariances are out of reach: noise and roughness come from a coarse field on part of
//! the samples.
//!
//! What roughness means does not depend on the number of nodes: the second difference of a given curvature falls with the
//! square of their distance h and their number grows with its inverse square, so that the same energy of curvature costs
//! the same where roughness is proportional to h.

use std::sync::Arc;

use depthcal_model::Camera;

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::CameraOptions;
use super::error::CalibrateError;
use super::rules::{joint_rules, rules_by_node};
use super::settle::settle;
use crate::adjust::field_cells;
use crate::adjust::smoothness_prior::{Smoothness, hold_untouched};
use crate::adjust::state::{CameraState, State};
use crate::observe::SampledFrame;

/// Depth samples of a frame from which the roughness of a large field is chosen.
const COARSE_SAMPLES: usize = 800;

/// Adjusts a camera with fields of very many nodes. `coarse` is the camera with coarse fields, `factors` says for every
/// block how much farther apart the nodes of its coarse field are.
pub(super) fn settle_by_node(
    start: CameraState<SampledFrame>,
    coarse: &Camera,
    factors: &[f64],
    options: &CameraOptions,
) -> Result<CalibratedCamera, CalibrateError> {
    let CameraState { mut capture, camera, noise, prior, .. } = start;
    let mut thin = capture.clone();
    for frame in &mut thin.frames {
        let step = frame.samples.len().div_ceil(COARSE_SAMPLES).max(1);
        frame.samples = Arc::new(frame.samples.iter().step_by(step).copied().collect());
    }
    let coarse = hold_untouched(coarse, &thin);
    let first = CameraState {
        smoothness: Smoothness::of(&coarse, &options.field_thresholds),
        prior: prior.clone(),
        ..CameraState::reference(thin, coarse, noise)
    };
    let first = settle(State::of_camera(first), &joint_rules(), options)?.only_camera(options);
    let mut smoothness =
        Smoothness { ridge: first.smoothness.ridge, ..Smoothness::of(&camera, &options.field_thresholds) };
    for (field, coarse) in smoothness.fields.iter_mut().zip(&first.smoothness.fields) {
        let block = camera.blocks().iter().position(|b| b.name() == field.piece);
        field.roughness = coarse.roughness / block.map_or(1.0, |i| factors[i]);
    }
    let camera = camera.map_blocks(|mut block| {
        let fitted = first.camera.block(block.name()).filter(|b| b.theta.len() == block.theta.len());
        if let Some(fitted) = fitted {
            block.theta.clone_from(&fitted.theta);
        }
        block
    });
    field_cells::sort_by_cell(&mut capture, &camera);
    let poses: Vec<_> = first.capture.poses().collect();
    capture.set_poses(&poses);
    let nodes = smoothness.fields.iter().map(|f| f.nodes).sum();
    let start = CameraState { smoothness, prior, ..CameraState::reference(capture, camera, first.noise) };
    Ok(settle(State::of_camera(start), &rules_by_node(nodes), options)?.only_camera(options))
}
