//! Results of a rig's diagnosis that concern its cameras together.

use depthcal_io::{
    Calibration, DiagnosedCamera as CameraRecord, Evaluation, FileReference, RigDriftTest, RigEffect, RigFindings,
    RigHeldOut,
};
use depthcal_model::PieceSpec;

use super::diagnosed_camera::DiagnosedCamera;
use super::evaluated::{evaluation_of, extend};
use crate::calibration_record::{calibration_record, drift_record};
use crate::diagnose::rig::{DriftTest, EffectInRig};
use crate::diagnose::{CameraInRig, RigDiagnosis};

/// The cameras of a rig, diagnosed and adjusted jointly again.
pub struct DiagnosedRig {
    /// Findings, without the cameras' own diagnoses.
    pub found: RigDiagnosis,
    /// `calibration.json`: the last rig.
    pub calibration: Calibration,
    /// `evaluation.json`: errors of the last rig on fitted and on held-out frames.
    pub evaluation: Evaluation,
}

impl DiagnosedRig {
    /// `reference` is the dataset.
    pub(super) fn new(found: RigDiagnosis, reference: FileReference) -> Self {
        let fit = |name: &str| found.last.camera(name).map(|camera| &camera.calibrated);
        let mut evaluation = evaluation_of(&found.fitted, "", fit);
        extend(&mut evaluation, evaluation_of(&found.after, " (held out)", fit));
        let calibration = calibration_record(&found.last, &found.fitted, reference, None);
        Self { found, calibration, evaluation }
    }

    /// The findings for `diagnosis.json`.
    pub(super) fn findings(&self) -> RigFindings {
        let of_rig = |rig| evaluation_of(rig, " (held out)", |_| None);
        let [before, after] = [&self.found.before, &self.found.after].map(of_rig);
        RigFindings {
            without_depth: self.found.without_depth.clone(),
            extrinsics_drift: self.found.drifts.iter().map(|test| test_record(test, &self.found)).collect(),
            held_out: RigHeldOut { before, after },
        }
    }
}

impl RigDiagnosis {
    /// Whether the drift of a test is part of the last rig.
    pub fn has_added(&self, test: &DriftTest) -> bool {
        let drift = self.last.camera(&test.camera).and_then(|camera| camera.drift);
        drift.is_some_and(|(drift, _)| drift.over == test.drift.over)
    }
}

fn test_record(test: &DriftTest, found: &RigDiagnosis) -> RigDriftTest {
    RigDriftTest {
        camera: test.camera.clone(),
        drift: drift_record((test.drift, test.std_devs)),
        p_value: test.p_value,
        left_out: test.left_out,
        added: found.has_added(test),
    }
}

/// The record of a camera of a rig.
pub(super) fn diagnosed_record(name: &str, camera: &DiagnosedCamera) -> CameraRecord {
    let texts = |specs: &[PieceSpec]| specs.iter().map(ToString::to_string).collect();
    let shown = |effect: &EffectInRig| RigEffect { effect: effect.spec.to_string(), left_out: effect.left_out };
    let CameraInRig { poses_from_others, of_board, before, effects } = camera.in_rig.clone().unwrap_or_default();
    CameraRecord {
        camera: name.to_owned(),
        poses_from_others,
        effects: texts(&effects),
        of_board: texts(&of_board),
        in_rig: before.iter().map(shown).collect(),
        diagnosis: camera.record.clone(),
    }
}
