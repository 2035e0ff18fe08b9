//! A camera to be exported.

use depthcal_model::hook::HookKind;

use super::error::ExportError;
use super::outcome::ExportWarning;
use crate::record::{Calibration, PieceRecord};

/// A camera in the terms of other programs (pinhole and Brown–Conrady), and the pieces beyond these terms.
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
    /// Column of the principal point, px.
    pub cx: f64,
    /// Row of the principal point, px.
    pub cy: f64,
    /// Skew, px.
    pub skew: f64,
    /// Brown–Conrady k1 k2 p1 p2 k3.
    pub distortion: [f64; 5],
    /// Pieces of the depth image: all at the hook `depth`, and those at the hook `pixel` other than the pinhole.
    pub depth: Vec<PieceRecord>,
    /// Pieces of the lens other than Brown–Conrady.
    pub lens: Vec<PieceRecord>,
}

impl ExportCamera {
    /// The camera of a calibration. Without a piece `brown_conrady` the distortion is 0. Pieces of board and pose do
    /// not belong to the camera and are left out.
    ///
    /// # Errors
    /// [`ExportError::NoPinhole`] when there is no piece `pinhole` with fx, fy, cx and cy.
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

    /// Checks that all numbers are finite, and size and focal lengths positive.
    pub(super) fn check(&self) -> Result<(), ExportError> {
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

    /// The warnings of a format whose files hold neither skew nor pieces.
    pub(super) fn losses(&self, format: &'static str) -> Vec<ExportWarning> {
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

    /// The warning about pieces of the lens, where there are any.
    pub(super) fn lens_loss(&self, format: &'static str) -> Option<ExportWarning> {
        (!self.lens.is_empty()).then(|| ExportWarning::Lens { format, pieces: names(&self.lens) })
    }
}

/// Names of pieces.
pub(super) fn names(pieces: &[PieceRecord]) -> Vec<String> {
    pieces.iter().map(|piece| piece.name.clone()).collect()
}
