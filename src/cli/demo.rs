use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use depthcal_simulate::{CameraTruth, Effect, Kind, Simulation};

use super::calibrate::print_parameters;
use super::common::{Failure, Reading, input, write_calibration, write_report};
use crate::calibrate::{CalibrateOptions, calibrate};
use crate::evaluate::{Evaluated, evaluate, table};
use crate::report::{ReportDataset, ReportInput, Role};

/// What the demo's camera has and its model does not declare.
const EFFECT: &str = "projector_distortion";
/// Its size, mm rms over the working volume; most of it looks like D and lens, and what does not is left over.
const SIZE_MM: f64 = 8.0;
const SEED: u64 = 1;
/// Tells captures that an earlier demo made, which may be replaced, from everything else.
const MARK: &str = ".made-by-depthcal-demo";

/// Simulates captures of a camera with an error that the model lacks, calibrates it, and reports.
///
/// Two captures are rendered: one to fit, one that only judges the result. The camera is camera 1 of the thesis, with a
/// distortion of its projector's lens that `projective` does not describe: the report shows what that leaves over.
#[derive(Debug, Args)]
pub(super) struct Demo {
    /// Folder for captures and results.
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
}

impl Demo {
    pub(super) fn run(&self) -> Result<(), Failure> {
        let captures = self.out.join("captures");
        clear(&captures)?;
        let (fitted, other) = (captures.join("general1"), captures.join("general2"));
        println!("rendering two captures of a camera with {EFFECT}, which the model will not declare");
        render(&fitted, Kind::General(1))?;
        render(&other, Kind::General(2))?;

        let reading = Reading { refresh: false, no_cache: true };
        let loaded = reading.load(&fitted)?;
        let result = calibrate(&loaded.capture, &CalibrateOptions::default())?;
        print_parameters(&result);
        let judge = reading.load(&other)?;
        let evaluated: Vec<Evaluated> =
            [&result.capture, &judge.capture].map(|capture| evaluate(&result.camera, capture)).into();
        let records: Vec<_> = evaluated.iter().map(Evaluated::record).collect();
        println!("\n{}", table(&records, Some(&result.capture.name)));

        write_calibration(&result, &evaluated[0], &loaded, records, &self.out)?;
        let datasets = [
            ReportDataset { evaluated: &evaluated[0], role: Role::Fitted },
            ReportDataset { evaluated: &evaluated[1], role: Role::Other },
        ];
        let report = ReportInput {
            title: "Demo: a depth camera whose projector lens distorts".to_owned(),
            command_line: "depthcal demo".to_owned(),
            calibrated: Some(&result),
            evaluations: &datasets,
            story: &story(),
        };
        let path = write_report(&report, &self.out)?;
        println!("written: {}", path.display());
        Ok(())
    }
}

fn story() -> Vec<String> {
    vec![
        format!(
            "The captures were simulated: camera 1 of Sjöholm 2017 with its published lens and depth distortion, and on \
             top of it the effect '{EFFECT}', a distortion of the projector's lens. The dataset does not say so, and \
             the model that was fitted ('projective') does not have it."
        ),
        "One capture (general1) was fitted; the other (general2) was seen by nothing but the evaluation. What the fitted \
         model leaves over is in the maps of what remains."
            .to_owned(),
    ]
}

fn render(folder: &Path, kind: Kind) -> Result<(), Failure> {
    let camera = CameraTruth::published(1).map_err(input)?;
    let effect = Effect::new(EFFECT, SIZE_MM).map_err(input)?;
    Simulation::new(camera, kind, &[effect], SEED).write_dataset(folder).map_err(input)?;
    Ok(())
}

/// Makes room for new captures; nothing that is not an earlier demo's goes.
fn clear(captures: &Path) -> Result<(), Failure> {
    let unwritable = |e: std::io::Error| Failure::Input(format!("{}: cannot write here: {e}", captures.display()));
    if captures.exists() {
        if !captures.join(MARK).exists() {
            let shown = captures.display();
            return Err(Failure::Input(format!("{shown} exists and is not an earlier demo's: give another --out")));
        }
        fs::remove_dir_all(captures).map_err(unwritable)?;
    }
    fs::create_dir_all(captures).map_err(unwritable)?;
    fs::write(captures.join(MARK), "").map_err(unwritable)
}
