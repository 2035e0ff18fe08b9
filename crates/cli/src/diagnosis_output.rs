//! The files and words of a diagnosis of one camera.

use depthcal_calibration::diagnose::Diagnosis;
use depthcal_calibration::judge::evaluate::Evaluated;
use depthcal_calibration::load::Loaded;
use depthcal_calibration::task::{diagnosis_record, write_calibration};
use depthcal_io::DiagnosisFile;
use depthcal_report::format::count;
use depthcal_report::{ReportDataset, ReportDiagnosis, ReportInput, Role, diagnosis_text, effect_files};
use serde_json::{Value, json};

use super::common::{frames_of, value_of};
use super::failure::{Failure, input};
use super::results::Place;
use super::session::Session;
use super::voice::say;

/// What the results contain besides the diagnosis itself.
pub(super) struct Told<'a> {
    pub(super) title: String,
    pub(super) command_line: String,
    /// The declared model.
    pub(super) model: &'a str,
    /// Whether the errors are those of another dataset.
    pub(super) verified: bool,
    /// Sentences that introduce the report.
    pub(super) story: Vec<String>,
}

/// Prints a diagnosis and has its files written: record, calibration of the last model, errors, report; returns the record, and what
/// `--json` prints. `fitted` are the errors of the last model on the frames that it was fitted to.
pub(super) fn tell(
    d: &Diagnosis,
    fitted: &Evaluated,
    loaded: &Loaded,
    told: Told<'_>,
    session: &Session,
    place: &Place<'_>,
) -> Result<(DiagnosisFile, Value), Failure> {
    let reference = loaded.reference.clone();
    let (record, register) =
        diagnosis_record(d, reference, told.model, &session.register, &session.progress).map_err(input)?;
    let (used, all) = (d.last.capture.frames.len(), loaded.capture.frames.len());
    say!("fitted to {used} of {}", count(all, "frame"));
    say!("\n{}", diagnosis_text(&record));
    let file = place.write("diagnosis.json", |path| record.write(path))?;
    let mut held_out = d.after.evaluated.record();
    held_out.name = format!("{} (held out)", held_out.name);
    let datasets = vec![fitted.record(), held_out];
    place.write_into(|out| write_calibration(&d.last, fitted, loaded, datasets, &register, out))?;
    let calibration = place.shown("calibration.json");
    let role = if told.verified { Role::Other } else { Role::HeldOut };
    let shown = [
        ReportDataset { evaluated: fitted, role: Role::Fitted },
        ReportDataset { evaluated: &d.after.evaluated, role },
    ];
    let report = ReportInput {
        title: told.title,
        command_line: told.command_line,
        stages: session.progress.stage_times(),
        calibrated: Some(&d.last),
        evaluations: &shown,
        diagnosis: Some(ReportDiagnosis { record: &record, before: &d.before.evaluated, register: &register }),
        story: &told.story,
    };
    let report = place.write_report(&report, session)?;
    say!("written: {} and {}", file.display(), report.display());
    let mut written = vec![file, calibration, report];
    for formula in &d.formulas {
        let folder = place.within("effects");
        let name = formula.effect.name();
        for (file, text) in effect_files(&formula.effect) {
            written.push(folder.write_text(&file, &text)?);
        }
        say!("written: {} with .rs and .svg", folder.shown(&format!("{name}.toml")).display());
    }
    let capture = &d.last.capture;
    let mut frames = frames_of(&capture.name, capture.frames.len(), &capture.dropped);
    frames["left_out"] = value_of(&record.bad_frames)?;
    let value = json!({ "frames": frames, "diagnosis": value_of(&record)?, "written": written });
    Ok((record, value))
}
