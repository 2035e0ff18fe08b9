//! The best subset of the frames of a fit.

use depthcal_statistics::quantile;

use super::error::TaskError;
use super::fit::Fit;
use super::next::{NextRequest, depth_noise_mm};
use crate::adjust::state::{CameraState, State};
use crate::judge::camera::EvaluatedCamera;
use crate::plan::{ChosenFrames, Goal, PlanError, Planner, SelectedFrame, Selection, hold_out_views};

/// Request of a subset of frames.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SelectRequest {
    /// The goal, its range and its camera; further poses and a target are not asked for.
    pub goal: NextRequest,
    /// Number of frames to choose.
    pub frames: usize,
    /// Share of all frames that is set aside for evaluation, 0 to less than 1.
    pub held_out: f64,
}

/// A subset of frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Selected {
    /// The camera whose goal was lowered.
    pub camera: String,
    /// The goal.
    pub goal: Goal,
    /// Unit of its values.
    pub unit: String,
    /// The frames.
    pub selection: Selection,
}

impl SelectRequest {
    /// Chooses frames of a fit to all of them.
    ///
    /// # Errors
    ///
    /// [`TaskError::Plan`]: the goal means nothing for the camera, or the frames leave parameters open.
    pub fn select(&self, fit: &Fit) -> Result<Selected, TaskError> {
        let (state, covariance) = (&fit.fitted.state, fit.fitted.covariance.as_ref().ok_or(PlanError::Undetermined)?);
        let number = self.goal.camera_of(state)?;
        let planner = Planner::new(state, number, covariance)?;
        let camera = &state.cameras[number];
        let goal = self.goal.goal_of(camera, &planner);
        let all = state.frames.len();
        let count = if self.held_out > 0.0 { ((all as f64 * self.held_out).round() as usize).max(1) } else { 0 };
        let poses: Vec<_> = state.frames.iter().map(|frame| camera.camera_from_rig * frame.rig_from_board).collect();
        let aside = hold_out_views(&camera.camera, &camera.capture.target, &poses, count);
        let is_aside = |i: &usize| aside.held_out.contains(i) || aside.like.iter().any(|[like, _]| like == i);
        let evaluated = fit.on_fitted.camera(&camera.name);
        let shares = shares(camera, state, evaluated);
        let candidates: Vec<(usize, f64)> = shares.into_iter().enumerate().filter(|(i, _)| !is_aside(i)).collect();
        let ChosenFrames { chosen, adds_nothing, of_all } = planner.choose(&goal, &candidates, self.frames)?;
        let name = |i: usize| state.frames[i].name.clone();
        let is_other = |i: &usize| !adds_nothing.contains(i) && chosen.iter().all(|(chosen, _)| chosen != i);
        let selection = Selection {
            others: candidates.iter().map(|(i, _)| *i).filter(is_other).map(name).collect(),
            chosen: chosen.iter().map(|(i, expected)| SelectedFrame { name: name(*i), expected: *expected }).collect(),
            held_out: aside.held_out.iter().map(|i| name(*i)).collect(),
            like_held_out: aside.like.iter().map(|pair| pair.map(name)).collect(),
            adds_nothing: adds_nothing.iter().map(|i| name(*i)).collect(),
            of_all,
        };
        Ok(Selected { camera: camera.name.clone(), unit: goal.unit(&camera.camera), goal, selection })
    }
}

/// The share to which each frame's information counts: less where it deviates more from the fit than the median frame does, by
/// the square of the ratio, as the variance of its errors is larger. Depth is compared in units of the noise at its distance,
/// frames without depth by their markers.
fn shares(camera: &CameraState, state: &State, evaluated: Option<&EvaluatedCamera>) -> Vec<f64> {
    let deviation = |name: &str| {
        let frame = evaluated?.frames.iter().find(|frame| frame.name == name)?;
        if frame.depth.pixels == 0 {
            let squares = frame.reprojection.iter().map(|[_, _, du, dv]| du * du + dv * dv);
            return Some((squares.sum::<f64>() / frame.reprojection.len() as f64).sqrt());
        }
        let noise_mm = depth_noise_mm(&camera.noise, frame.camera_from_board.translation.vector.z);
        Some(frame.depth.rms_mm()?.after / noise_mm)
    };
    let deviations: Vec<Option<f64>> = state.frames.iter().map(|frame| deviation(&frame.name)).collect();
    let usual = quantile(deviations.iter().copied().flatten(), 0.5);
    let share = |deviation: &Option<f64>| deviation.map_or(1.0, |deviation| (usual / deviation).powi(2).min(1.0));
    // Not a number where nothing deviates, as in exact data.
    deviations.iter().map(share).map(|share| if share > 0.0 { share } else { 1.0 }).collect()
}
