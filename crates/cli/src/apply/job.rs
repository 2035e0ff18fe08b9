//! One frame of `apply`.

use std::path::{Path, PathBuf};

use depthcal_correction::Corrector;
use depthcal_io::{DepthFrame, Disparity, GrayImage, check_same_size, read_depth_frame, read_gray};
use depthcal_model::Quantities;

use super::images::read_color;
use crate::failure::{Failure, input};

/// A depth image to be corrected, with the other images and the conditions of its frame.
pub(super) struct Job {
    pub(super) depth: PathBuf,
    pub(super) image: Option<PathBuf>,
    pub(super) color: Option<PathBuf>,
    pub(super) unit_mm: f64,
    /// How the disparities in the file become depth in mm.
    pub(super) disparity: Option<Disparity>,
    pub(super) time_s: Option<f64>,
    pub(super) temperature_c: Option<f64>,
    pub(super) quantities: Quantities,
}

impl Job {
    /// Everything that its results depend on, besides the calibration, the settings and the contents of its files.
    pub(super) fn key(&self) -> String {
        let Self { depth, image, color, unit_mm, disparity, time_s, temperature_c, quantities } = self;
        format!("{depth:?} {image:?} {color:?} {unit_mm} {disparity:?} {time_s:?} {temperature_c:?} {quantities:?}")
    }

    /// Its files.
    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        std::iter::once(&self.depth).chain(&self.image).chain(&self.color).map(PathBuf::as_path)
    }

    /// Reads the depth image and, where there is one, the infrared image; checks their sizes and the colour image.
    pub(super) fn read(&self, corrector: &Corrector) -> Result<(DepthFrame, Option<GrayImage>), Failure> {
        let depth = read_depth_frame(&self.depth).map_err(input)?;
        let depth = match &self.disparity {
            Some(disparity) => disparity.depth(&depth),
            None => depth.check_unit(&self.depth, self.unit_mm).map(|()| depth).map_err(input)?,
        };
        if (depth.width, depth.height) != (corrector.width(), corrector.height()) {
            return Err(Failure::Input(format!(
                "{}: the depth image has {}×{} px, but the calibration is for {}×{} px: give images of the calibrated \
                 camera at its full resolution",
                self.depth.display(),
                depth.width,
                depth.height,
                corrector.width(),
                corrector.height()
            )));
        }
        if let Some(color) = &self.color {
            read_color(color, [depth.width, depth.height])?;
        }
        let Some(path) = &self.image else { return Ok((depth, None)) };
        let image = read_gray(path).map_err(input)?;
        check_same_size((path, [image.width, image.height]), (&self.depth, [depth.width, depth.height]))
            .map_err(input)?;
        Ok((depth, Some(image)))
    }
}
