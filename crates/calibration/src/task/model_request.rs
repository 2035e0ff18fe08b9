//! The model that is asked for, in words.

use depthcal_formula::{resolve, resolve_model};
use depthcal_io::Dataset;
use depthcal_model::{ModelSpec, PieceSpec, Register};

use super::error::TaskError;
use crate::calibrate::{CalibrateOptions, HeldParameter};
use crate::load::{Loaded, declared_camera};

/// Lens models that may be asked for.
pub const LENSES: [&str; 12] = [
    "brown-conrady",
    "brown-conrady:full",
    "brown-conrady:k1k2p1p2",
    "brown-conrady:k1k2",
    "brown-conrady:k1",
    "opencv8",
    "opencv12",
    "opencv14",
    "kannala-brandt",
    "division",
    "none",
    "auto",
];

/// The lens model of a fit: that which was asked for, else that of the dataset, else Brown–Conrady.
pub fn lens_of(asked: Option<&str>, dataset: &Dataset) -> String {
    let declared = dataset.camera.as_ref().and_then(|camera| camera.lens.as_deref());
    asked.or(declared).unwrap_or("brown-conrady").to_owned()
}

/// How the user of a program writes its options; for messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OptionNames {
    /// The depth model.
    pub model: &'static str,
    /// Further effects.
    pub with: &'static str,
}

impl OptionNames {
    /// Those of the command line.
    pub const COMMAND_LINE: Self = Self { model: "--model", with: "--with" };
    /// Those of functions.
    pub const ARGUMENTS: Self = Self { model: "model", with: "effects" };
}

/// The model that is asked for, in words.
#[derive(Debug, Clone)]
pub struct ModelRequest {
    /// How its user writes the options.
    pub names: OptionNames,
    /// Depth model: `none`, `projective`, `projective:xw`, or a stack such as `projective+cyclic_depth`.
    pub model: String,
    /// Further effects such as `cyclic_depth@period_mm=300`, files of formulas, and `fixed:PIECE.PARAMETER` to hold a parameter.
    pub with: Vec<String>,
    /// Lens model, one of [`LENSES`]; `None` is that of the dataset, else Brown–Conrady.
    pub lens: Option<String>,
}

impl ModelRequest {
    /// Puts the names of effects where files of formulas are named, and adds these effects to the register.
    ///
    /// # Errors
    ///
    /// [`TaskError::Formula`].
    pub fn load_formulas(&mut self, register: &mut Register) -> Result<(), TaskError> {
        self.model = resolve_model(self.names.model, &self.model, register)?;
        self.with = resolve(self.names.with, &self.with, register)?;
        Ok(())
    }

    /// The model of `base` replaced by this one, which the register of `base` knows.
    ///
    /// # Errors
    ///
    /// [`TaskError::Option`] where a name, a constant or a parameter is unknown.
    pub fn options(&self, base: CalibrateOptions) -> Result<CalibrateOptions, TaskError> {
        let (effects, held) = self.effects(&base.register)?;
        let model = self.depth_model(&base.register)?;
        Ok(CalibrateOptions { model, effects, held, ..base })
    }

    /// The depth model.
    fn depth_model(&self, register: &Register) -> Result<ModelSpec, TaskError> {
        let text = &self.model;
        register.model_spec(text).map_err(|e| TaskError::option(self.names.model, text, e))
    }

    /// The effects that are asked for, and the parameters that are held.
    fn effects(&self, register: &Register) -> Result<(Vec<PieceSpec>, Vec<HeldParameter>), TaskError> {
        let (mut effects, mut held) = (Vec::new(), Vec::new());
        for text in &self.with {
            match text.strip_prefix("fixed:") {
                Some(parameter) => {
                    let parameter = parameter.parse::<HeldParameter>();
                    held.push(parameter.map_err(|e| TaskError::option(self.names.with, text, e))?);
                }
                None => {
                    let spec = register.piece_spec(text);
                    effects.push(spec.map_err(|e| TaskError::option(self.names.with, text, e))?);
                }
            }
        }
        Ok((effects, held))
    }

    /// Options with the lens and the camera of a dataset.
    ///
    /// # Errors
    ///
    /// [`TaskError::Camera`] where the camera that the dataset declares is at fault.
    pub fn for_dataset(&self, options: CalibrateOptions, loaded: &Loaded) -> Result<CalibrateOptions, TaskError> {
        let (width, height) = (loaded.capture.width, loaded.capture.height);
        let asked = self.lens.as_deref();
        let camera = declared_camera(&loaded.dataset, width, height, asked, &options.register)?;
        Ok(CalibrateOptions { lens: lens_of(asked, &loaded.dataset), camera, ..options })
    }
}
