//! Quantities of frames that users record in columns of `frames.csv`: found by a diagnosis, fitted by formulas, corrected.

use depthcal::calibration::calibrate::{CalibrateError, CalibratedCamera, CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::{CameraDiagnoseOptions, CameraDiagnosis, diagnose_camera};
use depthcal::calibration::observe::{CameraFrames, DetectedFrame};
use depthcal::calibration::simulated;
use depthcal::correction::{Corrector, FrameContext};
use depthcal::formula::FormulaFile;
use depthcal::io::Verdict;
use depthcal::model::{Quantities, Quantity, Register};
use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Depth that is too large by so many mm for every ms of exposure beyond [`REFERENCE_MS`].
const MM_PER_MS: f64 = 0.6;
const REFERENCE_MS: f64 = 10.0;
const FORMULA: &str = r#"
    [[effect]]
    name = "exposure_shift"
    hook = "depth"
    of = "measured"
    formula = "a * (exposure_ms - e0)"
    parameters = { a = "mm/ms" }
    constants = { e0 = { value = 10, unit = "ms" } }
"#;

fn exposure() -> Quantity {
    Quantity::named("exposure_ms").unwrap()
}

/// A capture whose depth follows the exposure of its frames, which is chosen at random; with or without the column.
fn capture(seed: u64, with_column: bool) -> CameraFrames<DetectedFrame> {
    let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], seed).unit(seed);
    let mut capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for frame in &mut capture.frames {
        let ms = rng.random_range(2.0..18.0);
        let quantities = if with_column { Quantities::new([(exposure(), ms)]) } else { Quantities::NONE };
        frame.raw.quantities = quantities;
        for pixel in frame.raw.depth_pixels_mut() {
            pixel.depth_mm += MM_PER_MS * (ms - REFERENCE_MS);
            pixel.context.quantities = quantities;
        }
    }
    capture
}

fn diagnosed(capture: &CameraFrames<DetectedFrame>) -> CameraDiagnosis {
    diagnose_camera(capture, None, &CameraDiagnoseOptions::default()).unwrap()
}

fn fitted(capture: &CameraFrames<DetectedFrame>, formula: &str) -> Result<CalibratedCamera, CalibrateError> {
    let effect = FormulaFile::parse(formula).unwrap().effects()[0].clone();
    let mut options = CameraOptions { effects: vec![effect.name().parse().unwrap()], ..CameraOptions::default() };
    effect.register(&mut options.register).unwrap();
    calibrate_camera(capture, &options)
}

#[test]
fn a_diagnosis_finds_a_function_of_a_column() {
    for seed in [1, 2] {
        let d = diagnosed(&capture(seed, true));
        let formulas: Vec<String> = d.formulas.iter().map(|f| f.effect.text()).collect();
        assert!(formulas.iter().any(|text| text.contains("exposure_ms")), "seed {seed}: {:?} {formulas:?}", d.verdict);
        // A smooth function without a name is a correction, too; of the error of 2.8 mm, root mean square, little is left.
        assert!(matches!(d.verdict, Verdict::Effect | Verdict::Unexplained), "seed {seed}: {:?}", d.verdict);
        let [before, after] = [&d.before, &d.after].map(|state| state.errors.depth_rms_mm.unwrap());
        assert!(after < 0.8 * before, "seed {seed}: {after} of {before} mm");
        let without = diagnosed(&capture(seed, false));
        assert_ne!(without.verdict, Verdict::Adequate, "seed {seed}");
        // Nothing depends on a column that changes nothing.
        let mut other = capture(seed, false);
        let mut rng = ChaCha8Rng::seed_from_u64(seed + 100);
        for frame in &mut other.frames {
            let quantities = Quantities::new([(exposure(), rng.random_range(2.0..18.0))]);
            frame.raw.quantities = quantities;
            frame.raw.depth_pixels_mut().iter_mut().for_each(|pixel| pixel.context.quantities = quantities);
        }
        let d = diagnosed(&other);
        assert!(d.formulas.iter().all(|f| !f.effect.text().contains("exposure_ms")), "seed {seed}: {:?}", d.verdict);
    }
}

/// The parameter is within four of its standard deviations, and what it corrects is what was added.
#[test]
fn a_formula_of_a_column_is_fitted_and_corrected() {
    let capture = capture(3, true);
    let fit = fitted(&capture, FORMULA).unwrap();
    let blocks = fit.camera.blocks();
    let before = blocks.iter().position(|block| block.name() == "exposure_shift").unwrap();
    let place: usize = blocks[..before].iter().map(|block| block.theta.len()).sum();
    let (value, std_dev) = (blocks[before].theta[0], fit.std_devs()[place].unwrap());
    assert!((value - MM_PER_MS).abs() < 4.0 * std_dev && std_dev < 0.05, "{value} ± {std_dev}");

    let corrector = Corrector::new(&fit.camera).unwrap();
    let needs: Vec<&str> = corrector.needs().quantities.into_iter().flatten().map(Quantity::name).collect();
    assert!(needs == ["exposure_ms"] && corrector.has_tables());
    let pixels = corrector.width() * corrector.height();
    let corrected = |quantities: Quantities| {
        let mut depth = vec![1500.0_f32; pixels];
        corrector.correct_f32_in_place(&mut depth, &FrameContext { quantities, ..FrameContext::default() }).unwrap();
        f64::from(depth[pixels / 2 + corrector.width() / 2])
    };
    let [short, long, unknown] = [Some(6.0), Some(14.0), None]
        .map(|ms| corrected(ms.map_or(Quantities::NONE, |ms| Quantities::new([(exposure(), ms)]))));
    // D in front of it may stretch depth by some per cent.
    assert!(((short - long) / (8.0 * value) - 1.0).abs() < 0.1, "{short} {long}");
    assert!((unknown - 0.5 * (short + long)).abs() < 0.05, "{unknown}: nothing is corrected where it is unknown");
}

#[test]
fn a_column_that_is_not_there_is_named() {
    let error = fitted(&capture(4, true), &FORMULA.replace("exposure_ms", "laser_ms")).unwrap_err().to_string();
    assert!(error.contains("'laser_ms'") && error.contains("exposure_ms"), "{error}");
    let error = fitted(&capture(4, false), FORMULA).unwrap_err().to_string();
    assert!(error.contains("'exposure_ms'") && error.contains("no column"), "{error}");
    let unknown = FORMULA.replace("exposure_ms", "exposure");
    let error = FormulaFile::parse(&unknown).unwrap_err().to_string();
    assert!(error.contains("'exposure'") && error.contains("ends in its unit"), "{error}");
    let clash = FORMULA.replace("mm/ms", "mm/s");
    let error = FormulaFile::parse(&clash).unwrap_err().to_string();
    assert!(error.contains("in mm ms/s"), "{error}");
    // Parameters and constants come before columns.
    let named = FORMULA.replace("e0", "e0_ms");
    assert!(FormulaFile::parse(&named).is_ok());
    assert!(Register::builtin().find("exposure_shift").is_none());
}
