//! `calibrate` on datasets of several cameras.

use std::path::Path;

use depthcal_calibration::calibrate::{Estimator, HeldError};
use depthcal_calibration::judge::table::table;
use depthcal_io::{Calibration, Evaluation};
use depthcal_model::ModelSpec;
use depthcal_report::{ReportDataset, ReportInput, ReportRig, Role};
use depthcal_rig::judge::evaluate_rig;
use depthcal_rig::load::LoadedRig;
use depthcal_rig::record::rig_record;
use depthcal_rig::{EffectOf, HeldOf, RigError, RigOptions, calibrate_rig};
use serde_json::{Value, json};

use super::load::load;
use super::print::{print_rig, print_transfers};
use crate::common::{Output, Reading, command_line, frames_of, print_not_evaluated, value_of, write_rig_report};
use crate::failure::{Failure, input};
use crate::progress::Progress;
use crate::session::Session;
use crate::voice::say;

/// What `calibrate` was asked for, in the terms of a rig.
pub(crate) struct RigCalibrate<'a> {
    pub dataset: &'a Path,
    pub model: ModelSpec,
    pub with: &'a [String],
    pub lens: Option<&'a str>,
    pub estimator: Estimator,
    /// Every so-manieth frame is held out, beginning with this number from 0.
    pub hold_out: Option<[usize; 2]>,
    pub reading: &'a Reading,
    pub output: &'a Output,
}

impl From<RigError> for Failure {
    fn from(error: RigError) -> Self {
        if error.is_untrusted_fit() { Failure::Untrusted(error.to_string()) } else { Failure::Input(error.to_string()) }
    }
}

/// Calibrates a rig.
pub(crate) fn calibrate(asked: &RigCalibrate<'_>, session: &Session) -> Result<Value, Failure> {
    if asked.estimator != Estimator::Joint {
        return Err(Failure::Input("a rig is calibrated by --estimator joint only: leave the option out".to_owned()));
    }
    let rig = load(asked.dataset, asked.reading, session)?;
    let mut options =
        RigOptions { each: session.calibrate_options(), lens: asked.lens.map(str::to_owned), ..RigOptions::default() };
    options.each.model.clone_from(&asked.model);
    add_effects(asked.with, &rig, &mut options, session)?;
    let (fitted, held) = match asked.hold_out {
        Some([every, first]) => {
            let all = rig.capture.frame_names();
            let is_held = |name: &str| all.iter().position(|n| n == name).is_some_and(|i| i % every == first);
            (rig.capture.subset(|name| !is_held(name)), Some(rig.capture.subset(is_held)))
        }
        None => (rig.capture.clone(), None),
    };
    let busy = Progress::busy("fitting");
    let result = calibrate_rig(&fitted, &options)?;
    drop(busy);
    print_rig(&result);
    let placed = result.placed();
    let stage = session.progress.stage("evaluation");
    let fitted = evaluate_rig(&placed, &fitted);
    let held_out = held.map(|held| evaluate_rig(&placed, &held));
    drop(stage);
    let (mut datasets, mut transfer) = (fitted.records(), fitted.transfer_records());
    // The report's sections on one camera are those of the reference.
    let mut shown: Vec<ReportDataset<'_>> =
        fitted.cameras.first().map(|evaluated| ReportDataset { evaluated, role: Role::Fitted }).into_iter().collect();
    for (evaluated, camera) in fitted.cameras.iter().zip(&result.cameras) {
        print_not_evaluated(evaluated, &camera.calibrated.capture.dropped);
    }
    if let Some(held_out) = &held_out {
        datasets.extend(held_out.records().into_iter().map(|mut record| {
            record.name = format!("{} (held out)", record.name);
            record
        }));
        transfer.extend(held_out.transfer_records().into_iter().map(|mut record| {
            record.dataset = format!("{} (held out)", record.dataset);
            record
        }));
        shown.extend(held_out.cameras.first().map(|evaluated| ReportDataset { evaluated, role: Role::HeldOut }));
    }
    say!("\n{}", table(&datasets, None));
    print_transfers(&transfer);
    let reference = rig.cameras.first().map(|c| c.reference.clone());
    let record = reference.and_then(|reference| rig_record(&result, &fitted, reference));
    let record = record.ok_or_else(|| Failure::Input("the dataset declares no cameras".to_owned()))?;
    let path = asked.output.file("calibration.json");
    record.write(&path).map_err(input)?;
    let evaluation = Evaluation { datasets, transfer };
    evaluation.write(asked.output.file("evaluation.json")).map_err(input)?;
    let report = ReportInput {
        title: result.name.clone(),
        command_line: command_line(),
        stages: session.progress.stage_times(),
        calibrated: result.cameras.first().map(|camera| &camera.calibrated),
        evaluations: &shown,
        diagnosis: None,
        story: &[],
    };
    let evaluated: Vec<_> = std::iter::once(&fitted).chain(&held_out).collect();
    let rig = ReportRig { cameras: &placed, record: &record, evaluated: &evaluated };
    let report = write_rig_report(&report, &rig, session, &asked.output.out)?;
    say!("written: {} and {}", path.display(), report.display());
    let frames: Vec<Value> = result
        .cameras
        .iter()
        .map(|camera| {
            let capture = &camera.calibrated.capture;
            frames_of(&camera.name, capture.frames.len(), &capture.dropped)
        })
        .collect();
    Ok(json!({
        "frames": frames,
        "calibration": value_of(&Calibration::read(&path).map_err(input)?)?,
        "datasets": value_of(&evaluation.datasets)?,
        "transfer": value_of(&evaluation.transfer)?,
        "written": [path, report],
    }))
}

/// What `--with` calls the time by which a camera exposes later than its times say.
const TIME_OFFSET: &str = "time_offset";

/// Effects, time offsets and held parameters of `--with`.
pub(crate) fn add_effects(
    with: &[String],
    rig: &LoadedRig,
    options: &mut RigOptions,
    session: &Session,
) -> Result<(), Failure> {
    let names: Vec<&str> = rig.capture.cameras.iter().map(|c| c.name.as_str()).collect();
    with.iter().try_for_each(|text| add_effect(text, &names, options, session))
}

/// An effect or a held parameter of `--with`: of one camera where it begins with its name and a colon.
fn add_effect(text: &str, cameras: &[&str], options: &mut RigOptions, session: &Session) -> Result<(), Failure> {
    let wrong = |e: &dyn std::fmt::Display| Failure::Input(format!("--with {text}: {e}"));
    let (is_held, rest) = match text.strip_prefix("fixed:") {
        Some(rest) => (true, rest),
        None => (false, text),
    };
    let (camera, rest) = match rest.split_once(':') {
        Some((name, rest)) if cameras.contains(&name) => (Some(name.to_owned()), rest),
        _ => (None, rest),
    };
    if !is_held && rest == TIME_OFFSET {
        let camera = camera.ok_or_else(|| {
            let example = cameras.last().copied().unwrap_or("CAMERA");
            wrong(&format_args!("name the camera whose offset is estimated, such as {example}:{TIME_OFFSET}"))
        })?;
        options.time_offsets.push(camera);
    } else if is_held {
        let parameter = rest.parse().map_err(|e: HeldError| wrong(&e))?;
        options.held.push(HeldOf { camera, parameter });
    } else {
        let effect = session.register.piece_spec(rest).map_err(|e| wrong(&e))?;
        options.effects.push(EffectOf { camera, effect });
    }
    Ok(())
}
