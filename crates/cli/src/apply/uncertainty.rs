//! Further images that `apply` writes: the standard deviation of corrected depth, and where the calibration is supported.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use depthcal_correction::{Corrector, FrameContext};
use depthcal_io::{DepthFrame, DepthValues, FileError, GrayImage, write_depth_frame, write_gray};

use crate::failure::{Failure, input};

/// Which of these files are written.
#[derive(Debug, Args)]
pub(super) struct UncertaintyFiles {
    /// Also writes the standard deviation of every corrected depth, mm, as sigma/NAME.tiff (32-bit floating-point, NaN without
    /// depth): noise of the pixel and uncertainty of the calibration's parameters.
    #[arg(long)]
    uncertainty: bool,
    /// Also writes where the calibration is supported, as mask/NAME.png: 255 where boards were seen there and at such depths, 128
    /// where it extrapolates, 0 without depth.
    #[arg(long)]
    mask: bool,
}

impl UncertaintyFiles {
    /// Whether any is written.
    pub(super) fn any(&self) -> bool {
        self.uncertainty || self.mask
    }

    fn sigma_of(&self, corrected: &Path) -> Option<PathBuf> {
        self.uncertainty.then(|| beside(corrected, "sigma", "tiff"))
    }

    fn mask_of(&self, corrected: &Path) -> Option<PathBuf> {
        self.mask.then(|| beside(corrected, "mask", "png"))
    }

    /// The files that belong to the corrected image `corrected`.
    pub(super) fn paths(&self, corrected: &Path) -> Vec<PathBuf> {
        self.sigma_of(corrected).into_iter().chain(self.mask_of(corrected)).collect()
    }

    /// Writes them for depth as measured, mm, 0 where there is none.
    pub(super) fn write(
        &self,
        mut measured_mm: Vec<f32>,
        corrector: &Corrector,
        context: &FrameContext<'_>,
        corrected: &Path,
    ) -> Result<(), Failure> {
        let (width, height) = (corrector.width(), corrector.height());
        for folder in self.paths(corrected).iter().filter_map(|file| file.parent()) {
            fs::create_dir_all(folder).map_err(|error| input(FileError::Write { path: folder.to_owned(), error }))?;
        }
        if let Some(path) = self.sigma_of(corrected) {
            let mut sigma_mm = vec![f32::NAN; measured_mm.len()];
            corrector.uncertainty_f32(&measured_mm, &mut sigma_mm).map_err(input)?;
            let image = DepthFrame { width, height, values: DepthValues::Float(sigma_mm) };
            write_depth_frame(path, &image).map_err(input)?;
        }
        if let Some(path) = self.mask_of(corrected) {
            corrector.correct_f32_in_place(&mut measured_mm, context).map_err(input)?;
            let mut mask = vec![0; measured_mm.len()];
            corrector.support(&measured_mm, &mut mask).map_err(input)?;
            let data = mask.into_iter().map(u16::from).collect();
            write_gray(path, &GrayImage { width, height, data, bits: 8 }).map_err(input)?;
        }
        Ok(())
    }
}

/// The path in `folder`, a folder next to a corrected image, of the file with the image's name and another extension.
fn beside(corrected: &Path, folder: &str, extension: &str) -> PathBuf {
    let name = corrected.file_name().unwrap_or_default();
    corrected.with_file_name(folder).join(name).with_extension(extension)
}
