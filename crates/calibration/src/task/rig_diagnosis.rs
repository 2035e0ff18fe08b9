//! What a diagnosis of a rig writes: the command line and the Python package give the same files because they share this module.

use depthcal_io::{
    Calibration, DiagnosisFile, Evaluation, FileReference, RigCameraDiagnosis, RigDiagnosisFile, RigDriftTest,
    RigEffect, RigHeldOut, RigLeftOut,
};
use depthcal_model::PieceSpec;

use crate::diagnose::rig::DriftTest;
use crate::diagnose::rig::EffectInRig;
use crate::diagnose::rig::LeftOutErrors;
use crate::diagnose::rig::{CameraDiagnosis, RigDiagnosis};
use crate::rig_record::{drift_record, rig_record};
use crate::task::rig::{evaluation_of, extend};

/// The records of a diagnosis, of all cameras together.
#[derive(Debug, Clone)]
pub struct RigDiagnosisRecords {
    /// `diagnosis.json`.
    pub diagnosis: RigDiagnosisFile,
    /// `calibration.json`: the last rig.
    pub calibration: Calibration,
    /// `evaluation.json`: errors of the last rig on fitted and on held-out frames.
    pub evaluation: Evaluation,
}

impl RigDiagnosisRecords {
    /// The records of `found`. `reference` is the dataset, `own` are the records of the cameras' own diagnoses, in the order of
    /// `found.cameras`. `None` where the rig has no cameras.
    pub fn new(found: &RigDiagnosis, reference: FileReference, own: Vec<DiagnosisFile>) -> Option<Self> {
        let [before, after] = [&found.before, &found.after].map(|rig| evaluation_of(&[rig], " (held out)"));
        let mut evaluation = evaluation_of(&[&found.fitted], "");
        extend(&mut evaluation, after.clone());
        let diagnosis = RigDiagnosisFile {
            dataset: reference.clone(),
            verdict: found.verdict,
            cameras: found.cameras.iter().zip(own).map(|(camera, own)| camera_record(camera, own)).collect(),
            without_depth: found.without_depth.clone(),
            extrinsics_drift: found.drifts.iter().map(|test| test_record(test, found)).collect(),
            held_out: RigHeldOut { before, after },
        };
        let calibration = rig_record(&found.last, &found.fitted, reference)?;
        Some(Self { diagnosis, calibration, evaluation })
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
        left_out: test.left_out.map(left_out_record),
        added: found.has_added(test),
    }
}

fn camera_record(camera: &CameraDiagnosis, diagnosis: DiagnosisFile) -> RigCameraDiagnosis {
    let texts = |specs: &[PieceSpec]| specs.iter().map(ToString::to_string).collect();
    let shown = |effect: &EffectInRig| RigEffect {
        effect: effect.spec.to_string(),
        left_out: left_out_record(effect.left_out),
    };
    RigCameraDiagnosis {
        camera: camera.name.clone(),
        poses_from_others: camera.poses_from_others,
        effects: texts(&camera.effects),
        not_adjusted: texts(&camera.not_adjusted),
        in_rig: camera.in_rig.iter().map(shown).collect(),
        diagnosis,
    }
}

fn left_out_record(LeftOutErrors { before, after, gain_percent }: LeftOutErrors) -> RigLeftOut {
    RigLeftOut { before, after, gain_percent }
}
