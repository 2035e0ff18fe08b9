//! The pose that is wanted next: before the first fit one of some that determine a camera, then those of the planner.

use std::collections::VecDeque;

use depthcal_calibration::plan::{BoardTilt, BoardView, ImagePlace, ProposedFrame, pose_showing, predicted_frame};
use depthcal_calibration::start::{FrameMarkers, local_poses};
use depthcal_io::MarkerObservation;
use depthcal_model::{Camera, Context, Target};
use nalgebra::{Isometry3, Point3};

use crate::pose_distance::{distance, hint};

/// Focal length of a camera that is not known yet, in widths of its image: 53° from left to right.
const FOCAL: f64 = 1.0;
/// Tilt of the first poses, degrees.
const TILT_DEG: f64 = 35.0;
/// How far towards its place at the border of the image the board is moved, so that all of it is seen: as far as possible.
const SHIFTS: [f64; 5] = [1.0, 0.75, 0.5, 0.25, 0.0];
/// Steps of a side of the outline, which a lens bends.
const STEPS: usize = 8;
/// A second pose of a plane counts where its reprojection error is at most so many times the best's.
const ALIKE: f64 = 1.3;

/// A wanted pose.
#[derive(Debug, Clone)]
pub(crate) struct WantedPose {
    pub words: String,
    pub pose: Isometry3<f64>,
    pub view: BoardView,
}

/// The camera by which poses are told, and the poses that are wanted, the first one first.
#[derive(Debug, Clone)]
pub(crate) struct Guide {
    pub camera: Camera,
    pub target: Target,
    pub wanted: VecDeque<WantedPose>,
    pub is_fitted: bool,
}

impl Guide {
    /// The guide before the first fit, with a camera of a usual field of view.
    pub(crate) fn starting(target: &Target, [width, height]: [usize; 2]) -> Self {
        let (w, h) = (width as f64, height as f64);
        let focal = FOCAL * w;
        let pinhole = [focal, focal, (w - 1.0) / 2.0, (h - 1.0) / 2.0, 0.0];
        let camera = Camera::new(width, height, pinhole, Vec::new());
        let mut guide = Self { camera, target: target.clone(), wanted: VecDeque::new(), is_fitted: false };
        let [board_width, board_height] = target.size_mm();
        // The distance at which the board takes half of the image.
        let near = 2.0 * focal * f64::max(board_width / w, board_height / h);
        let (vertical, horizontal) = (BoardTilt::AboutVertical, BoardTilt::AboutHorizontal);
        let poses = [
            (1.0, ImagePlace::Middle, BoardTilt::Parallel),
            (1.0, ImagePlace::LeftEdge, vertical(TILT_DEG)),
            (1.0, ImagePlace::RightEdge, vertical(-TILT_DEG)),
            (1.0, ImagePlace::Top, horizontal(-TILT_DEG)),
            (1.0, ImagePlace::Bottom, horizontal(TILT_DEG)),
            (1.6, ImagePlace::UpperLeft, BoardTilt::Parallel),
            (1.6, ImagePlace::LowerRight, vertical(TILT_DEG)),
            (1.6, ImagePlace::UpperRight, horizontal(TILT_DEG)),
            (1.6, ImagePlace::LowerLeft, horizontal(-TILT_DEG)),
        ];
        for (farther, place, tilt) in poses {
            let distance_mm = farther * near;
            let shown = SHIFTS.iter().find_map(|shift| {
                let pixel = [0, 1].map(|i| [w, h][i] * (0.5 + shift * (place.position()[i] - 0.5)));
                let pose = pose_showing(&guide.camera, target, distance_mm, pixel, tilt.angles_deg())?;
                predicted_frame(&guide.camera, target, &pose, &Context::default()).map(|_| pose)
            });
            let frame = ProposedFrame { distance_mm, place, tilt, warmer_c: None };
            guide.want(shown.map(|pose| (format!("about {}", frame.words()), pose)));
        }
        guide
    }

    /// The guide after a fit.
    pub(crate) fn fitted(target: &Target, camera: Camera, poses: &[(ProposedFrame, Isometry3<f64>)]) -> Self {
        let mut guide = Self { camera, target: target.clone(), wanted: VecDeque::new(), is_fitted: true };
        poses.iter().for_each(|(frame, pose)| guide.want(Some((frame.words(), *pose))));
        guide
    }

    fn want(&mut self, pose: Option<(String, Isometry3<f64>)>) {
        let wanted = pose.and_then(|(words, pose)| {
            let view = BoardView::new(&self.camera, &self.target, &pose)?;
            Some(WantedPose { words, pose, view })
        });
        self.wanted.extend(wanted);
    }

    /// The views of a board that fit its markers alike: a small or distant board may be tilted one way or the other.
    pub(crate) fn views(&self, markers: &[MarkerObservation]) -> Vec<BoardView> {
        let frame = FrameMarkers { name: "live", markers };
        let fits = local_poses(&self.camera, &self.target, &frame).unwrap_or_default();
        let best = fits.first().map_or(0.0, |fit| fit.rms_px);
        let alike = fits.iter().filter(|fit| fit.rms_px <= ALIKE * best);
        alike.filter_map(|fit| BoardView::new(&self.camera, &self.target, &fit.camera_from_board)).collect()
    }

    /// How far a board with these views is from the first wanted pose, in steps of which one is just there, and the movement that
    /// brings it nearer.
    pub(crate) fn distance_and_hint(&self, views: &[BoardView]) -> Option<(f64, &'static str)> {
        let wanted = self.wanted.front()?.view;
        let to_wanted = |view: &BoardView| (distance(view, &wanted, &self.camera), hint(view, &wanted, &self.camera));
        views.iter().map(to_wanted).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The outline of the markers of a board in a pose, px.
    pub(crate) fn outline(&self, pose: &Isometry3<f64>) -> Vec<[f64; 2]> {
        let [low, high] = self.target.marker_rectangle();
        let corners = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]];
        let point = |k: usize| {
            let (from, to) = (corners[k / STEPS], corners[(k / STEPS + 1) % 4]);
            let t = (k % STEPS) as f64 / STEPS as f64;
            let point = Point3::new(from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1]), 0.0);
            self.camera.project(&(pose * point).coords)
        };
        (0..4 * STEPS).filter_map(point).collect()
    }
}

#[cfg(test)]
mod tests {
    use depthcal_model::Pattern;

    use super::*;

    fn guide() -> Guide {
        let target = Target { pattern: Pattern::Chessboard, columns: 9, rows: 6, spacing_mm: 30.0 };
        Guide::starting(&target, [640, 480])
    }

    fn markers(guide: &Guide, pose: &Isometry3<f64>) -> Vec<MarkerObservation> {
        predicted_frame(&guide.camera, &guide.target, pose, &Context::default()).unwrap().posed.detected.markers
    }

    /// Every wanted pose is reached by the board in that pose, and by it alone of all wanted ones.
    #[test]
    fn a_board_is_at_its_pose_and_at_no_other() {
        let mut guide = guide();
        assert_eq!(guide.wanted.len(), 9);
        let poses: Vec<Isometry3<f64>> = guide.wanted.iter().map(|wanted| wanted.pose).collect();
        for number in 0..poses.len() {
            for (other, pose) in poses.iter().enumerate() {
                let (distance, _) = guide.distance_and_hint(&guide.views(&markers(&guide, pose))).unwrap();
                assert_eq!(distance <= 1.0, other == number, "{number} {other}: {distance}");
            }
            assert!(
                guide.outline(&poses[number]).iter().all(|p| p[0] > 0.0 && p[0] < 640.0 && p[1] > 0.0 && p[1] < 480.0)
            );
            guide.wanted.pop_front();
        }
    }

    /// From a pose that differs in one thing, the hint names the way back.
    #[test]
    fn hints_lead_to_the_pose() {
        let guide = guide();
        let (camera, target) = (&guide.camera, &guide.target);
        let middle = [319.5, 239.5];
        let distance = guide.wanted[0].view.distance_mm;
        let shown = |distance_mm, pixel, turn| pose_showing(camera, target, distance_mm, pixel, turn).unwrap();
        let cases = [
            (shown(distance, [220.0, 239.5], [0.0; 2]), "to the right in the picture"),
            (shown(distance, [319.5, 330.0], [0.0; 2]), "up in the picture"),
            (shown(1.5 * distance, middle, [0.0; 2]), "nearer to the camera"),
            (shown(0.8 * distance, middle, [0.0; 2]), "away from the camera"),
            (shown(distance, middle, [0.0, 40.0]), "tilt: its left side nearer"),
            (shown(distance, middle, [-40.0, 0.0]), "tilt: its upper side nearer"),
        ];
        for (pose, expected) in cases {
            let (distance, hint) = guide.distance_and_hint(&guide.views(&markers(&guide, &pose))).unwrap();
            assert!(distance > 1.0 && hint == expected, "{hint}, not {expected}");
        }
    }
}
