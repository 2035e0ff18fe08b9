//! A depth model from outside depthcal's crates: an error that grows with the third power of the distance from the middle
//! of the image. Declared in 20 lines, it is calibrated, saved, loaded, compared, and tried by the diagnosis like the
//! built-in ones.
//!
//! `cargo run --release --example own_depth_model -- DATASET` on a dataset of yours; without one a capture is simulated.

use std::path::PathBuf;

use depthcal::calibration::calibrate::{CalibrateOptions, calibrate};
use depthcal::calibration::compare::{CompareOptions, compare, tables};
use depthcal::calibration::diagnose::account::text;
use depthcal::calibration::diagnose::{DiagnoseOptions, diagnose};
use depthcal::calibration::load::{LoadOptions, load};
use depthcal::model::hook::{Depth, DepthState};
use depthcal::model::{Context, Parameter, Piece, Register, Scalar};
use depthcal_simulate::{CameraTruth, Effect, Kind, Simulation};

// --8<-- the model
/// ρ_m = ρ (1 + s r³), r the distance from the optical axis on the normalised image plane.
#[derive(Debug)]
struct CubicVignette;

impl Piece<Depth, 1> for CubicVignette {
    const NAME: &'static str = "cubic_vignette";
    const SUMMARY: &'static str = "depth grows wrong towards the corners";
    const EQUATION: &'static str = "ρ (1 + s r³)";
    const SOURCE: &'static str = "an example";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("s", "1", 0.0, 1e-2)
        .meaning("Growth with the third power of the distance from the optical axis.")];

    fn map<T: Scalar>(&self, state: DepthState<T>, [s]: [T; 1], _: &Context) -> T {
        let r2 = state.x * state.x + state.y * state.y;
        // The small number keeps the derivative finite on the axis.
        let r3 = r2 * (r2 + 1e-12).sqrt();
        state.rho * (s * r3 + 1.0)
    }
}

/// depthcal's pieces and this one.
fn register() -> Register {
    let mut register = Register::builtin();
    register.add(|_| CubicVignette);
    register
}
// --8<-- end of the model

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let simulated = std::env::temp_dir().join(format!("own_depth_model_{}", std::process::id()));
    let dataset = match std::env::args().nth(1) {
        Some(path) => PathBuf::from(path),
        None => {
            // A range that is partly reported as depth grows towards the image's corners as well.
            let effect = Effect::new("radial_range", 8.0)?;
            Simulation::new(CameraTruth::published(1)?, Kind::General(1), &[effect], 1)
                .frames(18)
                .write_dataset(&simulated)?;
            simulated.clone()
        }
    };
    let capture = load(&dataset, &LoadOptions { cache: None, ..LoadOptions::default() })?.capture;
    let options = CalibrateOptions { register: register(), ..CalibrateOptions::default() };

    let model = "projective+cubic_vignette".to_owned();
    let result = calibrate(&capture, &CalibrateOptions { model: model.parse()?, ..options.clone() })?;
    let block = result.camera.block("cubic_vignette").ok_or("the model is in the camera")?;
    println!("s = {:.3e}", block.theta[0]);

    let models = vec!["projective".to_owned(), model, "projective+bspline".to_owned()];
    let comparison = compare(
        &capture,
        &[],
        &CompareOptions {
            models: models.iter().map(|m| m.parse()).collect::<Result<_, _>>()?,
            calibrate: options.clone(),
            folds: 3,
            thesis: false,
            learning_fits: 0,
            ..CompareOptions::default()
        },
    )?;
    for table in tables::tables(&comparison) {
        println!("\n{}\n{}", table.title, table.text);
    }
    println!("{}\n", comparison.verdict.join("\n"));

    // What does D lack? The model is one of the effects that are tried.
    let diagnosis = diagnose(&capture, None, &DiagnoseOptions { calibrate: options, ..DiagnoseOptions::default() })?;
    println!("{}", text(&diagnosis));
    if simulated.exists() {
        std::fs::remove_dir_all(simulated)?;
    }
    Ok(())
}
