//! Errors of calibrated cameras, of which there may be one, and from one camera to another.

use std::collections::BTreeSet;

use crate::judge::camera::{EvaluatedCamera, evaluate_camera};
use depthcal_io::{DatasetEvaluation, TransferError};

use tracing::warn;

use super::transfer::{Transfer, transfers};
use crate::calibrate::{CalibrateError, Calibrated};
use crate::observe::{CameraCapture, Capture, DroppedFrame, PlacedCamera};
use crate::start::views::numbered_for;

/// Errors of calibrated cameras on a capture.
#[derive(Debug, Clone)]
pub struct Evaluated {
    /// Errors of every camera with images and its name, as those of one camera alone: poses come from its own images.
    pub cameras: Vec<(String, EvaluatedCamera)>,
    /// Errors from every camera with depth to every other one with images.
    pub transfers: Vec<Transfer>,
    /// The dataset's name.
    pub name: String,
}

/// Evaluates cameras on all frames of a capture. They are found by their names; those that the capture does not have are left
/// out.
pub fn evaluate(cameras: &[PlacedCamera], capture: &Capture) -> Evaluated {
    let capture = &*numbered_for(cameras, capture);
    let evaluated = cameras.iter().filter_map(|placed| {
        let seen = capture.cameras.iter().find(|c| c.name == placed.name).filter(|seen| seen.has_markers())?;
        Some((placed, seen, evaluate_camera(&placed.camera, &seen.capture)))
    });
    judged(evaluated.collect(), capture)
}

/// Evaluates calibrated cameras on the frames that they were fitted to.
pub fn evaluate_fitted(fit: &Calibrated) -> Evaluated {
    let (cameras, capture) = (fit.placed(), fit.capture());
    let fitted = cameras.iter().zip(&capture.cameras).zip(&fit.cameras).filter(|(_, camera)| camera.has_markers());
    // The search for a frame's pose starts from the fitted one.
    let evaluated = fitted
        .map(|((placed, seen), camera)| (placed, seen, evaluate_camera(&placed.camera, &camera.calibrated.capture)));
    judged(evaluated.collect(), &capture)
}

/// Errors of cameras in a capture, and between them.
fn judged(cameras: Vec<(&PlacedCamera, &CameraCapture, EvaluatedCamera)>, capture: &Capture) -> Evaluated {
    let (mut both, mut evaluated) = (Vec::new(), Vec::new());
    for (placed, seen, errors) in cameras {
        both.push((placed, seen));
        evaluated.push(EvaluatedCamera { name: part_name(capture, &placed.name), ..errors });
    }
    let transfers = transfers(&both, &evaluated);
    let cameras = both.iter().map(|(placed, _)| placed.name.clone()).zip(evaluated).collect();
    Evaluated { cameras, transfers, name: capture.name.clone() }
}

/// The name of a camera's part of a capture: the capture's, of several cameras with the camera's.
fn part_name(capture: &Capture, camera: &str) -> String {
    match capture.cameras.len() {
        1 => capture.name.clone(),
        _ => format!("{}/{camera}", capture.name),
    }
}

/// A part of the frames without which the others determine nothing.
pub(super) struct NotFitted {
    /// Why.
    pub error: CalibrateError,
    /// The names of its frames by the names of the cameras.
    pub frames: Vec<(String, Vec<String>)>,
}

impl Evaluated {
    /// Adds the errors of all parts of a cross-validation. The frames of a part without which the others do not determine the
    /// `model` (a model or a rig, in words) are dropped with the reason.
    ///
    /// # Errors
    ///
    /// [`CalibrateError`] of a part where no frame is judged.
    pub(super) fn joined(
        mut self,
        parts: Vec<Result<Self, Box<NotFitted>>>,
        model: &str,
    ) -> Result<Self, CalibrateError> {
        let mut failure = None;
        for part in parts {
            match part {
                Ok(part) => self.extend(part),
                Err(failed) => {
                    let NotFitted { error, frames } = *failed;
                    let reason = format!("without its part of the frames the {model} cannot be fitted: {error}");
                    let names: BTreeSet<&String> = frames.iter().flat_map(|(_, names)| names).collect();
                    warn!("{} frames are not judged: {reason}", names.len());
                    for (camera, evaluated) in &mut self.cameras {
                        let camera_frames =
                            frames.iter().filter(|(name, _)| name == camera).flat_map(|(_, names)| names);
                        let dropped =
                            camera_frames.map(|name| DroppedFrame { name: name.clone(), reason: reason.clone() });
                        evaluated.dropped.extend(dropped);
                    }
                    failure = Some(error);
                }
            }
        }
        if let Some(failure) = failure.filter(|_| self.cameras.iter().all(|(_, camera)| camera.frames.is_empty())) {
            return Err(failure);
        }
        self.cameras.iter_mut().for_each(|(_, camera)| camera.frames.sort_by(|a, b| a.name.cmp(&b.name)));
        Ok(self)
    }

    /// No frames of the cameras with images.
    pub(super) fn empty(capture: &Capture) -> Self {
        let cameras = capture.cameras.iter().filter(|camera| camera.has_markers()).map(|camera| {
            let name = part_name(capture, &camera.name);
            (camera.name.clone(), EvaluatedCamera { name, frames: Vec::new(), dropped: Vec::new() })
        });
        Self { cameras: cameras.collect(), transfers: Vec::new(), name: capture.name.clone() }
    }

    /// Adds the errors of other frames of the same rig.
    fn extend(&mut self, other: Self) {
        for (name, camera) in other.cameras {
            match self.cameras.iter_mut().find(|(known, _)| *known == name) {
                Some((_, known)) => {
                    known.frames.extend(camera.frames);
                    known.dropped.extend(camera.dropped);
                }
                None => self.cameras.push((name, camera)),
            }
        }
        for transfer in other.transfers {
            match self.transfers.iter_mut().find(|known| known.from == transfer.from && known.to == transfer.to) {
                Some(known) => known.points.extend(transfer.points),
                None => self.transfers.push(transfer),
            }
        }
    }

    /// The errors of one camera on its dataset, as those of a rig of one.
    pub fn of_camera(camera: &str, evaluated: EvaluatedCamera) -> Self {
        let name = evaluated.name.clone();
        Self { name, cameras: vec![(camera.to_owned(), evaluated)], transfers: Vec::new() }
    }

    /// The errors of a camera; `None` where it has no images, or is not part of the capture.
    pub fn camera(&self, name: &str) -> Option<&EvaluatedCamera> {
        self.cameras.iter().find(|(camera, _)| camera == name).map(|(_, evaluated)| evaluated)
    }

    /// The records of the cameras for `evaluation.json`.
    pub fn records(&self) -> Vec<DatasetEvaluation> {
        self.cameras.iter().map(|(_, evaluated)| evaluated.record()).collect()
    }

    /// The records of the transfer errors for `evaluation.json`.
    pub fn transfer_records(&self) -> Vec<TransferError> {
        self.transfers.iter().map(|transfer| transfer.record(&self.name)).collect()
    }
}
