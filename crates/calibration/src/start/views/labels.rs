//! Boards that look the same after a turn: a camera that is mounted upside down numbers their markers from the other end. Of all
//! numberings in every view those are taken under which the views agree on the place of the camera.

use std::borrow::Cow;

use depthcal_model::{Pattern, Target};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use tracing::info;

use crate::observe::{Capture, DetectedFrame, MarkerObservation, PlacedCamera, PosedFrame};
use crate::start::{FrameMarkers, estimate_pose};

/// Views whose numberings are tried for all.
const TRIED: usize = 30;
/// Largest disagreement of a view that counts: others are outliers.
const MOST: f64 = 0.5;
/// Another numbering than the present one has to be clearly better.
const CLEARLY: f64 = 0.5;

/// A turn of the board after which it looks the same.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardTurn {
    /// The new number of every marker.
    pub numbers: Vec<usize>,
    /// Maps a board point to the one that it becomes.
    turned_from_board: Isometry3<f64>,
}

impl BoardTurn {
    fn of(target: &Target, numbers: Vec<usize>) -> Self {
        let place = |i: usize| {
            let [x, y] = target.point(i);
            Vector3::new(x, y, 0.0)
        };
        let direction = |a: Vector3<f64>, b: Vector3<f64>| (b.y - a.y).atan2(b.x - a.x);
        let [p, q] = [0, 1].map(|i| place(numbers[i]));
        let angle = direction(p, q) - direction(place(0), place(1));
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
        let translation = Translation3::from(p - rotation * place(0));
        Self { numbers, turned_from_board: Isometry3::from_parts(translation, rotation) }
    }

    /// The pose of a board whose markers are numbered anew.
    fn pose(&self, camera_from_board: &Isometry3<f64>) -> Isometry3<f64> {
        camera_from_board * self.turned_from_board.inverse()
    }

    fn number_anew(&self, markers: &mut [MarkerObservation]) {
        for marker in markers.iter_mut() {
            marker.index = self.numbers[marker.index];
        }
        markers.sort_by_key(|marker| marker.index);
    }
}

/// All turns of a board after which it looks the same, the one by 0° first.
pub fn turns(target: &Target) -> Vec<BoardTurn> {
    let (columns, rows, count) = (target.columns, target.rows, target.len());
    let parities = [columns, rows].map(|n| n % 2);
    let (half, quarter) = match target.pattern {
        // A quarter turn exchanges bright and dark where the number of squares along a side is even.
        Pattern::Chessboard => (parities[0] == parities[1], columns == rows && parities[0] == 0),
        Pattern::SymmetricCircles { .. } => (true, columns == rows),
        Pattern::AsymmetricCircles { .. } => (parities[1] == 0, false),
        _ => (false, false),
    };
    let mut numbers: Vec<Vec<usize>> = Vec::new();
    if count > 1 {
        numbers.push((0..count).collect());
        if half {
            numbers.push((0..count).rev().collect());
        }
        if quarter {
            let turned: Vec<usize> = (0..count).map(|i| (i % columns) * columns + (rows - 1 - i / columns)).collect();
            numbers.push(turned.clone());
            numbers.push(turned.into_iter().map(|number| count - 1 - number).collect());
        }
    }
    numbers.into_iter().map(|numbers| BoardTurn::of(target, numbers)).collect()
}

/// Disagreement of two places of a camera: the angle between them, rad, and the distance as a share of the board's.
fn disagreement(a: &Isometry3<f64>, b: &Isometry3<f64>, distance_mm: f64) -> f64 {
    let apart = (a.translation.vector - b.translation.vector).norm() / distance_mm.max(1.0);
    (a.rotation.angle_to(&b.rotation) + apart).min(MOST)
}

/// Numbers the markers of a second camera's frames, of the views that it shares with a first one, so that all views agree.
pub(super) fn agree_on_labels(target: &Target, views: &mut [(&PosedFrame, &mut PosedFrame)]) {
    let turns = turns(target);
    if turns.len() < 2 || views.is_empty() {
        return;
    }
    let distance = |view: &(&PosedFrame, &mut PosedFrame)| view.0.camera_from_board.translation.vector.norm();
    let distances: Vec<f64> = views.iter().map(distance).collect();
    // Second from first, by view and turn.
    let places = |(first, second): &(&PosedFrame, &mut PosedFrame)| -> Vec<Isometry3<f64>> {
        let first_inverse = first.camera_from_board.inverse();
        turns.iter().map(|turn| turn.pose(&second.camera_from_board) * first_inverse).collect()
    };
    let of_views: Vec<Vec<Isometry3<f64>>> = views.iter().map(places).collect();
    let best_turn = |of_view: &[Isometry3<f64>], place: &Isometry3<f64>, distance: f64| {
        let all = of_view.iter().map(|other| disagreement(place, other, distance)).enumerate();
        // The first of equals.
        all.fold((0, f64::INFINITY), |best, next| if next.1 < best.1 { next } else { best })
    };
    let chosen = |place: &Isometry3<f64>| -> Vec<(usize, f64)> {
        of_views.iter().zip(&distances).map(|(of_view, distance)| best_turn(of_view, place, *distance)).collect()
    };
    let cost = |turns: &[(usize, f64)]| turns.iter().map(|(_, disagreement)| disagreement).sum::<f64>();
    let as_numbered = |place: &Isometry3<f64>| {
        of_views
            .iter()
            .zip(&distances)
            .map(|(of_view, distance)| disagreement(place, &of_view[0], *distance))
            .sum::<f64>()
    };
    let step = of_views.len().div_ceil(TRIED).max(1);
    let tried = || of_views.iter().step_by(step);
    let present = tried().map(|of_view| as_numbered(&of_view[0])).fold(f64::INFINITY, f64::min);
    let all = tried().flatten().map(chosen);
    let Some(best) = all.min_by(|a, b| cost(a).total_cmp(&cost(b))) else { return };
    if cost(&best) > CLEARLY * present {
        return;
    }
    for ((_, second), (turn, _)) in views.iter_mut().zip(best).filter(|(_, (turn, _))| *turn > 0) {
        info!("frame {}: the board looks the same after a turn and is numbered from another end", second.name);
        let turn = &turns[turn];
        second.camera_from_board = turn.pose(&second.camera_from_board);
        turn.number_anew(&mut second.markers);
        turn.number_anew(&mut second.wrong_markers);
    }
}

/// A capture whose boards are numbered as the places of the cameras of a rig have them; the first camera's as they are.
pub(crate) fn numbered_for<'a>(rig: &[PlacedCamera], capture: &'a Capture) -> Cow<'a, Capture> {
    let turns = match capture.cameras.first() {
        Some(first) => turns(&first.capture.target),
        None => Vec::new(),
    };
    if turns.len() < 2 || capture.cameras.len() < 2 {
        return Cow::Borrowed(capture);
    }
    let placed = |name: &str| rig.iter().find(|placed| placed.name == name);
    let pose = |placed: &PlacedCamera, target: &Target, frame: &DetectedFrame| {
        let markers = FrameMarkers { name: &frame.name, markers: &frame.markers };
        estimate_pose(&placed.camera, target, &markers).ok().map(|fit| fit.camera_from_board)
    };
    let mut numbered = capture.clone();
    for second in 1..numbered.cameras.len() {
        let (before, after) = numbered.cameras.split_at_mut(second);
        let Some(camera) = after.first_mut() else { break };
        let Some(second_place) = placed(&camera.name) else { continue };
        for frame in camera.capture.frames.iter_mut().filter(|frame| !frame.markers.is_empty()) {
            let in_first = before.iter().find_map(|other| {
                let shared = other.capture.frames.iter().find(|f| f.name == frame.name && !f.markers.is_empty())?;
                let place = placed(&other.name)?;
                Some((place, pose(place, &other.capture.target, shared)?))
            });
            let Some((first_place, first_pose)) = in_first else { continue };
            let Some(own_pose) = pose(second_place, &camera.capture.target, frame) else { continue };
            let expected = second_place.from(first_place) * first_pose;
            let apart =
                |turn: &BoardTurn| disagreement(&expected, &turn.pose(&own_pose), expected.translation.vector.norm());
            let best = turns.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
            let is_clear = |turn: &&BoardTurn| apart(turn) < CLEARLY * apart(&turns[0]);
            if let Some(turn) = best.filter(is_clear) {
                turn.number_anew(&mut frame.markers);
                turn.number_anew(&mut frame.wrong_markers);
            }
        }
    }
    Cow::Owned(numbered)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::RawFrame;

    fn board(columns: usize, rows: usize) -> Target {
        Target { pattern: Pattern::Chessboard, columns, rows, spacing_mm: 30.0 }
    }

    #[test]
    fn boards_have_the_turns_after_which_they_look_the_same() {
        let count = |columns, rows| turns(&board(columns, rows)).len();
        assert_eq!([count(9, 6), count(8, 6), count(7, 5), count(7, 7), count(6, 6)], [1, 2, 2, 2, 4]);
        let dots = |columns, rows| {
            let pattern = Pattern::SymmetricCircles { circle_diameter_mm: 8.0 };
            turns(&Target { pattern, ..board(columns, rows) }).len()
        };
        assert_eq!([dots(7, 7), dots(7, 6)], [4, 2]);
        // A turn takes every marker to the place of the one whose number it gets.
        for turn in turns(&board(6, 6)) {
            for (i, number) in turn.numbers.iter().enumerate() {
                let [[x, y], [u, v]] = [i, *number].map(|i| board(6, 6).point(i));
                let p = turn.turned_from_board * nalgebra::Point3::new(x, y, 0.0);
                assert!((p.x - u).hypot(p.y - v) < 1e-9, "{turn:?}");
            }
        }
    }

    /// The second camera is upside down, and numbers the markers of every other view from the other end.
    #[test]
    fn views_agree_on_the_place_of_a_camera_once_they_are_numbered_anew() {
        let target = board(8, 6);
        let half = &turns(&target)[1];
        let second_from_first = Isometry3::new(Vector3::new(60.0, 5.0, 0.0), Vector3::new(0.0, 0.1, 3.1));
        let pose = |i: usize| {
            let tilt = 0.5 * (2.0 * i as f64).sin();
            Isometry3::new(
                Vector3::new(10.0 * i as f64 - 90.0, -50.0, 600.0 + 40.0 * i as f64),
                Vector3::new(tilt, -0.3, 0.1),
            )
        };
        let frame = |camera_from_board| {
            let markers =
                (0..target.len()).map(|index| MarkerObservation { index, pixel: [index as f64, 0.0], std_px: 1.0 });
            let detected =
                DetectedFrame { raw: RawFrame::default(), markers: markers.collect(), ..DetectedFrame::default() };
            PosedFrame { detected, camera_from_board }
        };
        let firsts: Vec<PosedFrame> = (0..9).map(|i| frame(pose(i))).collect();
        let truth: Vec<Isometry3<f64>> = (0..9).map(|i| second_from_first * pose(i)).collect();
        let turned = |i: usize| if i.is_multiple_of(2) { half.pose(&truth[i]) } else { truth[i] };
        let mut seconds: Vec<PosedFrame> = (0..9).map(|i| frame(turned(i))).collect();
        let mut views: Vec<_> = firsts.iter().zip(&mut seconds).collect();
        agree_on_labels(&target, &mut views);
        for (i, (second, truth)) in seconds.iter().zip(&truth).enumerate() {
            assert!((second.camera_from_board.inverse() * truth).translation.vector.norm() < 1e-6, "view {i}");
            let first = second.markers.iter().find(|m| m.index == 0).expect("marker").pixel[0];
            assert_eq!(first as usize, if i % 2 == 0 { target.len() - 1 } else { 0 });
        }
    }
}
