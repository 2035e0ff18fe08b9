//! `diagnose` on datasets of several cameras.

use std::path::{Path, PathBuf};

use depthcal_calibration::judge::table::table;
use depthcal_calibration::load::Loaded;
use depthcal_io::{
    DiagnosisFile, Evaluation, GainInterval, RigCameraDiagnosis, RigDiagnosisFile, RigDriftTest, RigEffect, RigHeldOut,
    RigLeftOut,
};
use depthcal_model::{ModelSpec, PieceSpec};
use depthcal_report::format::number;
use depthcal_report::{ReportDataset, ReportInput, ReportRig, Role, verdict_sentence};
use depthcal_rig::RigOptions;
use depthcal_rig::diagnose::{
    CameraDiagnosis, DriftTest, EffectInRig, LeftOutErrors, RigDiagnoseOptions, RigDiagnosis, diagnose_rig,
};
use depthcal_rig::judge::EvaluatedRig;
use depthcal_rig::record::{drift_record, rig_record};
use serde_json::{Value, json};

use super::calibrate::add_effects;
use super::load::load;
use super::print::{drift_range, print_rig, print_transfers};
use crate::common::{Output, Reading, command_line, frames_of, value_of};
use crate::diagnosis_output::{Told, tell};
use crate::failure::Failure;
use crate::results::{Place, Results};
use crate::session::Session;
use crate::voice::say;

/// What `diagnose` was asked for, in the terms of a rig.
pub(crate) struct RigDiagnose<'a> {
    pub dataset: &'a Path,
    pub verify: Option<&'a Path>,
    /// As it was written, and read.
    pub model: (&'a str, ModelSpec),
    pub with: &'a [String],
    pub lens: Option<&'a str>,
    pub folds: usize,
    pub formulas: bool,
    pub reading: &'a Reading,
    pub output: &'a Output,
}

/// Diagnoses every camera of a rig that has depth, and adjusts all jointly again.
pub(crate) fn diagnose(asked: &RigDiagnose<'_>, session: &Session) -> Result<Value, Failure> {
    asked.output.check()?;
    let rig = load(asked.dataset, asked.reading, session)?;
    let verify = asked.verify.map(|path| load(path, asked.reading, session)).transpose()?;
    let mut options =
        RigOptions { each: session.calibrate_options(), lens: asked.lens.map(str::to_owned), ..RigOptions::default() };
    options.each.model.clone_from(&asked.model.1);
    let names: Vec<&str> = rig.capture.cameras.iter().map(|c| c.name.as_str()).collect();
    add_effects(asked.with, &rig, &mut options)?;
    let options = RigDiagnoseOptions {
        rig: options,
        folds: asked.folds,
        formulas: asked.formulas,
        ..RigDiagnoseOptions::default()
    };
    let found = diagnose_rig(&rig.capture, verify.as_ref().map(|v| &v.capture), &options)?;
    let results = Results::begin(&asked.output.out)?;
    let place = results.place();
    let mut written: Vec<PathBuf> = Vec::new();
    let parts = rig_parts(&found, &rig.cameras, &names);
    let mut cameras = Vec::new();
    for (camera, loaded) in found.cameras.iter().zip(&parts) {
        let own = tell_camera(camera, loaded, asked, verify.is_some(), session, &place.within(&camera.name))?;
        cameras.push(record_of(camera, own));
        written.push(asked.output.out.join(&camera.name));
    }
    for name in &found.without_depth {
        say!("\n[{name}]\nno depth: not examined");
    }
    print_drifts(&found);
    say!("\nall cameras jointly, with what was added");
    print_rig(&found.last);
    say!("\nheld-out frames, with the declared models");
    let before = print_errors(&found.before);
    say!("\nheld-out frames, with what was added");
    let after = print_errors(&found.after);
    let reference = rig.cameras.first().map(|c| c.reference.clone()).ok_or_else(no_cameras)?;
    let record = RigDiagnosisFile {
        dataset: reference.clone(),
        verdict: found.verdict,
        cameras,
        without_depth: found.without_depth.clone(),
        extrinsics_drift: found.drifts.iter().map(|test| drift_record_of(test, &found)).collect(),
        held_out: RigHeldOut { before, after: after.clone() },
    };
    let file = place.write("diagnosis.json", |path| record.write(path))?;
    let calibration = rig_record(&found.last, &found.fitted, reference).ok_or_else(no_cameras)?;
    let path = place.write("calibration.json", |path| calibration.write(path))?;
    let evaluation = evaluation_of(&found.fitted, "");
    let evaluation = Evaluation {
        datasets: evaluation.datasets.into_iter().chain(after.datasets).collect(),
        transfer: evaluation.transfer.into_iter().chain(after.transfer).collect(),
    };
    place.write("evaluation.json", |path| evaluation.write(path))?;
    let story: Vec<String> = record
        .cameras
        .iter()
        .map(|c| format!("{}: {} (its own report is in the folder {0}).", c.camera, verdict_sentence(&c.diagnosis)))
        .collect();
    let shown: Vec<ReportDataset<'_>> = [(&found.fitted, Role::Fitted), (&found.after, Role::HeldOut)]
        .into_iter()
        .filter_map(|(rig, role)| rig.cameras.first().map(|evaluated| ReportDataset { evaluated, role }))
        .collect();
    let report = ReportInput {
        title: rig.dataset.name.clone(),
        command_line: command_line(),
        stages: session.progress.stage_times(),
        calibrated: found.last.cameras.first().map(|camera| &camera.calibrated),
        evaluations: &shown,
        diagnosis: None,
        story: &story,
    };
    let placed = found.last.placed();
    let shown = ReportRig { cameras: &placed, record: &calibration, evaluated: &[&found.fitted, &found.after] };
    let report = place.write_rig_report(&report, &shown, session)?;
    results.commit("calibration.json", session)?;
    say!("written: {} and {}", file.display(), report.display());
    written.extend([file, path, report]);
    let frames: Vec<Value> = found
        .last
        .cameras
        .iter()
        .map(|c| frames_of(&c.name, c.calibrated.capture.frames.len(), &c.calibrated.capture.dropped))
        .collect();
    Ok(json!({ "frames": frames, "diagnosis": value_of(&record)?, "written": written }))
}

fn no_cameras() -> Failure {
    Failure::Input("the dataset declares no cameras".to_owned())
}

/// The camera's own findings, and its files in a folder of its name; returns the record that these have.
fn tell_camera(
    camera: &CameraDiagnosis,
    loaded: &Loaded,
    asked: &RigDiagnose<'_>,
    verified: bool,
    session: &Session,
    place: &Place<'_>,
) -> Result<DiagnosisFile, Failure> {
    say!("\n[{}]", camera.name);
    if camera.poses_from_others {
        say!("the poses of the board are those of the other cameras");
    }
    let d = &camera.diagnosis;
    let fitted = session.evaluate(&d.last.camera, &d.last.capture);
    let told = Told {
        title: format!("{}/{}", loaded.capture.name, camera.name),
        command_line: command_line(),
        model: asked.model.0,
        verified: verified && !camera.poses_from_others,
        story: Vec::new(),
    };
    let (record, _) = tell(d, &fitted, loaded, told, session, place)?;
    for EffectInRig { spec, left_out } in &camera.in_rig {
        let GainInterval { value, low, high } = left_out.gain_percent;
        say!(
            "{spec} was missing and was added in the joint adjustment: the error on left-out frames falls by {value:.1} % (95 %: {low:.1} to \
             {high:.1}); the diagnosis above is given it"
        );
    }
    for spec in &camera.not_adjusted {
        say!("{spec} is not part of the joint adjustment of the rig");
    }
    Ok(record)
}

/// The loaded part of every diagnosed camera.
fn rig_parts<'a>(found: &RigDiagnosis, loaded: &'a [Loaded], names: &[&str]) -> Vec<&'a Loaded> {
    let of =
        |camera: &CameraDiagnosis| names.iter().zip(loaded).find(|(name, _)| **name == camera.name).map(|(_, l)| l);
    found.cameras.iter().filter_map(of).collect()
}

/// Whether a drift is part of the last rig.
fn is_added(test: &DriftTest, found: &RigDiagnosis) -> bool {
    let camera = found.last.camera(&test.camera);
    camera.and_then(|c| c.drift).is_some_and(|(drift, _)| drift.over == test.drift.over)
}

fn drift_record_of(test: &DriftTest, found: &RigDiagnosis) -> RigDriftTest {
    RigDriftTest {
        camera: test.camera.clone(),
        drift: drift_record((test.drift, test.std_devs)),
        p_value: test.p_value,
        left_out: test.left_out.map(left_out_record),
        added: is_added(test, found),
    }
}

fn print_drifts(found: &RigDiagnosis) {
    for test in &found.drifts {
        let (camera, over) = (&test.camera, drift_range(test.drift.over, test.drift.range));
        let errors = test.left_out.map_or_else(String::new, |errors| {
            let GainInterval { value, low, high } = errors.gain_percent;
            format!(", the error on left-out frames falls by {value:.1} % (95 %: {low:.1} to {high:.1})")
        });
        let added = if is_added(test, found) { "added" } else { "not added" };
        say!("\nextrinsics_drift of {camera} over {over}: {added}; p = {}{errors}", number(test.p_value));
    }
}

fn record_of(camera: &CameraDiagnosis, diagnosis: DiagnosisFile) -> RigCameraDiagnosis {
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

fn evaluation_of(rig: &EvaluatedRig, suffix: &str) -> Evaluation {
    let (mut datasets, mut transfer) = (rig.records(), rig.transfer_records());
    datasets.iter_mut().for_each(|d| d.name += suffix);
    transfer.iter_mut().for_each(|t| t.dataset += suffix);
    Evaluation { datasets, transfer }
}

fn print_errors(rig: &EvaluatedRig) -> Evaluation {
    let evaluation = evaluation_of(rig, " (held out)");
    say!("{}", table(&evaluation.datasets, None));
    print_transfers(&evaluation.transfer);
    evaluation
}
