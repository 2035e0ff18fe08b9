//! `calibrate` on datasets of several cameras.

use std::path::Path;

use depthcal_calibration::calibrate::Estimator;
use depthcal_calibration::calibrate::rig::RigOptions;
use depthcal_calibration::judge::table::table;
use depthcal_calibration::load::LoadedRig;
use depthcal_calibration::task::rig::{RigFit, fit};
use depthcal_calibration::task::{HoldOut, OptionNames};
use depthcal_io::Calibration;
use depthcal_model::ModelSpec;
use depthcal_report::{ReportDataset, ReportInput, ReportRig, Role};
use serde_json::{Value, json};

use super::load::load;
use super::print::{print_rig, print_transfers};
use crate::common::{Output, Reading, command_line, frames_of, print_not_evaluated, value_of};
use crate::failure::{Failure, input};
use crate::progress::Progress;
use crate::results::Results;
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

/// Calibrates a rig.
pub(crate) fn calibrate(asked: &RigCalibrate<'_>, session: &Session) -> Result<Value, Failure> {
    if asked.estimator != Estimator::Joint {
        return Err(Failure::Input("a rig is calibrated by --estimator joint only: leave the option out".to_owned()));
    }
    asked.output.check()?;
    let rig = load(asked.dataset, asked.reading, session)?;
    let mut options =
        RigOptions { each: session.calibrate_options(), lens: asked.lens.map(str::to_owned), ..RigOptions::default() };
    options.each.model.clone_from(&asked.model);
    add_effects(asked.with, &rig, &mut options)?;
    let hold_out = asked.hold_out.map(|[every, first]| HoldOut { every, first });
    let busy = Progress::busy("fitting");
    let fit = fit(&rig, &options, hold_out)?;
    drop(busy);
    let RigFit { result, placed, fitted, held_out, record, evaluation } = &fit;
    print_rig(result);
    // The report's sections on one camera are those of the reference.
    let mut shown: Vec<ReportDataset<'_>> =
        fitted.cameras.first().map(|evaluated| ReportDataset { evaluated, role: Role::Fitted }).into_iter().collect();
    for (evaluated, camera) in fitted.cameras.iter().zip(&result.cameras) {
        print_not_evaluated(evaluated, &camera.calibrated.capture.dropped);
    }
    shown.extend(
        held_out
            .iter()
            .filter_map(|rig| rig.cameras.first())
            .map(|evaluated| ReportDataset { evaluated, role: Role::HeldOut }),
    );
    say!("\n{}", table(&evaluation.datasets, None));
    print_transfers(&evaluation.transfer);
    let results = Results::begin(&asked.output.out)?;
    let place = results.place();
    let path = place.write("calibration.json", |path| record.write(path))?;
    place.write("evaluation.json", |path| evaluation.write(path))?;
    let report = ReportInput {
        title: result.name.clone(),
        command_line: command_line(),
        stages: session.progress.stage_times(),
        calibrated: result.cameras.first().map(|camera| &camera.calibrated),
        evaluations: &shown,
        diagnosis: None,
        story: &[],
    };
    let evaluated: Vec<_> = std::iter::once(fitted).chain(held_out).collect();
    let rig = ReportRig { cameras: placed, record, evaluated: &evaluated };
    let report = place.write_rig_report(&report, &rig, session)?;
    results.commit("calibration.json", session)?;
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

/// Effects, time offsets and held parameters of `--with`.
pub(crate) fn add_effects(with: &[String], rig: &LoadedRig, options: &mut RigOptions) -> Result<(), Failure> {
    Ok(depthcal_calibration::task::rig::add_effects(OptionNames::COMMAND_LINE.with, with, rig, options)?)
}
