//! Whether a lower weight of depth, relative to the markers, predicts the depth of left-out frames better.
//!
//! Where frames have planes of their own, the samples of a frame are no independent observations, and depth that counts as such
//! pulls the camera's parameters away from what the markers say. But where the depth model is wrong in a way that these
//! parameters can take up, the pull lowers the errors. Left-out frames decide (the influence of one kind of data on parameters
//! that another kind determines, chosen by prediction; Carmona, Nicholls 2020).

use nalgebra::{DMatrix, DVector};

use super::adjustment::Adjustment;
use super::smoothness_selection::{FrameInformation, solve_scaled};

/// Parts, blocks of consecutive frames, of which one is left out at a time.
const PARTS: usize = 5;

/// Whether the depth of a camera with its weight divided by `design_effect` predicts the depth of left-out frames better than
/// with its whole weight, with which `adjustment` was solved. Both are linearised there; poses of left-out frames come from
/// everything else.
pub fn less_predicts_better(adjustment: &Adjustment, camera: usize, design_effect: f64) -> bool {
    let frames = adjustment.frame_information_of_depth(camera, [1.0, 1.0 / design_effect]);
    let (whole, less): (Vec<_>, Vec<_>) = frames.into_iter().map(|[whole, less]| (whole, less)).unzip();
    let cost = |fitted: &[FrameInformation]| held_out_cost(fitted, &whole);
    cost(&less) < cost(&whole)
}

/// Cost of the depth of all frames, each held out, up to a constant. Infinite where the frames without a part do not determine
/// the parameters.
fn held_out_cost(fitted: &[FrameInformation], held_out: &[FrameInformation]) -> f64 {
    let count = fitted.len();
    let part_of = |frame: usize| frame * PARTS / count.max(1);
    let without = |part: usize| {
        let n = fitted.first()?.fitted.1.len();
        let other_frames = fitted.iter().enumerate().filter(|(i, _)| part_of(*i) != part).map(|(_, frame)| frame);
        let (normal, gradient) = FrameInformation::added((DMatrix::zeros(n, n), DVector::zeros(n)), other_frames);
        solve_scaled(normal, &-gradient)
    };
    let estimates: Vec<Option<DVector<f64>>> = (0..PARTS).map(without).collect();
    held_out.iter().enumerate().map(|(i, frame)| frame.cost(estimates[part_of(i)].as_ref())).sum()
}
