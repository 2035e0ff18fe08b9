//! Calibrations of camera and lens from the images alone, shared by all variants with the same lens model.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::variants::Variant;
use crate::calibrate::{
    CalibrateError, CalibratedCamera, CameraOptions, calibrate_depth, calibrate_image, readjust_part,
};
use crate::observe::{CameraFrames, PosedFrame};

/// The frames of a fit, and their calibration from the images by lens model.
pub(super) struct ImageCalibrations {
    /// The frames.
    pub capture: CameraFrames,
    /// Calibration from the images, or why there is none, by the name of the lens model.
    pub by_lens: BTreeMap<String, Result<CalibratedCamera<PosedFrame>, String>>,
}

impl ImageCalibrations {
    /// Calibrates a capture from its images with each lens model of `lenses`.
    pub fn new(capture: CameraFrames, lenses: &[&str], base: &CameraOptions) -> Self {
        let calibrated = |lens: &&str| {
            let options = CameraOptions { lens: (*lens).to_owned(), ..base.clone() };
            ((*lens).to_owned(), calibrate_image(&capture, &options).map_err(|e| e.to_string()))
        };
        let by_lens = lenses.par_iter().map(calibrated).collect();
        Self { capture, by_lens }
    }

    /// Fits a variant's depth model on top of the calibration from the images.
    pub fn fit(&self, variant: &Variant, base: &CameraOptions) -> Result<CalibratedCamera, String> {
        calibrate_depth(self.image(variant)?, &variant.options(base)).map_err(|e: CalibrateError| e.to_string())
    }
    /// Fits a variant's depth model on top of the calibration from the images, where `whole` is its fit to these and further
    /// frames: with the samples of that, and from its depth model.
    pub fn fit_part(
        &self,
        whole: &CalibratedCamera,
        variant: &Variant,
        base: &CameraOptions,
    ) -> Result<CalibratedCamera, String> {
        if variant.is_of_markers() {
            return self.fit(variant, base);
        }
        let image = self.image(variant)?;
        readjust_part(image, whole, &variant.options(base)).map_err(|e| e.to_string())
    }

    fn image(&self, variant: &Variant) -> Result<CalibratedCamera<PosedFrame>, String> {
        self.by_lens.get(&variant.lens).cloned().unwrap_or_else(|| Err("no such lens".to_owned()))
    }
}
