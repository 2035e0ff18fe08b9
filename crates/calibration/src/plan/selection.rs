//! The best subset of the frames of a fit.

use depthcal_model::{Camera, Target};
use nalgebra::{DMatrix, Isometry3};

use super::error::Error;
use super::goal::Goal;
use super::planner::{PlanError, Planner, inverse};
use super::view::BoardView;

/// Information from elsewhere, on parameters in units of the fit's standard deviations, before the first frame is chosen: as
/// if everything were known a hundred times worse than by all frames together. It only makes the first choices definite.
const BEFORE: f64 = 1e-4;
/// Share by which a frame has to lower the goal's root mean square to add something.
const WORTHWHILE: f64 = 0.002;
/// Frames whose views are at most so many steps apart ([`BoardView::steps_to`]) are alike.
const ALIKE: f64 = 0.5;

/// A frame of a selection.
#[derive(Debug, Clone, PartialEq)]
pub struct SelectedFrame {
    /// Its name.
    pub name: String,
    /// Root mean square of the goal's error that is expected with this frame and those before it.
    pub expected: f64,
}

/// Frames of a fit, from the most to the least valuable.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// The frames to fit, in the order in which they were chosen.
    pub chosen: Vec<SelectedFrame>,
    /// Frames that are set aside for evaluation.
    pub held_out: Vec<String>,
    /// Frames that are neither, because their view is like that of the held-out frame that is named second: fitted, they would
    /// make its errors too small.
    pub like_held_out: Vec<[String; 2]>,
    /// Frames that were not chosen and would lower the goal by less than 0.2 % each.
    pub adds_nothing: Vec<String>,
    /// Further frames that were not chosen.
    pub others: Vec<String>,
    /// Root mean square of the goal's error that is expected with all frames that could have been chosen.
    pub of_all: f64,
}

/// Frames set aside, and those that are like one of them, as places in a list.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct HeldOutViews {
    /// Frames set aside.
    pub held_out: Vec<usize>,
    /// Frames whose view is like that of a frame that is set aside, and that one.
    pub like: Vec<[usize; 2]>,
}

/// Sets aside about `count` of the frames with these poses (camera from board): every n-th by distance, so that all distances
/// are judged and the nearest and the farthest are fitted.
pub fn hold_out_views(camera: &Camera, target: &Target, poses: &[Isometry3<f64>], count: usize) -> HeldOutViews {
    let views: Vec<Option<BoardView>> = poses.iter().map(|pose| BoardView::new(camera, target, pose)).collect();
    let mut by_distance: Vec<(usize, BoardView)> =
        views.iter().enumerate().filter_map(|(i, view)| Some((i, (*view)?))).collect();
    by_distance.sort_by(|a, b| a.1.distance_mm.total_cmp(&b.1.distance_mm).then(a.0.cmp(&b.0)));
    let n = by_distance.len();
    let held: Vec<(usize, BoardView)> = (0..count.min(n)).map(|k| by_distance[(2 * k + 1) * n / (2 * count)]).collect();
    let is_held = |i: &usize| held.iter().any(|(held, _)| held == i);
    let alike = |(i, view): &(usize, BoardView)| {
        let steps = |other: &BoardView| view.steps_to(other, camera).into_iter().fold(0.0, f64::max);
        let (other, _) = held.iter().find(|(_, other)| steps(other) <= ALIKE)?;
        Some([*i, *other])
    };
    let mut like: Vec<[usize; 2]> = by_distance.iter().filter(|(i, _)| !is_held(i)).filter_map(alike).collect();
    let mut held_out: Vec<usize> = held.iter().map(|(i, _)| *i).collect();
    held_out.sort_unstable();
    like.sort_unstable();
    HeldOutViews { held_out, like }
}

/// Frames chosen among others, as places in a list.
#[derive(Debug, Clone, PartialEq)]
pub struct ChosenFrames {
    /// The frames in the order in which they were chosen, with the root mean square of the goal's error expected with each
    /// and those before it.
    pub chosen: Vec<(usize, f64)>,
    /// Frames that were not chosen and would lower it by less than 0.2 % each.
    pub adds_nothing: Vec<usize>,
    /// Root mean square of the goal's error that is expected with all of them.
    pub of_all: f64,
}

impl Planner {
    /// Chooses `count` of the fitted frames, given by their places and the share to which their information counts, one after
    /// another, each the one that lowers the goal most.
    ///
    /// # Errors
    ///
    /// [`PlanError::Goal`].
    pub fn choose(&self, goal: &Goal, candidates: &[(usize, f64)], count: usize) -> Result<ChosenFrames, PlanError> {
        let (weight, scale) = self.weight_and_scale(goal)?;
        let n = weight.nrows();
        let error = |precision: &DMatrix<f64>| {
            inverse(precision).map(|covariance| scale * Error::mean_square_of(&covariance, &weight))
        };
        let mut precision = DMatrix::identity(n, n) * BEFORE;
        let of_frame = |(place, share): &(usize, f64)| &self.frames[*place] * *share;
        let all = candidates.iter().fold(precision.clone(), |sum, frame| sum + of_frame(frame));
        let of_all = error(&all).map_or(f64::NAN, f64::sqrt);
        let (mut left, mut chosen) = (candidates.to_vec(), Vec::new());
        while chosen.len() < count {
            let with = |(place, frame): (usize, &(usize, f64))| Some((place, error(&(&precision + of_frame(frame)))?));
            let best = left.iter().enumerate().filter_map(with).min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
            let Some((place, mean_square)) = best else { break };
            let frame = left.remove(place);
            precision += of_frame(&frame);
            chosen.push((frame.0, mean_square.sqrt()));
        }
        let now = error(&precision).unwrap_or(f64::INFINITY);
        let adds_nothing = |frame: &&(usize, f64)| {
            error(&(&precision + of_frame(frame))).is_some_and(|with| 1.0 - (with / now).sqrt() < WORTHWHILE)
        };
        let adds_nothing = left.iter().filter(adds_nothing).map(|(place, _)| *place).collect();
        Ok(ChosenFrames { chosen, adds_nothing, of_all })
    }
}
