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
/// An offset is plain where the board is less than this share as far apart with it.
const PLAIN: f64 = 0.5;

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

/// By how much a camera exposes later than its times say against another, and how far apart the two see a moving board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetEstimate {
    /// How much later, s.
    pub later_s: f64,
    /// Distance between corners of the board by the two cameras in the median view, mm.
    pub apart_mm: f64,
    /// … if it exposed when its times say.
    pub apart_as_timed_mm: f64,
}

impl OffsetEstimate {
    /// Whether the camera clearly exposes at other moments than its times say: what a board that stands still never shows.
    pub fn is_plain(&self) -> bool {
        self.apart_mm < PLAIN * self.apart_as_timed_mm
    }
}

/// The time offset of the second camera: among those for which the board stays between the frames before and after, that with
/// which the median view differs least from the mean of all relative poses. `None` with too few views.
pub fn time_offset(target: &Target, views: &[MovingView]) -> Option<OffsetEstimate> {
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
        rated.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let (_, coarse_s) = best(low, high, STEP_S)?;
    let (apart_mm, later_s) = best(coarse_s - STEP_S, coarse_s + STEP_S, STEP_S / 10.0)?;
    Some(OffsetEstimate { later_s, apart_mm, apart_as_timed_mm: disagreement_mm(views, &corners, 0.0)? })
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

#[cfg(test)]
mod tests {
    use depthcal_model::Pattern;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    use super::*;
    use crate::observe::board_motion::motions;

    const FRAMES: usize = 30;

    /// Where a board of the first camera is at a time, moving or not.
    fn pose(t: f64, moves: f64) -> Isometry3<f64> {
        let shift = Vector3::new((1.9 * t).sin(), (2.7 * t).cos(), (1.3 * t).sin()) * (60.0 * moves);
        let turn = Vector3::new((2.3 * t).sin(), (1.1 * t).cos(), 0.0) * (0.4 * moves);
        Translation3::from(shift + Vector3::z() * 800.0) * UnitQuaternion::from_scaled_axis(turn)
    }

    /// The estimate for a second camera that exposes later by `later_s`, with poses that are off by a little.
    fn estimated(later_s: f64, moves: f64) -> OffsetEstimate {
        let second_from_first = Isometry3::translation(-50.0, 2.0, 1.0);
        let times = (0..FRAMES).map(|i| 0.04 * i as f64);
        let firsts: Vec<_> = times.clone().map(|t| (Some(t), pose(t, moves))).collect();
        let motions = motions(&firsts);
        let view = |(i, t): (usize, f64)| {
            let error = Vector3::new((17.0 * t).sin(), (23.0 * t).sin(), (31.0 * t).cos()) * 0.2;
            Some(MovingView {
                first_from_board: firsts[i].1,
                motion: motions[i]?,
                later_s: 0.0,
                second_from_board: Translation3::from(error) * second_from_first * pose(t + later_s, moves),
            })
        };
        let views: Vec<MovingView> = times.enumerate().filter_map(view).collect();
        let target = Target { pattern: Pattern::Chessboard, columns: 9, rows: 6, spacing_mm: 30.0 };
        time_offset(&target, &views).expect("an offset")
    }

    #[test]
    fn a_camera_that_exposes_later_is_found_where_the_board_moves() {
        let offset = estimated(0.012, 1.0);
        assert!((offset.later_s - 0.012).abs() < 0.001, "{offset:?}");
        assert!(offset.is_plain(), "{offset:?}");
    }

    #[test]
    fn cameras_in_step_and_boards_that_stand_still_show_no_offset() {
        assert!(!estimated(0.0, 1.0).is_plain());
        assert!(!estimated(0.012, 0.0).is_plain());
    }
}
