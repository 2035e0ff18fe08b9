//! Frames that were not captured: what a camera would observe of a board.

use depthcal_model::{Camera, Context, Target};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::observe::board_region::BoardRegion;
use crate::observe::{DepthSample, DetectedFrame, MarkerObservation, PosedFrame, RawFrame, SampledFrame};

/// Depth samples per side of the board in a predicted frame.
const SAMPLES_PER_SIDE: usize = 20;

/// The pose that shows the board's middle at a pixel and a depth, turned by angles (degrees) about x and y.
pub fn pose_showing(
    camera: &Camera,
    target: &Target,
    depth_mm: f64,
    pixel: [f64; 2],
    turn_deg: [f64; 2],
) -> Option<Isometry3<f64>> {
    let ray = camera.ray(pixel, 1.0 / depth_mm).ok()?;
    let points = target.points();
    let n = points.len() as f64;
    let middle = points.iter().fold(Vector3::zeros(), |c, p| c + Vector3::new(p[0], p[1], 0.0) / n);
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), turn_deg[0].to_radians())
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn_deg[1].to_radians());
    let point = Vector3::new(ray[0], ray[1], 1.0) * depth_mm;
    Some(Isometry3::from_parts(Translation3::from(point - rotation * middle), rotation))
}

/// All markers of a board where a camera sees them in a pose; `None` where one leaves the image.
pub fn seen_markers(camera: &Camera, target: &Target, pose: &Isometry3<f64>) -> Option<Vec<MarkerObservation>> {
    let marker = |(index, point)| Some(MarkerObservation { index, pixel: seen_at(camera, pose, point)?, std_px: 1.0 });
    target.points().into_iter().enumerate().map(marker).collect()
}

/// The pixel of a board point; `None` outside the image.
fn seen_at(camera: &Camera, pose: &Isometry3<f64>, point: [f64; 2]) -> Option<[f64; 2]> {
    let [right, bottom] = [camera.width, camera.height].map(|size| size as f64 - 1.0);
    let [u, v] = camera.project(&(pose * Point3::from(camera.board_point(point))).coords)?;
    (u > 0.0 && v > 0.0 && u < right && v < bottom).then_some([u, v])
}

/// Markers and depth samples that a camera predicts for a pose; `None` where a marker leaves the image.
pub fn predicted_frame(
    camera: &Camera,
    target: &Target,
    pose: &Isometry3<f64>,
    context: &Context,
) -> Option<SampledFrame> {
    let markers = seen_markers(camera, target, pose)?;
    let hull = BoardRegion::new(target).hull().to_vec();
    let span = |i: usize| hull.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, u), p| (l.min(p[i]), u.max(p[i])));
    let (x, y) = (span(0), span(1));
    let coordinate =
        |range: (f64, f64), i: usize| range.0 + (range.1 - range.0) * (i as f64 + 0.5) / SAMPLES_PER_SIDE as f64;
    let mut samples = Vec::new();
    for i in 0..SAMPLES_PER_SIDE {
        for k in 0..SAMPLES_PER_SIDE {
            let board_seed = [coordinate(x, i), coordinate(y, k)];
            let Some(pixel) = seen_at(camera, pose, board_seed) else { continue };
            let depth_mm = (pose * Point3::new(board_seed[0], board_seed[1], 0.0)).z;
            samples.push(DepthSample { context: Context { pixel, ..*context }, depth_mm, board_seed });
        }
    }
    let raw = RawFrame { name: "predicted".to_owned(), ..RawFrame::default() };
    let detected = DetectedFrame { raw, markers, ..DetectedFrame::default() };
    Some(SampledFrame { posed: PosedFrame { detected, camera_from_board: *pose }, samples: samples.into() })
}
