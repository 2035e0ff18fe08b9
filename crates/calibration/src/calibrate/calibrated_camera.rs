//! A calibrated camera with everything that is known about its fit.

use std::sync::Arc;

use depthcal_io::LensComparison;
use depthcal_model::{Camera, ModelSpec};
use nalgebra::DMatrix;

use super::camera_options::Estimator;
use super::foreign_depth::ForeignDepth;
use super::lens_order::LensChoice;
use crate::adjust::camera_prior::CameraPrior;
use crate::adjust::smoothness_prior::Smoothness;
use crate::observe::noise::NoiseModel;
use crate::observe::{CameraFrames, PosedFrame, SampledFrame};

/// Relative standard deviation of a focal length from which on it is not known: where frames determine it, it is ten times less.
const UNKNOWN: f64 = 0.03;

/// A calibrated camera with everything that is known about the fit. Frames are at the stage that was fitted: sampled, or
/// only posed where the images alone were adjusted.
#[derive(Debug, Clone)]
pub struct CalibratedCamera<F = SampledFrame> {
    /// The camera.
    pub camera: Camera,
    /// The fitted data: frames with their poses and the depth samples that were used. Frames that turned out unusable are among
    /// its dropped.
    pub capture: CameraFrames<F>,
    /// Frames among the dropped whose depth belongs to another pose, or whose board has another size.
    pub foreign_depth: Vec<ForeignDepth>,
    /// Joint covariance of [`Camera::theta`]; zero for held parameters. `None` from the estimators that give none.
    pub covariance: Option<DMatrix<f64>>,
    /// Noise, from the residuals.
    pub noise: NoiseModel,
    /// Whether depth took part.
    pub with_depth: bool,
    /// Distance at which the noise of depth pixels is uncorrelated, px.
    pub correlation_length_px: Option<usize>,
    /// Depth samples that were left out as outliers.
    pub outliers: usize,
    /// How the order of the lens was chosen; `None` where the markers determine it over the whole image, or where it was asked
    /// for.
    pub lens_choice: Option<LensChoice>,
    /// The lens models that were compared, where the lens was to be chosen.
    pub lens_comparison: Option<LensComparison>,
    /// Fields of the depth model: how rough they may be, what determines them.
    pub smoothness: Smoothness,
    /// The prior of the camera's parameters from other units, where one was used.
    pub prior: Option<Arc<CameraPrior>>,
    /// Reprojection error: root mean square distance, px.
    pub reprojection_rms_px: f64,
    /// Root mean square of the depth residuals at the samples, mm.
    pub depth_rms_mm: Option<f64>,
    /// Final cost, iterations and the solver's words.
    pub cost: f64,
    /// Iterations of the last adjustment.
    pub iterations: usize,
    /// Why it stopped.
    pub termination: String,
    /// The options' names, for the record.
    pub estimator: Estimator,
    /// Depth model as asked for.
    pub model: ModelSpec,
}

impl<F> CalibratedCamera<F> {
    /// Standard deviation of every parameter in the order of [`Camera::theta`]; `None` for held ones.
    pub fn std_devs(&self) -> Vec<Option<f64>> {
        let free = self.camera.blocks().iter().flat_map(|b| b.free.iter().copied());
        free.enumerate()
            .map(|(i, free)| {
                let variance = self.covariance.as_ref().map(|c| c[(i, i)])?;
                (free && variance > 0.0).then(|| variance.sqrt())
            })
            .collect()
    }

    /// The focal length fx and its standard deviation, px; `None` where it is held.
    pub fn focal_length(&self) -> Option<[f64; 2]> {
        let (_, range) = self.camera.blocks_with_ranges().find(|(block, _)| block.piece().is_none())?;
        let std_dev = (*self.std_devs().get(range.start)?)?;
        Some([self.camera.pinhole()[0], std_dev])
    }

    /// The focal length fx and its standard deviation, px, where that is more than 3 % of it.
    pub fn unknown_focal_length(&self) -> Option<[f64; 2]> {
        self.focal_length().filter(|[fx, std_dev]| *std_dev > UNKNOWN * fx)
    }
}

impl CalibratedCamera<PosedFrame> {
    /// This fit with frames that have no depth samples.
    pub(super) fn without_samples(self) -> CalibratedCamera {
        let sampled = |posed| SampledFrame { posed, samples: Arc::default() };
        let mut capture = self.capture.with_frames(Vec::new());
        capture.frames = self.capture.frames.into_iter().map(sampled).collect();
        CalibratedCamera {
            capture,
            camera: self.camera,
            foreign_depth: self.foreign_depth,
            covariance: self.covariance,
            noise: self.noise,
            with_depth: self.with_depth,
            correlation_length_px: self.correlation_length_px,
            outliers: self.outliers,
            lens_choice: self.lens_choice,
            lens_comparison: self.lens_comparison,
            smoothness: self.smoothness,
            prior: self.prior,
            reprojection_rms_px: self.reprojection_rms_px,
            depth_rms_mm: self.depth_rms_mm,
            cost: self.cost,
            iterations: self.iterations,
            termination: self.termination,
            estimator: self.estimator,
            model: self.model,
        }
    }
}
