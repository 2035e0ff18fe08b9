//! The result of a capture's diagnosis.

use depthcal_io::Verdict;
use depthcal_model::{PieceSpec, Register};

use super::diagnosis::CameraDiagnosis;
use super::rig::{DriftTest, EffectInRig};
use crate::calibrate::Calibrated;
use crate::judge::evaluate::Evaluated;

/// Diagnosis of a capture: the effects that the models of its cameras lack.
pub struct Diagnosis {
    /// The worst of the cameras' verdicts.
    pub verdict: Verdict,
    /// The cameras with depth.
    pub cameras: Vec<DiagnosedCamera>,
    /// Of several cameras, the findings on all together.
    pub rig: Option<RigDiagnosis>,
}

/// Diagnosis of one camera of a capture.
pub struct DiagnosedCamera {
    /// The camera.
    pub name: String,
    /// The loop's result on its frames. Those of a camera without images have projected markers.
    pub diagnosis: CameraDiagnosis,
    /// The register with the formulas that were found.
    pub register: Register,
    /// Of one of several cameras, what the joint adjustment with the others showed.
    pub in_rig: Option<CameraInRig>,
}

/// Findings on one camera from the joint adjustment of its rig.
#[derive(Debug, Clone, Default)]
pub struct CameraInRig {
    /// Whether the poses of the board come from the other cameras, because this one has no images.
    pub poses_from_others: bool,
    /// Effects of the board that other cameras show, and that the loop is given.
    pub of_board: Vec<PieceSpec>,
    /// Of a camera without images, effects that the joint adjustment showed, in which its pinhole and place are free; the loop is
    /// given these.
    pub before: Vec<EffectInRig>,
    /// The effects that the joint adjustment took over, as for `calibrate --with`.
    pub effects: Vec<PieceSpec>,
}

/// Diagnosis of several cameras together: drifts of their extrinsics, and the joint adjustment with all effects.
pub struct RigDiagnosis {
    /// Cameras that have no depth, and are not examined.
    pub without_depth: Vec<String>,
    /// Whether places change with time or temperature, given the effects that were added.
    pub drifts: Vec<DriftTest>,
    /// The rig with all effects, fitted to all frames but those that a diagnosis left out.
    pub last: Calibrated,
    /// Errors of the last rig on the frames that it was fitted to.
    pub fitted: Evaluated,
    /// Errors of the declared models on frames that the rig was not fitted to.
    pub before: Evaluated,
    /// Errors on these frames with the effects and drifts that were added.
    pub after: Evaluated,
}

impl Diagnosis {
    /// The camera of this name.
    pub fn camera(&self, name: &str) -> Option<&DiagnosedCamera> {
        self.cameras.iter().find(|camera| camera.name == name)
    }
}

impl DiagnosedCamera {
    /// The effects that the last model has in addition to the declared one, as for `calibrate --with`.
    pub fn effects(&self) -> Vec<&PieceSpec> {
        match &self.in_rig {
            Some(in_rig) => in_rig.effects.iter().collect(),
            None => self.diagnosis.steps.iter().map(|step| &step.spec).collect(),
        }
    }

    /// The verdict of the loop, and of what the joint adjustment showed before.
    pub fn verdict(&self) -> Verdict {
        let before = self.in_rig.iter().flat_map(|in_rig| &in_rig.before).map(|_| Verdict::Effect);
        worst(before.chain([self.diagnosis.verdict]))
    }
}

/// The worst of some verdicts: unexplained structure, effects, nothing.
pub(super) fn worst(verdicts: impl Iterator<Item = Verdict>) -> Verdict {
    verdicts.fold(Verdict::Adequate, |worst, verdict| match (worst, verdict) {
        (Verdict::Unexplained, _) | (_, Verdict::Unexplained) => Verdict::Unexplained,
        (Verdict::Effect, _) | (_, Verdict::Effect) => Verdict::Effect,
        _ => Verdict::Adequate,
    })
}
