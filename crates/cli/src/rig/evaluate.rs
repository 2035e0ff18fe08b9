//! `evaluate` of the calibration of a rig.

use std::path::{Path, PathBuf};

use depthcal_calibration::judge::rig::evaluate_rig;
use depthcal_calibration::judge::table::table;
use depthcal_calibration::rig_record::cameras_from_record;
use depthcal_calibration::task::rig::{evaluation_of, missing_cameras};
use depthcal_io::Calibration;
use depthcal_report::{ReportDataset, ReportInput, ReportRig, Role};
use serde_json::{Value, json};

use super::load::load;
use super::print::print_transfers;
use crate::common::{Output, Reading, command_line, frames_of, print_not_evaluated, value_of};
use crate::failure::{Failure, input};
use crate::progress::Progress;
use crate::results::Results;
use crate::session::Session;
use crate::voice::say;

/// What `evaluate` was asked for, in the terms of a rig.
pub(crate) struct RigEvaluate<'a> {
    pub calibration: &'a Path,
    pub record: &'a Calibration,
    pub datasets: &'a [PathBuf],
    pub reading: &'a Reading,
    pub output: &'a Output,
}

/// Measures the errors of a rig on datasets of several cameras.
pub(crate) fn evaluate(asked: &RigEvaluate<'_>, session: &Session) -> Result<Value, Failure> {
    let cameras = cameras_from_record(asked.record, &session.register)
        .map_err(|e| Failure::Input(format!("{}: {e}", asked.calibration.display())))?;
    let (mut all, mut frames) = (Vec::new(), Vec::new());
    for path in asked.datasets {
        let rig = load(path, asked.reading, session)?;
        for name in missing_cameras(&cameras, &rig, path).map_err(input)? {
            say!("  {name}: the dataset has no camera of this name");
        }
        let busy = Progress::busy("measuring");
        let stage = session.progress.stage("evaluation");
        let evaluated = evaluate_rig(&cameras, &rig.capture);
        drop((stage, busy));
        for camera in &evaluated.cameras {
            print_not_evaluated(camera, &[]);
            frames.push(frames_of(&camera.name, camera.frames.len(), &camera.dropped));
        }
        let role = if rig.is_fitted_by(asked.record) { Role::Fitted } else { Role::Other };
        all.push((evaluated, role));
    }
    let evaluation = evaluation_of(&all.iter().map(|(rig, _)| rig).collect::<Vec<_>>(), "");
    say!("\n{}", table(&evaluation.datasets, None));
    print_transfers(&evaluation.transfer);
    let results = Results::begin(&asked.output.out)?;
    let place = results.place();
    let path = place.write("evaluation.json", |path| evaluation.write(path))?;
    let shown: Vec<ReportDataset<'_>> = all
        .iter()
        .filter_map(|(rig, role)| rig.cameras.first().map(|evaluated| ReportDataset { evaluated, role: *role }))
        .collect();
    let report = ReportInput {
        title: format!("Evaluation of {}", asked.calibration.display()),
        command_line: command_line(),
        stages: session.progress.stage_times(),
        calibrated: None,
        evaluations: &shown,
        diagnosis: None,
        story: &[],
    };
    let evaluated: Vec<_> = all.iter().map(|(rig, _)| rig).collect();
    let rig = ReportRig { cameras: &cameras, record: asked.record, evaluated: &evaluated };
    let report = place.write_rig_report(&report, &rig, session)?;
    results.commit("evaluation.json", session)?;
    say!("written: {} and {}", path.display(), report.display());
    Ok(json!({
        "frames": frames,
        "datasets": value_of(&evaluation.datasets)?,
        "transfer": value_of(&evaluation.transfer)?,
        "written": [path, report],
    }))
}
