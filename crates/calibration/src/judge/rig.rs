//! Evaluation of a rig.

use crate::judge::evaluate::{Evaluated, evaluate};
use depthcal_io::{DatasetEvaluation, TransferError};

use super::transfer::{Transfer, transfers};
use crate::observe::PlacedCamera;
use crate::observe::RigCapture;

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
    let both = rig.iter().filter_map(|placed| {
        let own = capture.cameras.iter().find(|c| c.name == placed.name)?;
        own.has_markers().then_some((placed, own))
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

impl EvaluatedRig {
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
