//! Small fleets from simulated captures to `fleet.json`, and the prior of the next unit.

#![cfg(feature = "cli")]

use std::sync::Arc;

use crate::support::{Folder, schemas, stdout, succeeds};
use depthcal::calibration::adjust::camera_prior::CameraPrior;
use depthcal::calibration::diagnose::effect_scores::effect_scores;
use depthcal::calibration::simulated;
use depthcal::fleet::{FleetOptions, Unit, join, read_units};
use depthcal::io::{CAMERA, Calibration, FileReference, Fleet, Prior, Scores};
use depthcal::model::Register;
use depthcal::{Calibrated, CalibratedCamera, CameraFrames, CameraOptions};
use depthcal::{calibrate_camera, calibration_record, evaluate_fitted};
use depthcal_simulate::{CameraTruth, Effect, Kind, PointOptions, Simulation};
use depthcal_statistics::{chi_squared_tail, noncentrality};
use rayon::prelude::*;

const EFFECT: &str = "range_offset";
/// Shared size of it, mm.
const SIZE: f64 = 4.0;

/// A camera of the type: focal length and dw differ.
fn camera(unit: usize) -> CameraTruth {
    let mut camera = CameraTruth::published(1).unwrap();
    let departure = [-1.1, 0.4, 1.3, -0.6, 0.9, -0.9, 0.1][unit];
    camera.focal_px = camera.focal_px.map(|f| f + 4.0 * departure);
    camera.depth[3] += 0.004 * [0.7, -1.2, 0.2, 1.1, -0.5, -0.3, 0.6][unit];
    camera
}

fn capture(unit: usize, frames: usize, size: f64) -> CameraFrames {
    let effects = [Effect::new(EFFECT, size).unwrap()];
    let simulation = Simulation::new(camera(unit), Kind::General(1), &effects, 40 + unit as u64);
    let simulation = simulation.frames(frames);
    simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap())
}

fn fit(unit: usize, frames: usize, options: &CameraOptions) -> CalibratedCamera {
    calibrate_camera(&capture(unit, frames, SIZE), options).unwrap()
}

/// All units have the same terms of the lens.
fn plain() -> CameraOptions {
    CameraOptions { lens: "brown-conrady:full".to_owned(), ..CameraOptions::default() }
}

fn with_effect() -> CameraOptions {
    CameraOptions { effects: vec![EFFECT.parse().unwrap()], ..plain() }
}

fn records(unit: usize, fit: &CalibratedCamera) -> (Calibration, Scores) {
    let dataset = FileReference { path: format!("unit{unit}"), digest: format!("{unit:x}") };
    let alone = Calibrated::of_camera(CAMERA, fit.clone());
    let record = calibration_record(&alone, &evaluate_fitted(&alone), dataset.clone(), None);
    (record, effect_scores(fit, &Register::builtin(), dataset).unwrap().unwrap())
}

/// One step from the score is what an adjustment with the effect finds, for the effect and for everything else; and a model that
/// has the effect, conditioned on its doing nothing, is the model without it.
#[test]
fn scores_and_conditioning_are_what_adjusting_gives() {
    let register = Register::builtin();
    let unit = |options: &CameraOptions| {
        // So small that the noise that is estimated without the effect is the noise: weights that differ would move a model that
        // lacks it.
        let fit = calibrate_camera(&capture(0, 24, 1.5), options).unwrap();
        let (record, scores) = records(0, &fit);
        Unit::new("unit", "", &record, Some(&scores), &register).unwrap()
    };
    let without = unit(&CameraOptions { frame_planes: false, ..plain() });
    let with = unit(&CameraOptions { frame_planes: false, ..with_effect() });
    let names: Vec<String> = with.parameters.iter().map(|p| p.name.clone()).collect();
    let base: Vec<String> = without.parameters.iter().map(|p| p.name.clone()).collect();
    assert_eq!(names.len(), base.len() + 1);
    let key = &with.effects.iter().find(|e| e.key.name == EFFECT && e.in_model).unwrap().key;
    assert!(!without.effect(key).expect("scored").in_model);
    let pairs = [
        (without.estimate_with(&names, &[key], 1.0).unwrap(), with.estimate_with(&names, &[key], 1.0).unwrap(), &names),
        (without.estimate_with(&base, &[], 1.0).unwrap(), with.estimate_with(&base, &[], 1.0).unwrap(), &base),
    ];
    // What the effect moves: the same parameters with and without it.
    let estimate = without.estimate_with(&base, &[], 1.0).unwrap();
    let moved = with.estimate_with(&base, &[key], 1.0).unwrap();
    // A step that did nothing, or the wrong thing, would show.
    let largest = (0..base.len()).map(|k| (estimate.value[k] - moved.value[k]).abs() / moved.covariance[(k, k)].sqrt());
    assert!(largest.fold(0.0, f64::max) > 2.0);
    for (a, b, names) in pairs {
        for (k, name) in names.iter().enumerate() {
            let std = b.covariance[(k, k)].sqrt();
            let shift = base.iter().position(|n| n == name).map_or(0.0, |i| (estimate.value[i] - moved.value[i]).abs());
            let ratio = (a.covariance[(k, k)] / b.covariance[(k, k)]).sqrt();
            // Each fit weighs by the noise that it has estimated itself: of the same data, weights that make standard deviations
            // up to a tenth larger move estimates by √(1.1² − 1) = 0.46 of one (Hausman 1978).
            let bound = (0.5 * std).max(0.1 * shift);
            assert!((a.value[k] - b.value[k]).abs() < bound, "{name}: {} and {} ± {std}", a.value[k], b.value[k]);
            assert!((0.8..1.25).contains(&ratio), "{name}: standard deviations differ by {ratio}");
        }
    }
}

/// A unit with few observations.
fn small(number: usize, size: f64) -> (Unit, Scores) {
    let effects = if size > 0.0 { vec![Effect::new(EFFECT, size).unwrap()] } else { Vec::new() };
    let simulation = Simulation::new(camera(number % 7), Kind::General(1), &effects, 900 + number as u64).frames(12);
    let options = PointOptions { depth_samples: 100, ..PointOptions::default() };
    let fit = calibrate_camera(&simulated::capture(&simulation.observe_points(&options).unwrap()), &plain()).unwrap();
    let (mut record, scores) = records(0, &fit);
    record.dataset.digest = format!("{number:x}");
    (Unit::new(&format!("unit{number}"), "", &record, Some(&scores), &Register::builtin()).unwrap(), scores)
}

/// The noncentrality of 24 units' test is 24/4 = 6 times that with which one unit detects an effect with a probability of 80 %.
#[test]
fn units_find_together_what_none_shows_alone() {
    let (_, scores) = small(30, 0.0);
    let index = scores.effects.iter().position(|e| e.effect == EFFECT).unwrap();
    let place: usize = scores.effects[..index].iter().map(|e| e.parameters.len()).sum();
    let tests = scores.effects.len() as f64;
    let size = 0.5 * (noncentrality(1, 0.01 / tests, 0.8) / scores.information[place][place]).sqrt();
    let units: Vec<Unit> = (0..24).into_par_iter().map(|number| small(number, size).0).collect();
    let effects = join(units, Vec::new(), &FleetOptions::default()).unwrap().fleet.effects;
    let shared: Vec<&str> = effects.iter().filter(|e| e.shared).map(|e| e.effect.as_str()).collect();
    assert_eq!(shared, [EFFECT]);
    let effect = &effects[0];
    assert!((effect.mean[0] / size - 1.0).abs() < 0.4, "{} mm instead of {size}", effect.mean[0]);
    let shows = |value: f64, std: f64| chi_squared_tail((value / std).powi(2), 1) * tests < 0.01;
    let alone = effect.units.iter().filter(|u| shows(u.values[0], u.std_dev[0])).count();
    assert!(alone < 8, "{alone} of 24 units show it alone");
}

#[test]
fn a_small_fleet_from_files_to_the_next_unit() {
    let folder = Folder::new();
    let (knows, scored) = (with_effect(), plain());
    for unit in 0..6 {
        // The first unit has the effect in its model.
        let fitted = fit(unit, 24, if unit == 0 { &knows } else { &scored });
        let (record, scores) = records(unit, &fitted);
        let out = folder.path(&format!("results/unit{unit}"));
        std::fs::create_dir_all(&out).unwrap();
        record.write(out.join("calibration.json")).unwrap();
        scores.write(out.join("scores.json")).unwrap();
        schemas::follows(out.join("scores.json"), "scores");
    }
    let output = succeeds(["fleet", &folder.arg("results"), "--out", &folder.arg("fleet")]);
    let text = stdout(&output);
    schemas::follows(folder.path("fleet/fleet.json"), "fleet");
    schemas::follows(folder.path("fleet/prior.json"), "prior");
    let html = std::fs::read_to_string(folder.path("fleet/report.html")).unwrap();
    assert!(html.contains("fleet-parameters") && html.contains("unit5") && html.contains("Fleet of 6 units"));
    let fleet = Fleet::read(folder.path("fleet/fleet.json")).unwrap();
    assert_eq!((fleet.units.len(), fleet.parameters.len()), (6, 13), "{text}");
    assert!(fleet.outliers.is_empty(), "{text}");
    let differs = |name: &str| fleet.parameters.iter().find(|p| p.name == name).unwrap().differs_p_value;
    assert!(differs("pinhole.fx").min(differs("pinhole.fy")) < 0.05 && differs("pinhole.cx") > 0.05, "{text}");
    // The effect of the first unit is confirmed by the others, at its size.
    let replication = fleet.replications.iter().find(|r| r.effect == EFFECT).expect("a replication");
    assert_eq!((replication.found_in.len(), replication.tested_in.len()), (1, 5));
    assert!(replication.confirmed, "{replication:?}");
    let shared = fleet.effects.iter().find(|e| e.shared).expect("a shared effect");
    assert!(shared.with == EFFECT || shared.indistinguishable.iter().any(|name| name == EFFECT), "{text}");

    // The next unit, from four frames.
    let prior = Prior::read(folder.path("fleet/prior.json")).unwrap();
    let prior = Some(Arc::new(CameraPrior::from(&prior)));
    let few = fit(6, 4, &CameraOptions { prior, ..with_effect() });
    let truth = camera(6);
    let z = |name: &str, parameter: &str, truth: f64| {
        let columns = few.camera.parameter_ranges().nth(few.camera.block_index(name).unwrap()).unwrap();
        let block = few.camera.block(name).unwrap();
        let k = block.parameters().iter().position(|p| p.name == parameter).unwrap();
        (block.theta[k] - truth) / few.std_devs()[columns.start + k].unwrap()
    };
    assert!(z("pinhole", "fx", truth.focal_px[0]).abs() < 4.0, "{}", z("pinhole", "fx", truth.focal_px[0]));
    assert!(z("brown_conrady", "k1", truth.lens[0]).abs() < 4.0, "{}", z("brown_conrady", "k1", truth.lens[0]));
    let (record, _) = records(6, &few);
    let used = record.fit.prior.expect("the prior is in the record");
    assert_eq!(used.units, 6);
    assert!(used.parameters.iter().all(|p| (0.0..=1.0).contains(&p.own_share)));

    // Scores of another fit are refused; a second calibration of the same dataset is left out.
    std::fs::copy(folder.path("results/unit1/scores.json"), folder.path("results/unit2/scores.json")).unwrap();
    let error = read_units(&[folder.path("results")], &Register::builtin()).unwrap_err().to_string();
    assert!(error.contains("scores.json") && error.contains("calibrate again"), "{error}");
}

/// A prior that is far stronger than the data wins, one that is far weaker changes nothing, and in between the estimate is the
/// mean of both weighted by their information.
#[test]
fn priors_are_weighed_by_their_information() {
    let options = with_effect();
    let alone = fit(0, 12, &options);
    let column =
        alone.camera.parameter_ranges().nth(alone.camera.block_index("projective").unwrap()).unwrap().start + 3;
    let (value, variance) = (alone.camera.theta()[column], alone.covariance.as_ref().unwrap()[(column, column)]);
    for factor in [1e-4, 1.0, 1e6] {
        let mean = value + 0.5 * variance.sqrt();
        let prior = CameraPrior {
            units: 9,
            names: vec!["projective.dw".to_owned()],
            mean: nalgebra::DVector::from_element(1, mean),
            covariance: nalgebra::DMatrix::from_element(1, 1, factor * variance),
        };
        let with = fit(0, 12, &CameraOptions { prior: Some(Arc::new(prior)), ..options.clone() });
        let expected = (factor * value + mean) / (factor + 1.0);
        let fitted = with.camera.theta()[column];
        assert!((fitted - expected).abs() < 0.1 * variance.sqrt(), "{factor}: {fitted}, expected {expected}");
        let narrowed = with.covariance.as_ref().unwrap()[(column, column)] / variance;
        assert!((narrowed / (factor / (factor + 1.0)) - 1.0).abs() < 0.15, "{factor}: variance by {narrowed}");
    }
}
