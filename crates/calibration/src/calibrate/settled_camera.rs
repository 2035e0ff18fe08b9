//! One camera's part of a settled adjustment.

use depthcal_statistics::rms;

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::CameraOptions;
use super::residuals::depth_residuals;
use super::settle::Settled;
use crate::observe::AdjustableFrame;

impl<F: AdjustableFrame> Settled<F> {
    /// The only camera of the adjustment.
    pub fn only_camera(self, options: &CameraOptions) -> CalibratedCamera<F> {
        self.camera(0, options)
    }

    /// A camera's part, as if it had been calibrated alone.
    pub fn camera(&self, number: usize, options: &CameraOptions) -> CalibratedCamera<F> {
        let (camera, adjusted) = (&self.state.cameras[number], &self.adjusted.cameras[number]);
        let blocks = self.state.parameter_rows()[number].blocks.clone();
        let covariance = self
            .covariance
            .as_ref()
            .map(|covariance| covariance.view((blocks.start, blocks.start), (blocks.len(), blocks.len())).into_owned());
        let with_depth = self.with_depth && camera.has_depth();
        let depth = || depth_residuals(camera, adjusted).into_iter().map(|r| r.depth_mm);
        CalibratedCamera {
            covariance,
            foreign_depth: Vec::new(),
            noise: camera.noise,
            with_depth,
            correlation_length_px: camera.correlation_length_px,
            outliers: camera.outliers,
            lens_choice: None,
            lens_comparison: None,
            smoothness: camera.smoothness.clone(),
            prior: camera.prior.clone(),
            reprojection_rms_px: self.reprojection_rms_px(number),
            depth_rms_mm: with_depth.then(|| rms(depth())),
            cost: self.adjusted.report.cost,
            iterations: self.adjusted.report.iterations,
            termination: self.adjusted.report.termination.to_string(),
            estimator: options.estimator,
            model: options.model.clone(),
            camera: camera.camera.clone(),
            capture: camera.capture.clone(),
        }
    }

    /// Root mean square distance between a camera's markers and their projections, px.
    fn reprojection_rms_px(&self, number: usize) -> f64 {
        let (camera, adjusted) = (&self.state.cameras[number], &self.adjusted.cameras[number]);
        let pixel_sigma = self.weighted_by[number].pixel_sigma;
        let stds = camera.capture.frames.iter().flat_map(|f| f.posed().markers.iter().map(|m| m.std_px * pixel_sigma));
        let squares = adjusted.image_residuals.chunks_exact(2).zip(stds);
        let (sum, n) = squares.fold((0.0, 0), |(s, n), (r, std)| (s + (r[0] * r[0] + r[1] * r[1]) * std * std, n + 1));
        (sum / f64::from(n.max(1))).sqrt()
    }
}
