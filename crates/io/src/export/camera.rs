//! Calibrations in the formats of other programs.
//!
//! All of them share depthcal's conventions: x right, y down, z forward, the centre of the first pixel at (0, 0), and
//! Brown–Conrady distortion in the order k1 k2 p1 p2 k3. What a format cannot hold comes back as an [`ExportWarning`].

mod kalibr;
mod mrcal;
mod opencv;
mod ros;
mod text;

use std::str::FromStr;

use depthcal_model::hook::HookKind;

use crate::{Calibration, PieceRecord};

pub use kalibr::kalibr_camchain;
pub use mrcal::mrcal_cameramodel;
pub use opencv::opencv_yaml;
pub use ros::ros_camera_info;

/// A camera as other programs know it, with what they do not know beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportCamera {
    /// Width of the image in px.
    pub width: usize,
    /// Height of the image in px.
    pub height: usize,
    /// Focal length in x, px.
    pub fx: f64,
    /// Focal length in y, px.
    pub fy: f64,
    /// Principal point, px.
    pub cx: f64,
    /// Principal point, px.
    pub cy: f64,
    /// Skew, px.
    pub skew: f64,
    /// Brown–Conrady k1 k2 p1 p2 k3.
    pub distortion: [f64; 5],
    /// Pieces that say how the depth image deviates: all at the hook `depth`, and at `pixel` beside the pinhole.
    pub depth: Vec<PieceRecord>,
    /// Pieces of the lens beside Brown–Conrady.
    pub lens: Vec<PieceRecord>,
}

/// A format of another program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExportFormat {
    /// OpenCV's FileStorage, YAML.
    OpenCv,
    /// ROS camera_info, YAML.
    Ros,
    /// Kalibr's camchain, YAML.
    Kalibr,
    /// mrcal's .cameramodel.
    Mrcal,
}

/// The text of a file, and what it does not hold.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    /// The contents of the file.
    pub text: String,
    /// What was lost, to be shown to the user.
    pub warnings: Vec<ExportWarning>,
}

/// Something that a format, or the programs that read it, cannot represent.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportWarning {
    /// The skew of the pinhole.
    #[error("{format} has no skew: {value} px is {}", if *.written { "written but ignored" } else { "left out" })]
    Skew {
        /// Name of the format.
        format: &'static str,
        /// The skew, px.
        value: f64,
        /// Whether the file holds it all the same.
        written: bool,
    },
    /// A coefficient of the lens.
    #[error(
        "{format} has no {coefficient}: {value} is left out, and the other coefficients do not make up for it; \
         calibrate with {coefficient} held at 0 for this format"
    )]
    Distortion {
        /// Name of the format.
        format: &'static str,
        /// Name of the coefficient.
        coefficient: &'static str,
        /// Its value.
        value: f64,
    },
    /// Pieces of the lens beside Brown–Conrady.
    #[error("{format} has no place for the lens pieces {}: pixels will be off where they matter", pieces.join(", "))]
    Lens {
        /// Name of the format.
        format: &'static str,
        /// Names of the pieces.
        pieces: Vec<String>,
    },
    /// The model of the depth error.
    #[error("{format} has no depth model: {} left out; correct depth images with calibration.json", pieces.join(", "))]
    Depth {
        /// Name of the format.
        format: &'static str,
        /// Names of the pieces.
        pieces: Vec<String>,
    },
}

/// Why a camera cannot be exported.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The calibration has no pinhole, or not all of its parameters.
    #[error("the calibration has no parameter `pinhole.{parameter}`: export needs a pinhole camera; calibrate anew")]
    NoPinhole {
        /// The parameter that is missing.
        parameter: &'static str,
    },
    /// A number that is NaN or infinite, or an image without pixels.
    #[error("the camera's `{field}` is {value}: export needs finite numbers, and a size and focal lengths above 0")]
    Value {
        /// The field.
        field: String,
        /// Its value.
        value: f64,
    },
    /// A format that is not known.
    #[error("unknown format \"{name}\": use opencv, ros, kalibr or mrcal")]
    UnknownFormat {
        /// The name that was given.
        name: String,
    },
}

impl FromStr for ExportFormat {
    type Err = ExportError;

    fn from_str(name: &str) -> Result<Self, ExportError> {
        match name {
            "opencv" => Ok(ExportFormat::OpenCv),
            "ros" => Ok(ExportFormat::Ros),
            "kalibr" => Ok(ExportFormat::Kalibr),
            "mrcal" => Ok(ExportFormat::Mrcal),
            _ => Err(ExportError::UnknownFormat { name: name.to_owned() }),
        }
    }
}

impl ExportCamera {
    /// The camera of a calibration. Without a piece `brown_conrady` the distortion is 0; pieces of board and pose are
    /// no part of a camera.
    ///
    /// # Errors
    /// [`ExportError::NoPinhole`] where there is no piece `pinhole` with fx, fy, cx and cy.
    pub fn from_calibration(calibration: &Calibration) -> Result<Self, ExportError> {
        let pinhole = |parameter| calibration.value("pinhole", parameter).ok_or(ExportError::NoPinhole { parameter });
        let lens = |parameter| calibration.value("brown_conrady", parameter).unwrap_or(0.0);
        let others = |hook, known: &str| {
            calibration.pieces_at(hook).filter(|piece| piece.name != known).cloned().collect::<Vec<_>>()
        };
        let mut depth = others(HookKind::Pixel, "pinhole");
        depth.extend(others(HookKind::Depth, ""));
        Ok(ExportCamera {
            width: calibration.camera.width,
            height: calibration.camera.height,
            fx: pinhole("fx")?,
            fy: pinhole("fy")?,
            cx: pinhole("cx")?,
            cy: pinhole("cy")?,
            skew: calibration.value("pinhole", "skew").unwrap_or(0.0),
            distortion: ["k1", "k2", "p1", "p2", "k3"].map(lens),
            depth,
            lens: others(HookKind::Lens, "brown_conrady"),
        })
    }

    /// Writes the camera in `format`.
    ///
    /// # Errors
    /// [`ExportError::Value`] for numbers that are not finite, and for a size or focal length of 0 or less.
    pub fn export(&self, format: ExportFormat) -> Result<Export, ExportError> {
        match format {
            ExportFormat::OpenCv => opencv_yaml(self),
            ExportFormat::Ros => ros_camera_info(self),
            ExportFormat::Kalibr => kalibr_camchain(self),
            ExportFormat::Mrcal => mrcal_cameramodel(self),
        }
    }

    fn check(&self) -> Result<(), ExportError> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let of_camera = [
            ("width", self.width as f64, self.width > 0),
            ("height", self.height as f64, self.height > 0),
            ("fx", self.fx, positive(self.fx)),
            ("fy", self.fy, positive(self.fy)),
            ("cx", self.cx, self.cx.is_finite()),
            ("cy", self.cy, self.cy.is_finite()),
            ("skew", self.skew, self.skew.is_finite()),
        ];
        let fault = |field: String, value: f64| Err(ExportError::Value { field, value });
        if let Some((field, value, _)) = of_camera.into_iter().find(|(.., good)| !good) {
            return fault(field.into(), value);
        }
        if let Some(value) = self.distortion.into_iter().find(|value| !value.is_finite()) {
            return fault("distortion".into(), value);
        }
        for piece in self.lens.iter().chain(&self.depth) {
            let parameters = piece.parameters.iter().map(|parameter| (&parameter.name, parameter.value));
            let options = piece.options.iter().map(|(name, value)| (name, *value));
            if let Some((name, value)) = parameters.chain(options).find(|(_, value)| !value.is_finite()) {
                return fault(format!("{}.{name}", piece.name), value);
            }
        }
        Ok(())
    }

    /// Warnings that every format shares whose files hold no skew and no pieces.
    fn losses(&self, format: &'static str) -> Vec<ExportWarning> {
        let mut warnings = Vec::new();
        if self.skew != 0.0 {
            warnings.push(ExportWarning::Skew { format, value: self.skew, written: false });
        }
        warnings.extend(self.lens_loss(format));
        if !self.depth.is_empty() {
            warnings.push(ExportWarning::Depth { format, pieces: names(&self.depth) });
        }
        warnings
    }

    fn lens_loss(&self, format: &'static str) -> Option<ExportWarning> {
        (!self.lens.is_empty()).then(|| ExportWarning::Lens { format, pieces: names(&self.lens) })
    }
}

fn names(pieces: &[PieceRecord]) -> Vec<String> {
    pieces.iter().map(|piece| piece.name.clone()).collect()
}

#[cfg(test)]
mod tests;
