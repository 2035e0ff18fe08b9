//! A camera to be exported.

use depthcal_model::hook::HookKind;
use depthcal_model::{Block, Camera};

use super::error::ExportError;
use super::outcome::ExportWarning;
use crate::record::{Calibration, PieceRecord};

/// A camera in the terms of other programs, and the pieces beyond these terms.
#[derive(Debug, Clone)]
pub struct ExportCamera {
    /// Pinhole and lens.
    pub camera: Camera,
    /// Pieces of the depth image: all at the hook `depth`, and those at the hook `pixel` other than the pinhole.
    pub depth: Vec<PieceRecord>,
}

impl ExportCamera {
    /// The camera of a calibration: `camera` as it was made of `calibration`. Pieces of board and pose do not belong to the
    /// camera and are left out.
    pub fn new(camera: &Camera, calibration: &Calibration) -> Self {
        let camera = camera.filtered(|b| b.hook() == HookKind::Lens);
        let of_depth = |piece: &&PieceRecord| {
            piece.hook == HookKind::Depth || (piece.hook == HookKind::Pixel && piece.name != "pinhole")
        };
        Self { camera, depth: calibration.camera.pieces.iter().filter(of_depth).cloned().collect() }
    }

    /// Checks that all numbers are finite, and size and focal lengths positive.
    pub(super) fn check(&self) -> Result<(), ExportError> {
        let fault = |field: String, value: f64| Err(ExportError::Value { field, value });
        let camera = &self.camera;
        for (field, size) in [("width", camera.width), ("height", camera.height)] {
            if size == 0 {
                return fault(field.into(), 0.0);
            }
        }
        let values = |b: &Block| -> Vec<(String, f64)> {
            b.parameters().iter().zip(&b.theta).map(|(p, v)| (format!("{}.{}", b.name(), p.name), *v)).collect()
        };
        for (field, value) in camera.blocks().iter().flat_map(values) {
            let is_length = field == "pinhole.fx" || field == "pinhole.fy";
            if !value.is_finite() || (is_length && value <= 0.0) {
                return fault(field, value);
            }
        }
        for piece in &self.depth {
            let parameters = piece.parameters.iter().map(|parameter| (&parameter.name, parameter.value));
            let options = piece.options.iter().map(|(name, value)| (name, *value));
            if let Some((name, value)) = parameters.chain(options).find(|(_, value)| !value.is_finite()) {
                return fault(format!("{}.{name}", piece.name), value);
            }
        }
        Ok(())
    }

    /// The warning of a format whose files hold no depth model, where there is one.
    pub(super) fn depth_loss(&self, format: &'static str) -> Option<ExportWarning> {
        let pieces = self.depth.iter().map(|piece| piece.name.clone()).collect();
        (!self.depth.is_empty()).then_some(ExportWarning::Depth { format, pieces })
    }
}
