//! The words of a diagnosis.

use std::path::{Path, PathBuf};

use depthcal_calibration::calibrate::CalibratedCamera;
use depthcal_calibration::diagnose::RigDiagnosis;
use depthcal_calibration::diagnose::rig::EffectInRig;
use depthcal_calibration::judge::table::table;
use depthcal_calibration::task::{Diagnosed, DiagnosedCamera, DiagnosedRig, Made};
use depthcal_io::{Evaluation, GainInterval, RigFindings};
use depthcal_report::format::{count, interval, number, percent};
use depthcal_report::{Detail, diagnosis_text};
use serde_json::{Value, json};

use super::common::{frames_of, value_of};
use super::failure::Failure;
use super::parameters::{drift_range, print_cameras};
use super::results::save;
use super::session::Session;
use super::transfers::print_transfers;
use super::voice::say;

/// Prints a diagnosis and has its files written into a folder: record, calibration of the last model, errors, report; `record`
/// writes what lies elsewhere. Returns what `--json` prints.
pub(super) fn tell(
    diagnosed: &Diagnosed,
    made: &Made,
    out: &Path,
    session: &Session,
    record: impl FnOnce() -> Result<Option<PathBuf>, Failure>,
) -> Result<Value, Failure> {
    match diagnosed.only_camera() {
        Some(camera) => print_camera(camera),
        None => diagnosed.cameras.iter().for_each(|(name, camera)| print_camera_of_rig(name, camera)),
    }
    if let (Some(rig), Some(findings)) = (&diagnosed.rig, &diagnosed.record.rig) {
        print_together(rig, findings);
    }
    let recording = save(diagnosed, made, out, session, record)?;
    let mut written: Vec<PathBuf> = Vec::new();
    for (name, camera) in &diagnosed.cameras {
        match diagnosed.rig {
            Some(_) => {
                tell_files(camera, &out.join(name));
                written.push(out.join(name));
            }
            None => written.extend(tell_files(camera, out)),
        }
    }
    if diagnosed.rig.is_some() {
        let files = ["diagnosis.json", "calibration.json", "report.html"].map(|name| out.join(name));
        say!("written: {} and {}", files[0].display(), files[2].display());
        written.extend(files);
    }
    written.extend(recording);
    let used =
        |name: &str, result: &CalibratedCamera| frames_of(name, result.capture.frames.len(), &result.capture.dropped);
    let frames = match (&diagnosed.rig, diagnosed.only_camera()) {
        (Some(rig), _) => {
            json!(rig.found.last.cameras.iter().map(|c| used(&c.name, &c.calibrated)).collect::<Vec<_>>())
        }
        (None, Some(camera)) => {
            let last = &camera.diagnosis.last;
            let mut frames = used(&last.capture.name, last);
            frames["left_out"] = value_of(&camera.record.bad_frames)?;
            frames
        }
        (None, None) => json!([]),
    };
    Ok(json!({ "frames": frames, "diagnosis": value_of(&diagnosed.record)?, "written": written }))
}

/// Names the files of a camera's diagnosis in a folder, and returns their paths.
fn tell_files(camera: &DiagnosedCamera, folder: &Path) -> Vec<PathBuf> {
    let files = ["diagnosis.json", "calibration.json", "report.html"].map(|name| folder.join(name));
    say!("written: {} and {}", files[0].display(), files[2].display());
    let mut written = files.to_vec();
    for formula in &camera.diagnosis.formulas {
        let path = |extension: &str| folder.join("effects").join(format!("{}.{extension}", formula.effect.name()));
        say!("written: {} with .rs and .svg", path("toml").display());
        written.extend(["toml", "rs", "svg"].map(path));
    }
    written
}

fn print_camera(camera: &DiagnosedCamera) {
    let (used, all) = (camera.diagnosis.last.capture.frames.len(), camera.loaded_camera().capture.frames.len());
    say!("fitted to {used} of {}", count(all, "frame"));
    let detail = if tracing::enabled!(tracing::Level::INFO) { Detail::All } else { Detail::Screen };
    say!("\n{}", diagnosis_text(&camera.record, &camera.register, detail));
}

fn print_camera_of_rig(name: &str, camera: &DiagnosedCamera) {
    say!("\n[{name}]");
    if camera.in_rig.as_ref().is_some_and(|in_rig| in_rig.poses_from_others) {
        say!("the poses of the board are those of the other cameras");
    }
    print_camera(camera);
    let Some(in_rig) = &camera.in_rig else { return };
    for spec in &in_rig.of_board {
        say!("{spec} of the board, which another camera shows, was added: the diagnosis above is given it");
    }
    for EffectInRig { spec, left_out } in &in_rig.before {
        let fall = fall(left_out.gain_percent);
        say!(
            "{spec} was missing and was added in the joint adjustment: the error on left-out frames {fall}; the diagnosis above is given it"
        );
    }
}

/// Findings about the cameras of a rig together.
fn print_together(rig: &DiagnosedRig, findings: &RigFindings) {
    for name in &rig.found.without_depth {
        say!("\n[{name}]\nno depth: not examined");
    }
    print_drifts(&rig.found);
    say!("\nall cameras jointly, with what was added");
    print_cameras(&rig.found.last);
    say!("\nheld-out frames, with the declared models");
    print_errors(&findings.held_out.before);
    say!("\nheld-out frames, with what was added");
    print_errors(&findings.held_out.after);
}

/// A change of an error in words: `falls by 12.3 % (95 % interval 8.10 to 16.0 %)`.
fn fall(gain: GainInterval) -> String {
    format!("falls by {} (95 % interval {})", percent(gain.value), interval(gain.low, gain.high, "%"))
}

fn print_drifts(found: &RigDiagnosis) {
    for test in &found.drifts {
        let (camera, over) = (&test.camera, drift_range(test.drift.over, test.drift.range));
        let errors = test
            .left_out
            .map_or_else(String::new, |errors| format!(", the error on left-out frames {}", fall(errors.gain_percent)));
        let added = if found.has_added(test) { "added" } else { "not added" };
        say!("\nextrinsics_drift of {camera} over {over}: {added}; p = {}{errors}", number(test.p_value));
    }
}

fn print_errors(evaluation: &Evaluation) {
    say!("{}", table(&evaluation.datasets, None));
    print_transfers(&evaluation.transfer);
}
