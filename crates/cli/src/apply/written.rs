//! Files that `apply` writes: the formats of corrected depth and of clouds, and depth corrected for them.

use std::path::Path;

use clap::{Args, ValueEnum};
use depthcal_correction::{CorrectionSummary, Corrector, CorrectorError, FrameContext, PointsMut};
use depthcal_io::{Cloud, DepthFrame, DepthImage, DepthValues, FileError, write_pcd, write_ply};

use super::uncertainty::UncertaintyFiles;

/// Format of corrected depth images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum DepthFormat {
    /// 16-bit grey PNG.
    Png,
    /// 16-bit PGM.
    Pgm,
    /// TIFF of 16-bit or 32-bit floating-point values.
    Tiff,
    /// NPY of 16-bit or 32-bit floating-point values.
    Npy,
    /// OpenEXR, 32-bit floating-point values in the channel Z.
    Exr,
}

/// Format of point clouds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum CloudFormat {
    /// Binary PLY.
    Ply,
    /// Binary PCD of the Point Cloud Library.
    Pcd,
}

impl CloudFormat {
    pub(super) fn extension(self) -> &'static str {
        match self {
            CloudFormat::Ply => "ply",
            CloudFormat::Pcd => "pcd",
        }
    }

    pub(super) fn write(self, path: &Path, cloud: &Cloud) -> Result<(), FileError> {
        match self {
            CloudFormat::Ply => write_ply(path, cloud),
            CloudFormat::Pcd => write_pcd(path, cloud),
        }
    }
}

/// Options of what is written.
#[derive(Debug, Args)]
pub(super) struct Written {
    /// Also writes a point cloud of every frame in mm, with the image's values as intensity where there is an image: --cloud
    /// (PLY) or --cloud=pcd.
    #[arg(long, value_name = "FORMAT", value_enum, num_args = 0..=1, require_equals = true, default_missing_value = "ply")]
    pub(super) cloud: Option<CloudFormat>,
    /// Format of the corrected images [default: that of the originals; NPY for NPZ].
    #[arg(long, value_name = "FORMAT", value_enum)]
    format: Option<DepthFormat>,
    /// Writes 32-bit floating-point values in the unit of the originals, not rounded to its steps (TIFF, NPY, EXR).
    #[arg(long)]
    float: bool,
    #[command(flatten)]
    pub(super) uncertainty: UncertaintyFiles,
}

impl Written {
    /// Extension of the corrected image of `depth`.
    pub(super) fn extension(&self, depth: &Path) -> String {
        let extension = || depth.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        match self.format {
            Some(DepthFormat::Png) => "png".into(),
            Some(DepthFormat::Pgm) => "pgm".into(),
            Some(DepthFormat::Tiff) => "tiff".into(),
            Some(DepthFormat::Npy) => "npy".into(),
            Some(DepthFormat::Exr) => "exr".into(),
            None => match extension().as_str() {
                "npz" => "npy".into(),
                "pnm" => "pgm".into(),
                extension @ ("png" | "pgm" | "tif" | "tiff" | "npy" | "exr") => extension.into(),
                _ => "png".into(),
            },
        }
    }

    /// Corrects depth in units of `unit_mm`, into the type of values that is written. Floating-point pixels without a measurement
    /// keep their value; what cannot be corrected is 0.
    pub(super) fn correct(
        &self,
        depth: &DepthFrame,
        unit_mm: f64,
        corrector: &Corrector,
        context: &FrameContext<'_>,
    ) -> Result<(DepthFrame, CorrectionSummary), CorrectorError> {
        let DepthFrame { width, height, .. } = *depth;
        let in_units = |mm: Vec<f32>| mm.into_iter().map(|z| (f64::from(z) / unit_mm) as f32).collect::<Vec<f32>>();
        let (values, summary) = match &depth.values {
            DepthValues::Steps(data) => {
                let measured = DepthImage { width, height, data: data.clone() };
                if self.float {
                    let mut mm = vec![0.0; data.len()];
                    let summary = corrector.correct_u16_to_f32(&measured, unit_mm, context, &mut mm)?;
                    (DepthValues::Float(in_units(mm)), summary)
                } else {
                    let mut out = measured.clone();
                    let summary = corrector.correct_u16(&measured, unit_mm, context, &mut out)?;
                    (DepthValues::Steps(out.data), summary)
                }
            }
            DepthValues::Float(raw) => {
                let mut mm = millimetres(depth, unit_mm);
                let summary = corrector.correct_f32_in_place(&mut mm, context)?;
                let mut values = in_units(mm);
                for (i, value) in values.iter_mut().enumerate() {
                    if depth.measurement(i).is_none() {
                        *value = raw[i];
                    }
                }
                (DepthValues::Float(values), summary)
            }
        };
        Ok((DepthFrame { width, height, values }, summary))
    }
}

/// Measurements in mm, 0 where there is none.
pub(super) fn millimetres(depth: &DepthFrame, unit_mm: f64) -> Vec<f32> {
    (0..depth.len()).map(|i| depth.measurement(i).map_or(0.0, |raw| (raw * unit_mm) as f32)).collect()
}

/// The corrected points of all pixels, mm; NaN where there is no depth.
pub(super) fn points_of(
    depth: &DepthFrame,
    unit_mm: f64,
    corrector: &Corrector,
    context: &FrameContext<'_>,
) -> Result<Vec<[f32; 3]>, CorrectorError> {
    let mut points = vec![[f32::NAN; 3]; depth.len()];
    let out = PointsMut::Interleaved(points.as_flattened_mut());
    match &depth.values {
        DepthValues::Steps(data) => {
            let image = DepthImage { width: depth.width, height: depth.height, data: data.clone() };
            corrector.correct_to_points(&image, unit_mm, context, out)?;
        }
        DepthValues::Float(_) => {
            let mut mm = millimetres(depth, unit_mm);
            corrector.correct_f32_in_place(&mut mm, context)?;
            corrector.points_f32_into(&mm, out)?;
        }
    }
    Ok(points)
}
