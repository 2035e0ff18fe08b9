//! The start of a camera's time offset: the one under which views of a moving board agree best on its place.

use depthcal_model::Target;
use depthcal_statistics::upper_median;
use nalgebra::{Isometry3, Point3};

use super::average::mean;
use crate::observe::board_motion::BoardMotion;

/// Offsets are tried at this distance, s, then at a tenth of it about the best.
const STEP_S: f64 = 0.004;
/// Fewest views.
const FEWEST_VIEWS: usize = 6;

/// A view of the board by two cameras, while it moves.
#[derive(Debug, Clone, Copy)]
pub struct MovingView {
    /// Pose of the board in the first camera.
    pub first_from_board: Isometry3<f64>,
    /// Its motion there.
    pub motion: BoardMotion,
    /// By how much the second camera's time is later, s.
    pub later_s: f64,
    /// Pose of the board in the second camera.
    pub second_from_board: Isometry3<f64>,
}

/// By how much the second camera exposes later than its times say, s: among the offsets for which the board stays between the
/// frames before and after, that with which the median view differs least from the mean of all relative poses. `None` with too
/// few views.
pub fn time_offset(target: &Target, views: &[MovingView]) -> Option<f64> {
    if views.len() < FEWEST_VIEWS {
        return None;
    }
    let room = |side: usize| {
        let mut room: Vec<f64> =
            views.iter().map(|view| (view.motion.between_s()[side] - view.later_s).abs()).collect();
        upper_median(&mut room)
    };
    let [low, high] = [-room(0)?, room(1)?];
    let corners: Vec<Point3<f64>> = [0, target.len().saturating_sub(1), target.len() / 2]
        .map(|index| target.point(index))
        .map(|[x, y]| Point3::new(x, y, 0.0))
        .to_vec();
    let best = |from: f64, to: f64, step: f64| {
        let tried = (0..=((to - from) / step) as usize).map(|i| from + step * i as f64);
        let rated = tried.filter_map(|s| Some((disagreement_mm(views, &corners, s)?, s)));
        rated.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, s)| s)
    };
    let coarse = best(low, high, STEP_S)?;
    best(coarse - STEP_S, coarse + STEP_S, STEP_S / 10.0)
}

/// Median over the views of the distance between corners of the board as the second camera sees them and where the first does,
/// with the mean relative pose, mm.
fn disagreement_mm(views: &[MovingView], corners: &[Point3<f64>], offset_s: f64) -> Option<f64> {
    let moved: Vec<Isometry3<f64>> =
        views.iter().map(|view| view.motion.after(offset_s + view.later_s).of(&view.first_from_board)).collect();
    let relative = |(view, first): (&MovingView, &Isometry3<f64>)| view.second_from_board * first.inverse();
    let relative_poses: Vec<Isometry3<f64>> = views.iter().zip(&moved).map(relative).collect();
    let errors = |place: &Isometry3<f64>| -> Vec<f64> {
        let error = |(view, first): (&MovingView, &Isometry3<f64>)| {
            let (a, b) = (place * first, view.second_from_board);
            corners.iter().map(|p| (a * p - b * p).norm()).fold(0.0, f64::max)
        };
        views.iter().zip(&moved).map(error).collect()
    };
    let median = |errors: Vec<f64>| upper_median(&mut errors.clone());
    // Once more without the views that are farther off than most: single poses may be the wrong one of a plane's two.
    let first = errors(&mean(&relative_poses)?);
    let limit = 2.0 * median(first.clone())?;
    let near: Vec<Isometry3<f64>> =
        relative_poses.iter().zip(&first).filter(|(_, e)| **e <= limit).map(|(p, _)| *p).collect();
    median(errors(&mean(&near)?))
}
