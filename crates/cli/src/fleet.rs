//! `fleet`: what the calibrations of one camera type say together.

use std::path::PathBuf;

use clap::Args;
use depthcal_fleet::{FleetError, FleetOptions, join, read_units};
use depthcal_report::{FleetResults, fleet_text};
use serde_json::{Value, json};

use super::common::{Output, made, value_of};
use super::failure::Failure;
use super::results::save;
use super::session::Session;
use super::voice::say;

/// Joins the calibrations of many cameras of one type: what they share, how they scatter, which is unlike the others, and a prior
/// for the next one.
///
/// Effects are found that no unit alone shows, where scores.json lies next to each calibration.json, as `calibrate` and
/// `diagnose` write it. Writes fleet.json (the record), prior.json (for `calibrate --prior`) and report.html.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal fleet results/ --out fleet/                      results/*/calibration.json, one folder per unit
  depthcal fleet a/ b/ c/calibration.json --out fleet/
  depthcal calibrate new-unit/ --prior fleet/prior.json --out r/
  depthcal fleet results/ --json --out fleet/ | jq '.fleet.outliers[].name'")]
pub(super) struct Fleet {
    /// Calibrations, folders of results, or folders of such folders.
    #[arg(required = true, value_name = "CALIBRATION")]
    calibrations: Vec<PathBuf>,
    /// Chance of any false finding in each family of tests: shared effects, differences, outliers.
    #[arg(long, value_name = "P", default_value_t = FleetOptions::default().level)]
    level: f64,
    #[command(flatten)]
    pub(super) output: Output,
}

impl From<FleetError> for Failure {
    fn from(error: FleetError) -> Self {
        match error {
            FleetError::NotPositiveDefinite => Failure::Untrusted(error.to_string()),
            other => Failure::Input(other.to_string()),
        }
    }
}

impl Fleet {
    pub(super) fn run(&self, session: &Session) -> Result<Value, Failure> {
        if !(self.level > 0.0 && self.level < 1.0) {
            return Err(Failure::Input(format!("--level {}: must be a number between 0 and 1", self.level)));
        }
        self.output.prepare()?;
        let stage = session.progress.stage("joining units");
        let (units, left_out) = read_units(&self.calibrations, &session.register)?;
        let joined = join(units, left_out, &FleetOptions { level: self.level })?;
        drop(stage);
        say!("{}", fleet_text(&joined.fleet));
        let results = FleetResults { fleet: &joined.fleet, prior: &joined.prior };
        save(&results, &made(session), &self.output.out, session, || Ok(()))?;
        let [file, prior, report] = ["fleet.json", "prior.json", "report.html"].map(|name| self.output.out.join(name));
        say!("written: {}, {} and {}", file.display(), prior.display(), report.display());
        Ok(json!({
            "fleet": value_of(&joined.fleet)?,
            "prior": value_of(&joined.prior)?,
            "written": [file, prior, report],
        }))
    }
}
