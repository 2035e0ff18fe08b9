//! Frames of one camera that contradict each other, since they are of two cameras, or of one at two zooms. Markers alone hardly
//! show it: poses take a wrong focal length up. Depth does, and then markers are further off than in any frame alone.

use depthcal_statistics::upper_median;
use nalgebra::{Matrix3, Vector2};

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::CameraOptions;
use super::error::CalibrateError;
use super::frame_checks::markers_of;
use super::frame_contradiction::{AgreeingFrames, FrameContradiction};
use super::image::calibrate_image;
use crate::observe::{CameraFrames, DetectedFrame, MarkerObservation, PosedFrame};
use crate::start::{FEWEST_FRAMES, FrameMarkers, HomographyFit, estimate_pose, fit_homography};

/// Noise of markers in the fit of all frames, over that about a homography of each, from which on two cameras are looked for.
const DOUBTED: f64 = 2.0;
/// Noise in the fits of two groups to the markers alone, over that of all frames, up to which they are of two cameras.
const LESS: f64 = 0.75;
/// Relative standard deviation of a focal length up to which one frame says something of its camera.
const KNOWN: f64 = 0.1;
/// Ratio of two focal lengths from which on they are of two cameras.
const LEAST_RATIO: f64 = 1.03;
/// Shares of the frames, by their own focal lengths, with which the search for two groups begins.
const SHARES: [f64; 3] = [0.5, 0.25, 0.75];
/// Most rounds in which frames change their group.
const ROUNDS: usize = 5;

/// Refuses a fit of frames that are of two cameras.
///
/// # Errors
///
/// [`CalibrateError::FrameContradiction`].
pub(crate) fn check_frames_agree(
    capture: &CameraFrames,
    fit: &CalibratedCamera,
    options: &CameraOptions,
) -> Result<(), CalibrateError> {
    let alone = |frame: &DetectedFrame| Some(fit_homography(&capture.target, &markers_of(frame)).ok()?.rms_px);
    let alone_px = upper_median(&mut capture.frames.iter().filter_map(alone).collect::<Vec<_>>());
    if alone_px.is_none_or(|alone_px| fit.noise.pixel_sigma <= DOUBTED * alone_px) {
        return Ok(());
    }
    let Ok(from_image) = calibrate_image(capture, options) else { return Ok(()) };
    match SHARES.into_iter().find_map(|share| groups(&from_image, share, options)) {
        Some(groups) => {
            let joint_px = from_image.noise.pixel_sigma;
            Err(CalibrateError::FrameContradiction(Box::new(FrameContradiction { joint_px, groups })))
        }
        None => Ok(()),
    }
}

/// Two groups of frames, each of which is of one camera. They begin with a share of the frames, by the focal lengths that single
/// ones tell; then every frame goes to the group in whose camera its reprojection error is less, until none changes.
fn groups(
    from_image: &CalibratedCamera<PosedFrame>,
    share: f64,
    options: &CameraOptions,
) -> Option<[AgreeingFrames; 2]> {
    let capture = &from_image.capture;
    let frames: Vec<DetectedFrame> = capture.frames.iter().map(|frame| frame.detected.clone()).collect();
    let focal_px = |frame: &DetectedFrame| focal_length(&without_lens(frame, from_image)?, from_image);
    let focal_px: Vec<Option<f64>> = frames.iter().map(focal_px).collect();
    let mut known: Vec<f64> = focal_px.iter().flatten().copied().collect();
    known.sort_by(f64::total_cmp);
    let middle_px = *known.get((share * known.len() as f64) as usize)?;
    let mut of_group: Vec<Option<bool>> = focal_px.iter().map(|focal| focal.map(|focal| focal >= middle_px)).collect();
    for _ in 0..ROUNDS {
        let fit_of = |group: bool| {
            let of_group = frames.iter().zip(&of_group).filter(|(_, g)| **g == Some(group));
            let of_group: Vec<DetectedFrame> = of_group.map(|(frame, _)| frame.clone()).collect();
            let is_enough = of_group.len() >= FEWEST_FRAMES;
            is_enough.then(|| calibrate_image(&capture.with_frames(of_group), options).ok()).flatten()
        };
        let fits = [fit_of(false)?, fit_of(true)?];
        let nearer = |frame: &DetectedFrame| {
            let error = |fit: &CalibratedCamera<PosedFrame>| {
                let pose = estimate_pose(&fit.camera, &capture.target, &markers_of(frame));
                pose.map_or(f64::MAX, |pose| pose.rms_px)
            };
            Some(error(&fits[1]) < error(&fits[0]))
        };
        let next: Vec<Option<bool>> = frames.iter().map(nearer).collect();
        if next == of_group {
            return two_cameras(&frames, &of_group, &fits, LESS * from_image.noise.pixel_sigma);
        }
        of_group = next;
    }
    None
}

/// The groups of frames, where the noise of both fits is at most `most_px` and their focal lengths differ.
fn two_cameras(
    frames: &[DetectedFrame],
    of_group: &[Option<bool>],
    fits: &[CalibratedCamera<PosedFrame>; 2],
    most_px: f64,
) -> Option<[AgreeingFrames; 2]> {
    let names = |group: bool| {
        let of_group = frames.iter().zip(of_group).filter(move |(_, g)| **g == Some(group));
        of_group.map(|(frame, _)| frame.name.clone()).collect()
    };
    let group = |number: usize| AgreeingFrames {
        focal_px: fits[number].camera.pinhole()[0],
        noise_px: fits[number].noise.pixel_sigma,
        frames: names(number == 1),
    };
    let mut groups = [group(0), group(1)];
    groups.sort_by(|a, b| a.focal_px.total_cmp(&b.focal_px));
    let are_far = groups[1].focal_px > LEAST_RATIO * groups[0].focal_px;
    (are_far && groups.iter().all(|group| group.noise_px <= most_px)).then_some(groups)
}

/// The homography of a frame's markers without the lens of a fit.
fn without_lens(frame: &DetectedFrame, fit: &CalibratedCamera<PosedFrame>) -> Option<HomographyFit> {
    let [fx, fy, cx, cy, _] = fit.camera.pinhole();
    let straight = |marker: &MarkerObservation| {
        let [x, y] = fit.camera.ray(marker.pixel, 0.0).ok()?;
        Some(MarkerObservation { pixel: [fx * x + cx, fy * y + cy], ..*marker })
    };
    let markers: Option<Vec<MarkerObservation>> = frame.markers.iter().map(straight).collect();
    fit_homography(&fit.capture.target, &FrameMarkers { name: &frame.name, markers: &markers? }).ok()
}

/// The focal length, px, that one homography tells of a camera with square pixels and the principal point of a fit (Zhang 2000,
/// section 3.1), where it tells it to within [`KNOWN`].
fn focal_length(fit: &HomographyFit, camera: &CalibratedCamera<PosedFrame>) -> Option<f64> {
    let [_, _, cx, cy, _] = camera.camera.pinhole();
    let middle = Vector2::new(cx, cy);
    let of_matrix = |h: &Matrix3<f64>| {
        let column = |i: usize| (Vector2::new(h[(0, i)], h[(1, i)]) - middle * h[(2, i)], h[(2, i)]);
        let ((a, a3), (b, b3)) = (column(0), column(1));
        // aᵀb / f² + a₃ b₃ = 0 and (|a|² − |b|²) / f² + a₃² − b₃² = 0, by least squares.
        let rows = [[a.dot(&b), a3 * b3], [a.norm_squared() - b.norm_squared(), a3 * a3 - b3 * b3]];
        let [normal, right] =
            [rows[0][0].powi(2) + rows[1][0].powi(2), -(rows[0][0] * rows[0][1] + rows[1][0] * rows[1][1])];
        let focal = (normal / right).sqrt();
        focal.is_finite().then_some(focal)
    };
    let focal = of_matrix(&fit.matrix)?;
    let change = |deviation: &Matrix3<f64>| Some((of_matrix(&(fit.matrix + fit.rms_px * deviation))? - focal).powi(2));
    let variance: f64 = fit.deviations.iter().map(change).sum::<Option<f64>>()?;
    (variance.sqrt() < KNOWN * focal).then_some(focal)
}

#[cfg(all(test, feature = "simulate"))]
mod tests {
    use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

    use super::*;
    use crate::calibrate::{CalibrateOptions, calibrate};
    use crate::observe::Capture;
    use crate::simulated;

    fn capture(seed: u64) -> CameraFrames {
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 700 + seed);
        simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap())
    }

    /// Every second frame is enlarged about the middle of the image by 12 %.
    #[test]
    fn frames_of_two_zooms_are_told_apart() {
        for seed in [0, 1] {
            let mut capture = capture(seed);
            let fit = |capture: &CameraFrames| {
                calibrate(&Capture::of_camera("camera", capture.clone()), &CalibrateOptions::default())
            };
            assert!(fit(&capture).is_ok());
            let middle = [(capture.width as f64 - 1.0) / 2.0, (capture.height as f64 - 1.0) / 2.0];
            let mut enlarged = Vec::new();
            for frame in capture.frames.iter_mut().step_by(2) {
                enlarged.push(frame.name.clone());
                for marker in &mut frame.markers {
                    marker.pixel = [0, 1].map(|i| middle[i] + 1.12 * (marker.pixel[i] - middle[i]));
                }
            }
            let contradiction = match fit(&capture) {
                Err(CalibrateError::FrameContradiction(contradiction)) => contradiction,
                other => panic!("seed {seed}: {:?}", other.map(|_| ()).map_err(|error| error.to_string())),
            };
            let [shorter, longer] = &contradiction.groups;
            // A board that is hardly tilted is nearly alike under both focal lengths.
            let is_right =
                |frame: &&DetectedFrame| enlarged.contains(&frame.name) == longer.frames.contains(&frame.name);
            let right = capture.frames.iter().filter(is_right).count();
            assert!(10 * right >= 8 * capture.frames.len(), "seed {seed}, {right} frames right: {contradiction}");
            assert!((longer.focal_px / shorter.focal_px / 1.12 - 1.0).abs() < 0.03, "seed {seed}: {contradiction}");
        }
    }
}
