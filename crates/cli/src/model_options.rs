//! The model to fit, for commands that fit on the way to something else.

use clap::Args;
use depthcal_calibration::calibrate::Estimator;
use depthcal_calibration::judge::parts::Parts;
use depthcal_calibration::task::{FitRequest, ModelRequest, OptionNames};
use depthcal_model::Register;

use super::failure::Failure;
use super::formula_files;

/// Options of the model.
#[derive(Debug, Args)]
pub(super) struct ModelOptions {
    /// Depth model, as for `calibrate`.
    #[arg(long, default_value = "projective")]
    model: String,
    /// Further effects, as for `calibrate`.
    #[arg(long, value_delimiter = ',', value_name = "EFFECT,…")]
    with: Vec<String>,
    /// Lens model, as for `calibrate`.
    #[arg(long)]
    lens: Option<String>,
}

impl ModelOptions {
    /// Puts the names of effects where files of formulas are named, and adds these effects to the register.
    pub(super) fn load_formulas(&mut self, register: &mut Register) -> Result<(), Failure> {
        self.model = formula_files::resolve_model("--model", &self.model, register)?;
        self.with = formula_files::resolve("--with", &self.with, register)?;
        self.lens = formula_files::resolve_lens("--lens", self.lens.as_deref(), register)?;
        Ok(())
    }

    /// A joint fit of the model to all frames.
    pub(super) fn request(&self) -> FitRequest {
        FitRequest {
            model: ModelRequest {
                names: OptionNames::COMMAND_LINE,
                model: self.model.clone(),
                with: self.with.clone(),
                lens: self.lens.clone(),
            },
            estimator: Estimator::Joint,
            hold_out: None,
            cross_validate: None,
            parts: Parts::Interleaved,
            priors: Vec::new(),
        }
    }
}
