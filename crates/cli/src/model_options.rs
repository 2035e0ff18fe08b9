//! The model to fit: options that all commands share that fit one.

use clap::Args;
use depthcal_calibration::calibrate::Estimator;
use depthcal_calibration::judge::parts::Parts;
use depthcal_calibration::task::{FitRequest, ModelRequest, OptionNames};
use depthcal_formula::{resolve, resolve_lens, resolve_model};
use depthcal_model::Register;

use super::failure::Failure;

/// Options of the model.
#[derive(Debug, Args)]
pub(super) struct ModelOptions {
    /// Depth model: none, projective, projective:xw (only dx and dw free), or a stack such as projective+cyclic_depth.
    #[arg(long, default_value = "projective")]
    model: String,
    /// Further effects, such as thin_prism or cyclic_depth@period_mm=300; docs/model.md lists them. fixed:PIECE.PARAMETER holds
    /// a parameter instead of fitting it, at a value if one is given: fixed:brown_conrady.k3, fixed:pinhole.cx=319.5. Of one
    /// camera of a rig: colour:thin_prism, fixed:colour:pinhole.cx. colour:time_offset estimates by how much this camera exposes
    /// later than its times say, from a video of a board that moves.
    #[arg(long, value_delimiter = ',', value_name = "EFFECT,…")]
    with: Vec<String>,
    /// Lens model [default: that of dataset.toml, else brown-conrady]. Terms of brown-conrady that the markers do not determine
    /// over the whole image are chosen on left-out frames; brown-conrady:full (k1k2p1p2, k1k2, k1), opencv8, opencv12, opencv14,
    /// kannala-brandt, division and none fit what they say; auto compares all on left-out frames. A lens of your own is given by
    /// its name, or as a file of its formula.
    #[arg(long)]
    lens: Option<String>,
}

impl ModelOptions {
    /// Puts the names of effects where files of formulas are named, and adds these effects to the register.
    pub(super) fn load_formulas(&mut self, register: &mut Register) -> Result<(), Failure> {
        self.model = resolve_model("--model", &self.model, register)?;
        self.with = resolve("--with", &self.with, register)?;
        self.lens = resolve_lens("--lens", self.lens.as_deref(), register)?;
        Ok(())
    }

    /// The model in words.
    pub(super) fn model(&self) -> ModelRequest {
        ModelRequest {
            names: OptionNames::COMMAND_LINE,
            model: self.model.clone(),
            with: self.with.clone(),
            lens: self.lens.clone(),
        }
    }

    /// A joint fit of the model to all frames.
    pub(super) fn request(&self) -> FitRequest {
        FitRequest {
            model: self.model(),
            estimator: Estimator::Joint,
            hold_out: None,
            cross_validate: None,
            parts: Parts::Interleaved,
            priors: Vec::new(),
        }
    }
}
