//! `diagnose` on datasets of several cameras.

use std::path::{Path, PathBuf};

use depthcal_calibration::calibrate::rig::RigOptions;
use depthcal_calibration::diagnose::rig::{
    CameraDiagnosis, EffectInRig, RigDiagnoseOptions, RigDiagnosis, diagnose_rig,
};
use depthcal_calibration::judge::table::table;
use depthcal_calibration::load::Loaded;
use depthcal_calibration::task::RigDiagnosisRecords;
use depthcal_io::{DiagnosisFile, Evaluation, GainInterval};
use depthcal_model::ModelSpec;
use depthcal_report::format::number;
use depthcal_report::{ReportDataset, ReportInput, ReportRig, Role, rig_sentences};
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
    let mut own = Vec::new();
    for (camera, loaded) in found.cameras.iter().zip(&parts) {
        own.push(tell_camera(camera, loaded, asked, verify.is_some(), session, &place.within(&camera.name))?);
        written.push(asked.output.out.join(&camera.name));
    }
    for name in &found.without_depth {
        say!("\n[{name}]\nno depth: not examined");
    }
    print_drifts(&found);
    say!("\nall cameras jointly, with what was added");
    print_rig(&found.last);
    let reference = rig.cameras.first().map(|c| c.reference.clone()).ok_or_else(no_cameras)?;
    let RigDiagnosisRecords { diagnosis: record, calibration, evaluation } =
        RigDiagnosisRecords::new(&found, reference, own).ok_or_else(no_cameras)?;
    say!("\nheld-out frames, with the declared models");
    print_errors(&record.held_out.before);
    say!("\nheld-out frames, with what was added");
    print_errors(&record.held_out.after);
    let file = place.write("diagnosis.json", |path| record.write(path))?;
    let path = place.write("calibration.json", |path| calibration.write(path))?;
    place.write("evaluation.json", |path| evaluation.write(path))?;
    let story = rig_sentences(&record);
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

fn print_drifts(found: &RigDiagnosis) {
    for test in &found.drifts {
        let (camera, over) = (&test.camera, drift_range(test.drift.over, test.drift.range));
        let errors = test.left_out.map_or_else(String::new, |errors| {
            let GainInterval { value, low, high } = errors.gain_percent;
            format!(", the error on left-out frames falls by {value:.1} % (95 %: {low:.1} to {high:.1})")
        });
        let added = if found.has_added(test) { "added" } else { "not added" };
        say!("\nextrinsics_drift of {camera} over {over}: {added}; p = {}{errors}", number(test.p_value));
    }
}

fn print_errors(evaluation: &Evaluation) {
    say!("{}", table(&evaluation.datasets, None));
    print_transfers(&evaluation.transfer);
}
