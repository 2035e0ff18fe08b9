//! The loop on simulated captures whose faults are known, at the level of points: named where it has a name, left alone where
//! it has none, and nothing where there is nothing.

use depthcal::calibration::calibrate::{CalibratedCamera, CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::bad_frames::BadFrameReason;
use depthcal::calibration::diagnose::examination::scores;
use depthcal::calibration::diagnose::frame_planes::frame_planes;
use depthcal::calibration::diagnose::{CameraDiagnoseOptions, CameraDiagnosis, Step, diagnose_camera};
use depthcal::calibration::judge::cross_validation::cross_validate_camera;
use depthcal::calibration::judge::parts::Parts;
use depthcal::calibration::simulated;
use depthcal::io::{DiagnosisPlace, Verdict};
use depthcal::model::hook::{Depth, DepthState};
use depthcal::model::{Context, Parameter, Piece, PieceSpec, Register, Scalar, Technology};
use depthcal_simulate::{CameraTruth, Defects, Effect, Form, Kind, Noise, Place, PointOptions, Simulation};
use rayon::prelude::*;

fn simulation(effects: &[(&str, f64)], seed: u64) -> Simulation {
    let effects: Vec<Effect> = effects.iter().map(|(name, size)| Effect::new(name, *size).unwrap()).collect();
    Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &effects, seed).unit(seed)
}

fn run(simulation: &Simulation) -> CameraDiagnosis {
    let observed = simulation.observe_points(&PointOptions::default()).unwrap();
    diagnose_camera(&simulated::capture(&observed), None, &CameraDiagnoseOptions::default()).unwrap()
}

fn names(d: &CameraDiagnosis) -> Vec<&str> {
    d.steps.iter().map(|s| s.effects[0].as_str()).collect()
}

/// Decision and outcome of every round, for messages.
fn decisions(d: &CameraDiagnosis) -> Vec<String> {
    d.rounds.iter().map(|r| format!("{:?}: {:?}", r.decision, r.outcome)).collect()
}

/// Effects that act behind D, or on something else than their equation says: named, with a place that is right or listed among
/// those that the captures cannot tell apart, and nothing else. The camera's D tilts depth, so that a wave in the wrong place
/// slips.
#[test]
fn effects_in_other_places_are_named_with_their_place() {
    let cases = [
        ("cyclic_depth", 3.0, Place::Measured, Form::Factor),
        ("cyclic_depth", 3.0, Place::Measured, Form::Depth),
        ("radial_range", 6.0, Place::Measured, Form::Depth),
        ("range_offset", 10.0, Place::True, Form::InverseDepth),
        ("incidence_bias", 5.0, Place::Measured, Form::Factor),
    ];
    let failures: Vec<String> = cases
        .into_par_iter()
        .filter_map(|(name, size, place, form)| {
            let effect = Effect::new(name, size).unwrap().placed(place, form).unwrap();
            let simulation =
                Simulation::new(CameraTruth::published(2).unwrap(), Kind::General(1), &[effect], 5).unit(3);
            let d = run(&simulation);
            let expected = |p: &DiagnosisPlace| p.of.name() == place.name() && p.on.name() == form.name();
            let has_place = |s: &Step| s.place.iter().chain(&s.places_not_told_apart).any(expected);
            let right = names(&d) == [name] && d.verdict == Verdict::Effect && d.steps.iter().all(has_place);
            let specs: Vec<String> = d.steps.iter().map(|s| s.spec.to_string()).collect();
            (!right).then(|| format!("{name} {place:?} {form:?}: {specs:?}, {:?}, {:?}", d.verdict, decisions(&d)))
        })
        .collect();
    assert!(failures.is_empty(), "{failures:#?}");
}

/// Effects well above their detectable sizes: each is found, alone, and what is left is the noise. Where the simulator gives the
/// size in units of the parameters themselves, it is found within 10 %.
#[test]
fn undeclared_effects_are_named_and_taken_up() {
    let cases = [
        ("board_bow", 0.4),
        ("print_scale", 0.3),
        ("depth_registration", 2.0),
        ("disparity_ripple", 1.0),
        ("range_offset", 6.0),
        ("cyclic_depth", 2.0),
        ("radial_range", 4.0),
        ("incidence_bias", 3.0),
        ("temperature_drift", 4.0),
    ];
    let failures: Vec<String> = cases
        .into_par_iter()
        .filter_map(|case| {
            let d = run(&simulation(&[case], 2));
            let right = names(&d) == [case.0] && d.verdict == Verdict::Effect;
            let better = d.after.errors.depth_rms_mm <= d.before.errors.depth_rms_mm;
            let fitted: Vec<f64> = d.steps.iter().flat_map(|s| &s.parameters).map(|p| p.value).collect();
            let size = match (case.0, &fitted[..]) {
                ("range_offset", [mm]) => *mm,
                ("depth_registration", [u, v]) => u.hypot(*v),
                ("range_offset" | "depth_registration", _) => f64::NAN,
                _ => case.1,
            };
            let accurate = (size / case.1 - 1.0).abs() < 0.1;
            (!right || !better || !accurate)
                .then(|| format!("{}: {:?} {fitted:?}, {:?}, {:?}", case.0, names(&d), d.verdict, decisions(&d)))
        })
        .collect();
    assert!(failures.is_empty(), "{failures:#?}");
}

/// A wave over depth belongs to time-of-flight cameras; one over disparity, which resembles it, to others.
#[test]
fn effects_of_another_technology_are_listed_until_it_is_declared() {
    let simulation = simulation(&[("cyclic_depth", 4.0)], 3);
    let mut capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
    let mut named = |technology: Option<Technology>| {
        capture.technology = technology;
        let d = diagnose_camera(&capture, None, &CameraDiagnoseOptions::default()).unwrap();
        d.steps.iter().map(|s| (s.spec.name.clone(), s.of_other_technologies.clone())).collect::<Vec<_>>()
    };
    let wave = |rivals: &[&str]| vec![("cyclic_depth".to_owned(), rivals.iter().map(|r| (*r).to_owned()).collect())];
    assert_eq!(named(None), wave(&["disparity_ripple"]));
    assert_eq!(named(Some(Technology::TimeOfFlight)), wave(&[]));
    let of_stereo = named(Some(Technology::Stereo));
    assert!(of_stereo.iter().all(|(name, _)| name != "cyclic_depth"), "{of_stereo:?}");
}

/// Whatever the loop decided on its way, its last model is that of a calibration with the same effects from the start: lens
/// order, gross markers, outliers, noise and smoothness are decided anew under it.
#[test]
fn the_last_model_is_that_of_a_calibration_with_the_same_effects() {
    const SETS: [&[(&str, f64)]; 10] = [
        &[("board_bow", 2.5)],
        &[("board_bow", 1.5), ("cyclic_depth", 4.0)],
        &[("cyclic_depth", 4.0)],
        &[("range_offset", 15.0)],
        &[("thin_prism", 4.0)],
        &[("radial_range", 6.0), ("board_bow", 2.0)],
        &[("incidence_bias", 6.0)],
        &[("quadratic_depth", 8.0)],
        &[("reflectivity_bias", 4.0)],
        &[("temporal_drift", 4.0)],
    ];
    let cases = (0..2 * SETS.len()).into_par_iter();
    let failures = cases.filter_map(|case| {
        let simulation = simulation(SETS[case % SETS.len()], case as u64 + 1).frames(24);
        let capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        // Formulas take most of the time, and decide nothing here.
        let d =
            diagnose_camera(&capture, None, &CameraDiagnoseOptions { formulas: case % 5 == 0, ..Default::default() })
                .unwrap();
        let mut options = CameraOptions::default();
        options.effects.extend(d.steps.iter().map(|step| step.spec.clone()));
        for formula in &d.formulas {
            formula.effect.register(&mut options.register).unwrap();
        }
        let used = |name: &str| d.last.capture.frames.iter().any(|frame| frame.name == name);
        let fit = calibrate_camera(&capture.subset(|_, frame| used(&frame.raw.name)), &options).unwrap();
        let folds = CameraDiagnoseOptions::default().folds;
        let held_out =
            |fit| cross_validate_camera(fit, folds, Parts::Interleaved, &options).unwrap().record().depth_rms_mm;
        let [of_loop, of_calibration] = [&d.last, &fit].map(|fit| held_out(fit).unwrap().after);
        let apart = of_loop / of_calibration - 1.0;
        println!("{case}: {:?} {of_loop:.4} mm, {of_calibration:.4} mm by a calibration", names(&d));
        let words = |fit: &CalibratedCamera| {
            let (noise, free) = (&fit.noise, fit.camera.free_parameters());
            format!("{} outliers, {noise:?}, free parameters {free:?}", fit.outliers)
        };
        (apart.abs() > 0.01)
            .then(|| format!("{case}: {:?} {of_loop} {of_calibration}\n{}\n{}", names(&d), words(&d.last), words(&fit)))
    });
    let failures: Vec<String> = failures.collect();
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn two_effects_are_both_named() {
    let d = run(&simulation(&[("projector_distortion", 4.0), ("temporal_drift", 4.0)], 1));
    let mut effects = names(&d);
    effects.sort_unstable();
    assert_eq!(effects, ["projector_distortion", "temporal_drift"], "{:?}", decisions(&d));
    assert_eq!(d.verdict, Verdict::Effect);
}

/// A third effect explains more than either of these alone, and nothing once both are in the model: it is not named.
#[test]
fn what_resembles_two_effects_is_not_named() {
    for seed in [0, 1] {
        // Large enough for each to be certain given the other.
        let d = run(&simulation(&[("board_bow", 0.25), ("reflectivity_bias", 3.0)], seed));
        let mut effects = names(&d);
        effects.sort_unstable();
        assert_eq!(effects, ["board_bow", "reflectivity_bias"], "seed {seed}: {:?}", decisions(&d));
    }
}

#[test]
fn nothing_is_named_where_nothing_is_missing() {
    let verdicts: Vec<(Verdict, Vec<String>)> = (0..10_u64)
        .into_par_iter()
        .map(|seed| {
            let simulation = simulation(&[], 300 + seed);
            let heavy = Noise { tail_dof: Some(3.0), ..Noise::default() };
            let d = run(&if seed % 2 == 0 { simulation } else { simulation.noise(heavy) });
            (d.verdict, names(&d).into_iter().map(str::to_owned).collect())
        })
        .collect();
    assert!(verdicts.iter().all(|v| v.0 == Verdict::Adequate), "{verdicts:?}");
}

/// Errors that the catalogue lacks get no name; the free map corrects those that are functions of the pixel.
#[test]
fn effects_beyond_the_catalogue_are_unexplained() {
    for name in ["smooth_map", "row_banding"] {
        let effect = Effect::with_default_size(name).unwrap();
        let d = run(&simulation(&[(name, effect.size)], 2));
        assert_eq!(d.verdict, Verdict::Unexplained, "{name}: {:?}", decisions(&d));
        assert!(are_descriptions(&d), "{name}: {:?}", names(&d));
        if name == "smooth_map" {
            let (before, after) = (d.before.errors.depth_rms_mm.unwrap(), d.after.errors.depth_rms_mm.unwrap());
            assert!(after < before, "{before} → {after} mm: {:?}", decisions(&d));
        }
    }
}

/// Whether no step is a name: maps, formulas and smooth functions describe what they have no name for.
fn are_descriptions(d: &CameraDiagnosis) -> bool {
    let is_description = |n: &&str| *n == "free_map" || d.formulas.iter().any(|f| f.effect.name() == *n);
    names(d).iter().all(is_description)
}

/// An effect that is taken out of the catalogue gets no other effect's name.
#[test]
fn an_effect_that_the_catalogue_lacks_is_unexplained() {
    for (name, size) in [("cyclic_depth", 2.0), ("projector_distortion", 6.0)] {
        let observed = simulation(&[(name, size)], 4).observe_points(&PointOptions::default()).unwrap();
        let mut options = CameraDiagnoseOptions::default();
        options.calibrate.register = Register::builtin().without(name);
        // A ripple in disparity is a wave in depth, as far as a short range of distances goes.
        options.calibrate.register = options.calibrate.register.without("disparity_ripple");
        let capture = simulated::capture(&observed);
        let without = CameraDiagnoseOptions { formulas: false, ..options.clone() };
        let d = diagnose_camera(&capture, None, &without).unwrap();
        assert_eq!(d.verdict, Verdict::Unexplained, "{name}: {:?}", decisions(&d));
        assert!(names(&d).iter().all(|n| *n == "free_map"), "{name}: {:?}", names(&d));
        // A formula that describes it is no name: whatever is among the steps is a description.
        let d = diagnose_camera(&capture, None, &options).unwrap();
        assert_ne!(d.verdict, Verdict::Adequate, "{name}: {:?}", decisions(&d));
        assert!(are_descriptions(&d), "{name}: {:?}", names(&d));
    }
}

/// A lens pressed at three points bends what the depth image sees: ρ_m = ρ + k (x³ − 3xy²). An effect from outside the crates.
#[derive(Debug)]
struct Trefoil;

impl Piece<Depth, 1> for Trefoil {
    const NAME: &'static str = "trefoil";
    const SUMMARY: &'static str = "the lens is pressed at three points";
    const EQUATION: &'static str = "ρ + k (x³ − 3xy²)";
    const SOURCE: &'static str = "a test";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("k", "1/mm", 0.0, 1e-5)];

    fn map<T: Scalar>(&self, s: DepthState<T>, [k]: [T; 1], _: &Context) -> T {
        s.rho + k * s.x * (s.x * s.x - s.y * s.y * 3.0)
    }
}

/// An effect that a user adds to the register is tested, named and fitted like the built-in ones.
#[test]
fn an_effect_from_outside_is_named() {
    const K_PER_MM: f64 = 4e-5;
    let observed = simulation(&[], 8).observe_points(&PointOptions::default()).unwrap();
    let mut capture = simulated::capture(&observed);
    let camera = CameraTruth::published(1).unwrap();
    for sample in capture.frames.iter_mut().flat_map(|f| f.depth_pixels_mut()) {
        let [x, y] = undistorted(&camera, sample.context.pixel);
        sample.depth_mm = 1.0 / (1.0 / sample.depth_mm + K_PER_MM * x * (x * x - 3.0 * y * y));
    }
    let mut options = CameraDiagnoseOptions::default();
    options.calibrate.register.add(|_| Trefoil);
    let d = diagnose_camera(&capture, None, &options).unwrap();
    assert_eq!(names(&d).first(), Some(&"trefoil"), "{:?}", decisions(&d));
    let fitted = d.steps[0].parameters[0].value;
    assert!((fitted / K_PER_MM - 1.0).abs() < 0.1, "{fitted} instead of {K_PER_MM}");
}

/// The ray of a pixel, by fixed-point iteration over the radial part of the lens.
fn undistorted(camera: &CameraTruth, pixel: [f64; 2]) -> [f64; 2] {
    let seen = [0, 1].map(|i| (pixel[i] - camera.centre_px[i]) / camera.focal_px[i]);
    let [k1, k2, _, _, k3] = camera.lens;
    (0..20).fold(seen, |[x, y], _| {
        let r2 = x * x + y * y;
        seen.map(|s| s / (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))))
    })
}

#[test]
fn frames_that_do_not_belong_are_named_and_no_effects() {
    let defects = Defects { bad_frames: 2, duplicated_frames: 1, ..Defects::default() };
    let simulation = simulation(&[], 5).defects(defects);
    let truth = simulation.truth().unwrap().defective;
    let d = run(&simulation);
    assert_eq!(d.verdict, Verdict::Adequate, "{:?}", decisions(&d));
    for index in truth.bad.iter().chain(truth.duplicated.iter().map(|[_, copy]| copy)) {
        let name = format!("{index:04}");
        assert!(d.bad_frames.iter().any(|b| b.name == name), "frame {name} is not among {:?}", d.bad_frames);
    }
    let twin = d.bad_frames.iter().find(|b| matches!(b.reason, BadFrameReason::SameImage { .. }));
    assert!(twin.is_some_and(|t| t.name == format!("{:04}", truth.duplicated[0][1])));
}

#[test]
fn a_wrong_square_size_is_said_to_be_just_that() {
    let d = run(&simulation(&[], 6).defects(Defects { spacing_factor: 1.25, ..Defects::default() }));
    assert!(names(&d).is_empty());
    // Squares declared a quarter too large: the image sees the board a quarter too far, up to the depth camera's own scale.
    assert_eq!(d.declarations.len(), 1);
    assert!((d.declarations[0].scale * 1.25 - 1.0).abs() < 0.08, "{:?}", d.declarations);
    // The value that would fit is the true spacing, up to the same scale.
    let declaration = &d.declarations[0];
    assert!((declaration.fitting_spacing_mm() * 1.25 / declaration.spacing_mm - 1.0).abs() < 0.08, "{declaration:?}");
    assert!(run(&simulation(&[], 6)).declarations.is_empty());
}

/// Largest distance between the distribution of p-values and the uniform one (Kolmogorov–Smirnov).
fn distance_from_uniform(mut p_values: Vec<f64>) -> f64 {
    p_values.sort_by(f64::total_cmp);
    let n = p_values.len() as f64;
    let steps = p_values.iter().enumerate().map(|(i, p)| (p - i as f64 / n).abs().max(((i + 1) as f64 / n - p).abs()));
    steps.fold(0.0, f64::max)
}

/// 200 clean captures. With 200 values the Kolmogorov–Smirnov distance exceeds 0.115 once in a hundred; eight effects are
/// looked at, so 0.135 (once in a thousand). Nonlinear constants are searched, which makes their p-values conservative:
/// these are left out.
#[test]
fn p_values_of_clean_captures_are_uniform() {
    let names = [
        "board_bow",
        "print_scale",
        "thin_prism",
        "tilted_sensor",
        "depth_registration",
        "range_offset",
        "incidence_bias",
        "radial_range",
    ];
    let all: Vec<Vec<f64>> = (0..200_u64)
        .into_par_iter()
        .map(|seed| {
            let observed = simulation(&[], 7000 + seed).observe_points(&PointOptions::default()).unwrap();
            let options = CameraOptions::default();
            let fit = calibrate_camera(&simulated::capture(&observed), &options).unwrap();
            let scores = scores(&fit, &options.register, &names.map(PieceSpec::new)).unwrap();
            scores.iter().map(|s| s.p_value).collect()
        })
        .collect();
    for (i, name) in names.iter().enumerate() {
        let distance = distance_from_uniform(all.iter().map(|p| p[i]).collect());
        println!("{name}: Kolmogorov–Smirnov distance {distance:.3}");
        assert!(distance < 0.135, "{name}: {distance}");
    }
}

/// Planes of the frames' own are χ² with three degrees of freedom in clean captures: mean 3, here within five standard
/// errors (√6 each) of 27 frames in 10 captures.
#[test]
fn frames_have_no_planes_of_their_own_in_clean_captures() {
    let mut statistics = Vec::new();
    for seed in 0..10 {
        let observed = simulation(&[], 8000 + seed).observe_points(&PointOptions::default()).unwrap();
        let fit = calibrate_camera(&simulated::capture(&observed), &CameraOptions::default()).unwrap();
        statistics.extend(frame_planes(&fit).iter().map(|p| p.statistic));
    }
    let n = statistics.len() as f64;
    let mean = statistics.iter().sum::<f64>() / n;
    assert!((mean - 3.0).abs() < 5.0 * (6.0 / n).sqrt(), "mean {mean} over {n} frames");
}
