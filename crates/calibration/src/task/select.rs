//! The best subset of the frames of a fit.

use super::error::TaskError;
use super::fit::Fitted;
use super::next::{NextRequest, state_of};
use crate::plan::{Goal, Planner, SelectedFrame, Selection, hold_out_views};

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
    pub fn select(&self, fitted: &Fitted) -> Result<Selected, TaskError> {
        let (state, covariance) = state_of(fitted)?;
        let number = self.goal.camera_of(&state)?;
        let planner = Planner::new(&state, number, &covariance)?;
        let camera = &state.cameras[number];
        let goal = self.goal.goal_of(camera, &planner);
        let all = state.frames.len();
        let count = if self.held_out > 0.0 { ((all as f64 * self.held_out).round() as usize).max(1) } else { 0 };
        let poses: Vec<_> = state.frames.iter().map(|frame| camera.camera_from_rig * frame.rig_from_board).collect();
        let aside = hold_out_views(&camera.camera, &camera.capture.target, &poses, count);
        let is_aside = |i: &usize| aside.held_out.contains(i) || aside.like.iter().any(|[like, _]| like == i);
        let candidates: Vec<usize> = (0..all).filter(|i| !is_aside(i)).collect();
        let (chosen, idle, of_all) = planner.choose(&goal, &candidates, self.frames)?;
        let name = |i: usize| state.frames[i].name.clone();
        let is_other = |i: &&usize| !idle.contains(i) && chosen.iter().all(|(chosen, _)| chosen != *i);
        let selection = Selection {
            others: candidates.iter().filter(is_other).map(|i| name(*i)).collect(),
            chosen: chosen.iter().map(|(i, expected)| SelectedFrame { name: name(*i), expected: *expected }).collect(),
            held_out: aside.held_out.iter().map(|i| name(*i)).collect(),
            like_held_out: aside.like.iter().map(|pair| pair.map(name)).collect(),
            adds_nothing: idle.iter().map(|i| name(*i)).collect(),
            of_all,
        };
        Ok(Selected { camera: camera.name.clone(), unit: goal.unit(&camera.camera), goal, selection })
    }
}
