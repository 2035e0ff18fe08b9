//! Formulas that `diagnose` finds for errors that the catalogue lacks.

use std::sync::Arc;

use depthcal::calibration::diagnose::record::to_file;
use depthcal::calibration::observe::CameraFrames;
use depthcal::calibration::simulated;
use depthcal::io::{DiagnosisCapture, DiagnosisComponentBin, FileReference, Verdict};
use depthcal::model::{Of, On};
use depthcal::{CameraDiagnoseOptions, CameraDiagnosis, diagnose_camera};
use depthcal_simulate::{CameraTruth, Form, GivenEffect, Kind, Observation, Place, PointOptions, Simulation};

/// A capture with an error that is given as a function.
fn capture_with(
    seed: u64,
    (place, form): (Place, Form),
    error: impl Fn(&Observation) -> f64 + Send + Sync + 'static,
) -> CameraFrames {
    let given = GivenEffect { name: "given".to_owned(), place, form, function: Arc::new(error) };
    let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], seed).frames(27);
    simulated::capture(&simulation.given([given]).observe_points(&PointOptions::default()).unwrap())
}

/// The diagnosis of a capture with an error that is given as a function.
fn diagnosis_of(
    seed: u64,
    place: (Place, Form),
    error: impl Fn(&Observation) -> f64 + Send + Sync + 'static,
    options: &CameraDiagnoseOptions,
) -> CameraDiagnosis {
    diagnose_camera(&capture_with(seed, place, error), None, options).unwrap()
}

/// Noise of the last model is that of the camera, so nothing but the formula was missing.
#[test]
fn a_product_of_two_covariates_is_found_with_its_place_and_form() {
    let error = |o: &Observation| 10.0 * (1.0 / o.cosine - 1.0) * o.ray[1];
    let d = diagnosis_of(19, (Place::True, Form::Depth), error, &CameraDiagnoseOptions::default());
    assert_eq!(d.verdict, Verdict::Effect, "{:?}", d.formula_refused);
    let [formula] = &d.formulas[..] else { panic!("{} formulas", d.formulas.len()) };
    assert_eq!(formula.covariates, ["incidence", "y"]);
    assert_eq!(formula.effect.definition().formula.texts(), ["a * y * incidence"]);
    assert_eq!((formula.place.of, formula.place.on), (Of::True, On::Depth));
    assert!(formula.confirmed && formula.stability >= 0.8, "{formula:?}");
    // The parameter is that of the simulation, 10 mm, within four standard deviations.
    let parameter = &d.steps[0].parameters[0];
    let deviation = (parameter.value - 10.0) / parameter.std.unwrap();
    assert!(deviation.abs() < 4.0, "{parameter:?}");

    let record = to_file(
        &d,
        FileReference { path: "captures".to_owned(), digest: "00".to_owned() },
        "projective".parse().unwrap(),
    );
    let written = record.steps[0].formula.as_ref().unwrap();
    assert_eq!((written.expression.as_str(), written.confirmed), ("a * y * incidence", true));
    assert_eq!(record.steps[0].effects[0], "found_y_incidence");

    // The formula goes through the residuals that it describes: in three parts of the incidence, over y.
    assert_eq!(written.components.len(), 3);
    let bins: Vec<_> = written.components.iter().flat_map(|c| &c.bins).collect();
    assert!(bins.len() > 40, "{}", bins.len());
    let sum = |value: fn(&DiagnosisComponentBin) -> f64| bins.iter().map(|b| value(b)).sum::<f64>();
    let missed = sum(|b| (b.residual_mm - b.formula_mm).powi(2)) / sum(|b| b.residual_mm.powi(2));
    assert!(missed < 0.1, "the line misses {missed} of what the points show");
    let largest = bins.iter().map(|b| b.formula_mm.abs()).fold(0.0, f64::max);
    assert!((0.5..6.0).contains(&largest), "10 mm times incidence, at most some 1, times y, at most 0.5: {largest}");

    // A frame that tells it from the best formula of other covariates.
    let told_apart =
        |c: &DiagnosisCapture| matches!(c, DiagnosisCapture::TellApart { effect, .. } if effect == "found_y_incidence");
    assert!(record.capture_next.iter().any(told_apart), "{:?}", record.capture_next);
}

/// Another capture decides: one with the same error confirms the formula, one without it does not.
#[test]
fn frames_that_verify_confirm_a_formula_or_do_not() {
    let place = (Place::True, Form::Depth);
    let error = |o: &Observation| 10.0 * (1.0 / o.cosine - 1.0) * o.ray[1];
    let confirmed_by = |verify: &CameraFrames| {
        let captured = capture_with(19, place, error);
        let d = diagnose_camera(&captured, Some(verify), &CameraDiagnoseOptions::default()).unwrap();
        d.formulas.first().map(|f| (f.confirmed, f.replication))
    };
    let (confirmed, replication) = confirmed_by(&capture_with(23, place, error)).expect("a formula");
    let [size, standard_error] = replication.unwrap();
    assert!(confirmed && (size - 1.0).abs() < 4.0 * standard_error, "{size} ± {standard_error}");
    // Errors on frames without the effect do not fall with it, so it is not even added.
    assert_eq!(confirmed_by(&capture_with(23, place, |_| 0.0)), None);
}

/// Effects of the catalogue imitate an error in x and y that the catalogue lacks; none of them stays once its formula is added.
#[test]
fn a_formula_takes_the_place_of_effects_that_imitate_it() {
    let error = |o: &Observation| 4.0 * o.ray[0] + 2.0 * o.ray[1];
    let place = (Place::True, Form::Depth);
    let d = diagnosis_of(17, place, error, &CameraDiagnoseOptions::default());
    let names: Vec<&str> = d.steps.iter().map(|s| s.effects[0].as_str()).collect();
    assert_eq!(names, ["found_x_y"], "{:?}", d.formula_refused);

    // A delay that grows from one corner: with an offset, which effects of the catalogue imitate too.
    let d = diagnosis_of(17, place, |o| 4.0 + 4.0 * o.ray[0] + 2.0 * o.ray[1], &CameraDiagnoseOptions::default());
    let covariates: Vec<_> = d.formulas.iter().map(|f| f.covariates.join(" ")).collect();
    assert_eq!((covariates, d.steps.len()), (vec!["x y".to_owned()], 1), "{:?}", d.formula_refused);

    let without = CameraDiagnoseOptions { formulas: false, ..CameraDiagnoseOptions::default() };
    let d = diagnosis_of(17, place, error, &without);
    assert!(d.formulas.is_empty() && d.formula_refused.is_none());
}

#[test]
fn nothing_is_found_where_nothing_is_missing() {
    for seed in [3, 4] {
        let d = diagnosis_of(seed, (Place::True, Form::Depth), |_| 0.0, &CameraDiagnoseOptions::default());
        assert_eq!((d.verdict, d.formulas.len()), (Verdict::Adequate, 0), "{seed}");
        assert!(d.formula_refused.is_some(), "it was searched");
    }
}
