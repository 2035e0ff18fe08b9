//! Deviations of whole frames: whether they are more than the noise of pixels, of the pose from the image, and of the calibration
//! makes them.

use depthcal_io::{FrameDeviation, WholeFrames};
use depthcal_model::Context;
use depthcal_model::chain::POSE;
use depthcal_model::uncertainty::UncertainDepth;
use depthcal_statistics::{chi_squared_tail, median, quantile, rms};
use nalgebra::{Isometry3, Point3, SVector, Vector3};
use rayon::prelude::*;

use super::camera::{EvaluatedFrame, reprojection};
use super::depth_errors::PixelError;
use crate::calibrate::CalibratedCamera;
use crate::depth_uncertainty::uncertain_depth_of;
use crate::start::PoseInformation;

/// Fewest frames that are tested …
const FEWEST_FRAMES: usize = 8;
/// … and fewest pixels of each.
const FEWEST_PIXELS: usize = 20;
/// Pixels over which the depth of a pose is averaged, at most.
const PIXELS_OF_A_POSE: usize = 25;
/// Deviations up to this multiple of the expected noise are accepted, since that is an estimate itself.
const CLEARLY: f64 = 1.5;

/// The deviations of frames as wholes after correction, each the median of its pixels' errors, against their standard deviations
/// by noise, pose and the calibration `fit`. `None` where the calibration has no depth, or too few frames have enough pixels.
pub fn whole_frames(fit: &CalibratedCamera, frames: &[EvaluatedFrame]) -> Option<WholeFrames> {
    if !fit.with_depth {
        return None;
    }
    // From poses by the image alone: marker noise of a joint fit may contain errors of the depth model.
    let reprojection_px = |f: &EvaluatedFrame| Some(reprojection(f.reprojection.iter())?.rms);
    let sigma_px =
        quantile(frames.iter().filter_map(reprojection_px).filter(|r| *r > 0.0), 0.5) / std::f64::consts::SQRT_2;
    let uncertain = fit.covariance.as_ref().map(|covariance| uncertain_depth_of(fit, covariance, Context::default()));
    let causes = Causes { fit, sigma_px, uncertain };
    let deviations: Vec<FrameDeviation> = frames.par_iter().filter_map(|frame| causes.deviation(frame)).collect();
    if deviations.len() < FEWEST_FRAMES {
        return None;
    }
    let n = deviations.len();
    let relative = |d: &FrameDeviation| d.error_mm / d.std_dev_mm;
    let squares: f64 = deviations.iter().map(|d| (relative(d) / CLEARLY).powi(2)).sum();
    let expected = rms(deviations.iter().map(|d| d.std_dev_mm));
    let measured = rms(deviations.iter().map(|d| d.error_mm));
    let worst = deviations.into_iter().max_by(|a, b| relative(a).abs().total_cmp(&relative(b).abs()))?;
    Some(WholeFrames {
        frames: n,
        p_value: chi_squared_tail(squares, n),
        size_mm: (measured.powi(2) - expected.powi(2)).max(0.0).sqrt(),
        detectable_mm: CLEARLY * expected,
        worst,
    })
}

/// The causes that move a frame as a whole without an error of the model: noise, its pose from the image, and the calibration.
struct Causes<'a> {
    fit: &'a CalibratedCamera,
    /// Noise of a marker, px.
    sigma_px: f64,
    /// Uncertainty of the calibration; `None` where it has no covariance.
    uncertain: Option<UncertainDepth>,
}

impl Causes<'_> {
    /// The deviation of a frame; `None` of too few pixels, or where its standard deviation is unknown.
    fn deviation(&self, frame: &EvaluatedFrame) -> Option<FrameDeviation> {
        let pixels: Vec<&PixelError> = frame.pixels.iter().filter(|p| p.is_usable()).collect();
        if pixels.len() < FEWEST_PIXELS {
            return None;
        }
        let fit = self.fit;
        let of_pose = pose_std(fit, &frame.camera_from_board, &pixels, frame.reprojection.len())?;
        let distance_mm = pixels.iter().map(|p| p.board_depth_mm).sum::<f64>() / pixels.len() as f64;
        let noise = fit.noise.depth.sigma(1.0 / distance_mm) * distance_mm.powi(2);
        let apart = fit.correlation_length_px.unwrap_or(1) as f64;
        // The kept pixels are scattered over all of the frame's: as many are independent as fit their distance, at most all
        // kept.
        let independent = (frame.depth.pixels as f64 / (apart * apart)).min(pixels.len() as f64).max(1.0);
        let parts = [noise / independent.sqrt(), self.sigma_px * of_pose, self.of_fit(pixels[pixels.len() / 2])];
        let std_dev_mm = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
        let error_mm = median(&mut pixels.iter().map(|p| p.after_mm).collect::<Vec<_>>());
        let name = frame.name.clone();
        (std_dev_mm.is_finite() && std_dev_mm > 0.0).then_some(FrameDeviation {
            name,
            distance_mm,
            error_mm,
            std_dev_mm,
        })
    }

    /// Standard deviation of corrected depth at a pixel by the noise of the calibration alone, mm: that by frames with planes of
    /// their own is what is looked for.
    fn of_fit(&self, pixel: &PixelError) -> f64 {
        let by_noise = 1.0 / self.fit.noise.planes.design_effect.sqrt();
        let std_dev = |depth: &UncertainDepth| depth.std_dev(&pixel.context, pixel.board_depth_mm).parameters_mm;
        self.uncertain.as_ref().map_or(0.0, |depth| by_noise * std_dev(depth))
    }
}

/// Standard deviation of the board's mean depth over some pixels, in mm per pixel of marker noise, when the pose comes
/// from the markers.
///
/// With the pose's tangent (ω, τ) the board moves at its point P by n·(R (ω × P) + τ) along its normal n, and the depth on the
/// ray d = (x, y, 1) by this over n·d: the gradient is (P × e₃, n) / n·d.
fn pose_std(fit: &CalibratedCamera, pose: &Isometry3<f64>, pixels: &[&PixelError], markers: usize) -> Option<f64> {
    let points = fit.capture.target.points();
    let information = PoseInformation::of(&fit.camera, pose, &points, &vec![1.0; points.len()])?;
    let normal = pose.rotation * Vector3::z();
    let gradient_at = |[x, y]: [f64; 2]| {
        let point = Point3::new(x, y, 0.0);
        let in_camera = (pose * point).coords;
        let turn = point.coords.cross(&Vector3::z());
        let [turn, shift] = [turn, normal].map(|part| part * in_camera.z / normal.dot(&in_camera));
        SVector::<f64, POSE>::from_fn(|i, _| if i < 3 { turn[i] } else { shift[i - 3] })
    };
    let seen: Vec<_> =
        pixels.iter().step_by(pixels.len().div_ceil(PIXELS_OF_A_POSE)).map(|p| gradient_at(p.board)).collect();
    let mean = seen.iter().sum::<SVector<f64, POSE>>() / seen.len() as f64;
    // As if the found markers were spread like all markers.
    let share = points.len() as f64 / markers.max(1) as f64;
    let std_dev = information.std_dev(mean) * share.sqrt();
    (std_dev > 0.0).then_some(std_dev)
}

#[cfg(all(test, feature = "simulate"))]
mod tests {
    use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

    use super::*;
    use crate::calibrate::{CameraOptions, calibrate_camera};
    use crate::judge::camera::evaluate_camera;
    use crate::simulated;

    /// Noise alone makes no frame stand out; one that is moved by ten standard deviations does, with its distance moved.
    #[test]
    fn a_frame_that_is_off_as_a_whole_is_found() {
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 3).frames(12);
        let capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        let fit = calibrate_camera(&capture, &CameraOptions::default()).unwrap();
        let mut frames = evaluate_camera(&fit.camera, &fit.capture).frames;
        let clean = whole_frames(&fit, &frames).unwrap();
        assert!(clean.frames == 12 && clean.p_value > 0.05, "{clean:?}");
        // Of fitted frames most of what the pose could do is in the fit.
        assert!(clean.worst.error_mm.abs() < 3.0 * clean.worst.std_dev_mm, "{clean:?}");
        let shift_mm = 10.0 * clean.worst.std_dev_mm;
        frames[5].pixels.iter_mut().for_each(|pixel| pixel.after_mm += shift_mm);
        let moved = whole_frames(&fit, &frames).unwrap();
        assert!(moved.p_value < 1e-6 && moved.worst.name == frames[5].name, "{moved:?}");
        assert!((moved.worst.error_mm - shift_mm).abs() < 3.0 * moved.worst.std_dev_mm, "{moved:?}");
        // One frame of twelve: the root mean square is its deviation over √12.
        assert!((moved.size_mm / (shift_mm / 12_f64.sqrt()) - 1.0).abs() < 0.3, "{moved:?}");
        assert!(whole_frames(&fit, &frames[..FEWEST_FRAMES - 1]).is_none());
    }
}
