//! Comparing depth models on rendered captures whose truth is known, with a model from outside the crates among them.

#![cfg(feature = "detect")]

use depthcal::calibration::calibrate::CameraOptions;
use depthcal::calibration::compare::{CompareOptions, compare, tables};
use depthcal::calibration::load::{LoadOptions, load};
use depthcal::calibration::observe::CameraFrames;
use depthcal::io::Comparison;
use depthcal::model::hook::{Depth, DepthState};
use depthcal::model::{Context, Parameter, Piece, Register, Scalar};
use depthcal_simulate::{CameraTruth, Effect, Kind, Simulation};

/// A scale of inverse depth that grows with the distance from the axis: a model that depthcal does not have.
#[derive(Debug)]
struct Outside;

impl Piece<Depth, 1> for Outside {
    const NAME: &'static str = "outside";
    const SUMMARY: &'static str = "the scale grows with the distance from the axis";
    const EQUATION: &'static str = "ρ (1 + s r²)";
    const SOURCE: &'static str = "a test";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("s", "1", 0.0, 1e-2)];

    fn map<T: Scalar>(&self, state: DepthState<T>, [s]: [T; 1], _: &Context) -> T {
        state.rho * (s * (state.x * state.x + state.y * state.y) + 1.0)
    }
}

fn rendered(camera: usize, kind: Kind, effects: &[Effect], frames: usize) -> CameraFrames {
    let folder = tempfile::tempdir().unwrap();
    let camera = CameraTruth::published(camera).unwrap();
    Simulation::new(camera, kind, effects, 4)
        .frames(frames)
        .write_dataset(folder.path().join(kind.to_string()))
        .unwrap();
    let options = LoadOptions { cache: None, ..LoadOptions::default() };
    load(&folder.path().join(kind.to_string()), &options).unwrap().into_only_camera().unwrap().capture
}

fn options(models: &[&str]) -> CompareOptions {
    let mut register = Register::builtin();
    register.add(|_| Outside);
    CompareOptions {
        models: models.iter().map(|m| m.parse().unwrap()).collect(),
        calibrate: CameraOptions { register, ..CameraOptions::default() },
        folds: 3,
        learning_sizes: vec![4, 8],
        learning_fits: 1,
        ..CompareOptions::default()
    }
}

/// Camera 2 without further effects: D is the truth. What lacks it is really worse, what contains it is not; the thesis'
/// pattern of subsets shows; D is stable.
#[test]
fn camera_2_has_the_thesis_pattern() {
    let train = rendered(2, Kind::General(1), &[], 12);
    let verify = [rendered(2, Kind::General(2), &[], 5), rendered(2, Kind::Plywood1, &[], 4)];
    let models = ["none", "projective:xw", "projective", "projective+bspline", "projective+outside"];
    let (comparison, _) = compare(&train, &verify, &options(&models)).unwrap();
    for table in tables::tables(&comparison) {
        println!("{}\n{}", table.title, table.text);
    }
    println!("{}", comparison.verdict.join("\n"));
    let error = |name: &str| comparison.model(name).unwrap().held_out.dot_error_mm.unwrap();
    assert_eq!(comparison.verify, ["general2", "plywood1"]);
    assert!(
        comparison
            .models
            .windows(2)
            .all(|w| { w[0].held_out.dot_error_mm.unwrap().mean <= w[1].held_out.dot_error_mm.unwrap().mean })
    );
    assert!(comparison.model("none").unwrap().really_worse && comparison.model("projective:xw").unwrap().really_worse);
    assert!(!comparison.model("projective").unwrap().really_worse);
    // Fields and further parameters that are not needed cost next to nothing.
    for name in ["projective+bspline", "projective+outside"] {
        assert!(error(name).mean < 1.05 * error("projective").mean, "{name}: {:?}", error(name));
    }
    let interval = error("projective");
    assert!(interval.low < interval.mean && interval.mean < interval.high && interval.mean < 3.0, "{interval:?}");
    // All subsets by the thesis' estimator and by the joint adjustment, with and without lens.
    let joint = |model: &str, lens: &str| {
        let variant = comparison
            .variants
            .iter()
            .find(|v| v.model.to_string() == model && v.lens == lens && v.estimator == "joint");
        variant.unwrap().held_out.dot_error_mm.unwrap().mean
    };
    assert!(joint("projective", "none") > 1.5 * joint("projective", "brown-conrady"), "without lens clearly worse");
    let stability = comparison.stability.as_ref().unwrap();
    assert_eq!(stability.degrees_of_freedom, 8);
    assert!(stability.p_value > 1e-3, "{:?}", stability.verdict);
    assert!(comparison.learning_curve.iter().any(|p| p.model.to_string() == "projective" && p.frames == 4));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("comparison.json");
    comparison.write(&path).unwrap();
    assert_eq!(Comparison::read(&path).unwrap(), comparison);
}

/// A correction that no D can make, judged on frames that are left out.
#[test]
fn fields_win_where_the_truth_is_not_projective() {
    let effect = Effect::new("smooth_map", 10.0).unwrap();
    let train = rendered(1, Kind::General(1), &[effect], 18);
    let options = CompareOptions { thesis: false, learning_fits: 0, ..options(&["projective", "projective+bspline"]) };
    let (comparison, _) = compare(&train, &[], &options).unwrap();
    println!("{}", comparison.verdict.join("\n"));
    assert_eq!(comparison.models[0].model.to_string(), "projective+bspline");
    let plane = |name: &str| comparison.model(name).unwrap().held_out.plane_error_mm.unwrap().mean;
    println!("plane error {:.2} mm against {:.2} mm", plane("projective+bspline"), plane("projective"));
    assert!(plane("projective+bspline") < 0.95 * plane("projective"));
}
