//! Evaluation of a rig.

use std::collections::BTreeSet;

use crate::judge::evaluate::{Evaluated, evaluate};
use depthcal_io::{DatasetEvaluation, TransferError};

use tracing::warn;

use super::transfer::{Transfer, transfers};
use crate::calibrate::CalibrateError;
use crate::observe::{DroppedFrame, PlacedCamera, RigCapture};
use crate::start::views::numbered_for;

/// Errors of a rig on a capture.
#[derive(Debug, Clone)]
pub struct EvaluatedRig {
    /// Errors of every camera with images and its name, as those of one camera alone: poses come from its own images.
    pub cameras: Vec<(String, Evaluated)>,
    /// Errors from every camera with depth to every other one with images.
    pub transfers: Vec<Transfer>,
    /// The dataset's name.
    pub name: String,
}

/// Evaluates a rig on all frames of a capture. Cameras are found by their names; those that the capture does not have are left
/// out.
pub fn evaluate_rig(rig: &[PlacedCamera], capture: &RigCapture) -> EvaluatedRig {
    let capture = &*numbered_for(rig, capture);
    let both = rig.iter().filter_map(|placed| {
        let camera = capture.cameras.iter().find(|c| c.name == placed.name)?;
        camera.has_markers().then_some((placed, camera))
    });
    let both: Vec<_> = both.collect();
    let evaluated: Vec<Evaluated> = both
        .iter()
        .map(|(placed, own)| {
            let mut evaluated = evaluate(&placed.camera, &own.capture);
            evaluated.name = format!("{}/{}", capture.name, placed.name);
            evaluated
        })
        .collect();
    let transfers = transfers(&both, &evaluated);
    let cameras = both.iter().map(|(placed, _)| placed.name.clone()).zip(evaluated).collect();
    EvaluatedRig { cameras, transfers, name: capture.name.clone() }
}

/// A part of the frames without which the others determine nothing.
pub(super) struct NotFitted {
    /// Why.
    pub error: CalibrateError,
    /// The names of its frames by the names of the cameras.
    pub frames: Vec<(String, Vec<String>)>,
}

impl EvaluatedRig {
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
    pub(super) fn empty(capture: &RigCapture) -> Self {
        let cameras = capture.cameras.iter().filter(|camera| camera.has_markers()).map(|camera| {
            let name = format!("{}/{}", capture.name, camera.name);
            (camera.name.clone(), Evaluated { name, frames: Vec::new(), dropped: Vec::new() })
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
    pub fn of_camera(camera: &str, evaluated: Evaluated) -> Self {
        let name = evaluated.name.clone();
        Self { name, cameras: vec![(camera.to_owned(), evaluated)], transfers: Vec::new() }
    }

    /// The errors of a camera; `None` where it has no images, or is not part of the capture.
    pub fn camera(&self, name: &str) -> Option<&Evaluated> {
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
