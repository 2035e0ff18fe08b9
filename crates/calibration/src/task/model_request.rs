//! The model that is asked for, in words.

use depthcal_formula::{resolve, resolve_lens, resolve_model};
use depthcal_model::{ModelSpec, Register};

use super::error::TaskError;
use super::option_names::OptionNames;
use crate::calibrate::{AUTO, CalibrateOptions, CameraOptions, EffectOf, HeldOf, HeldParameter, lens_named};
use crate::load::{Loaded, LoadedCamera};
use crate::start::lens_models;

/// The name of the time by which a camera exposes later than its times say, among effects.
const TIME_OFFSET: &str = "time_offset";

/// Lens models that may be asked for, apart from those that a program has added.
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

/// The model that is asked for, in words.
#[derive(Debug, Clone)]
pub struct ModelRequest {
    /// How its user writes the options.
    pub names: OptionNames,
    /// Depth model: `none`, `projective`, `projective:xw`, or a stack such as `projective+cyclic_depth`.
    pub model: String,
    /// Further effects such as `cyclic_depth@period_mm=300`, files of formulas, and `fixed:PIECE.PARAMETER` to hold a parameter.
    pub with: Vec<String>,
    /// Lens model, one of [`LENSES`] or a piece of lenses; `None` is that of the dataset, else Brown–Conrady.
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
        self.lens = resolve_lens(self.names.lens, self.lens.as_deref(), register)?;
        Ok(())
    }

    /// Refuses words that mean nothing, before anything is read; effects of several cameras are checked when these are known.
    ///
    /// # Errors
    ///
    /// [`TaskError::Option`].
    pub fn check(&self, cameras: usize, register: &Register) -> Result<(), TaskError> {
        self.check_lens(register)?;
        if cameras == 1 {
            self.check_effects(register)?;
        }
        self.depth_model(register).map(drop)
    }

    /// Checks that the register knows the lens model.
    fn check_lens(&self, register: &Register) -> Result<(), TaskError> {
        let Some(lens) = self.lens.as_deref().filter(|lens| *lens != AUTO) else { return Ok(()) };
        let known = || {
            let models = lens_models(register).into_iter().map(|model| model.name);
            let others: Vec<&str> = models.filter(|name| !LENSES.contains(name)).collect();
            LENSES.into_iter().chain(others).collect::<Vec<_>>().join(", ")
        };
        lens_named(lens, register)
            .map(|_| ())
            .map_err(|_| TaskError::option(self.names.lens, lens, format!("is no lens model; known are {}", known())))
    }

    /// The depth model, which the register knows.
    pub(super) fn depth_model(&self, register: &Register) -> Result<ModelSpec, TaskError> {
        let text = &self.model;
        register.model_spec(text).map_err(|e| TaskError::option(self.names.model, text, e))
    }

    /// Refuses effects and held parameters of a camera that is alone that mean nothing.
    fn check_effects(&self, register: &Register) -> Result<(), TaskError> {
        for text in &self.with {
            let wrong = |problem: String| TaskError::option(self.names.with, text, problem);
            match text.strip_prefix("fixed:") {
                Some(held) => held.parse::<HeldParameter>().map(drop).map_err(|e| wrong(e.to_string()))?,
                None => register.piece_spec(text).map(drop).map_err(|e| wrong(e.to_string()))?,
            }
        }
        Ok(())
    }

    /// The model of `base` replaced by this one for all cameras of a dataset. Effects, held parameters and time offsets of one
    /// camera begin with its name: `CAMERA:NAME`, `fixed:CAMERA:PIECE.PARAMETER`, `CAMERA:time_offset`.
    ///
    /// # Errors
    ///
    /// [`TaskError::Option`] where a name, a constant or a parameter is unknown.
    pub fn options(&self, base: CameraOptions, loaded: &Loaded) -> Result<CalibrateOptions, TaskError> {
        self.check_lens(&base.register)?;
        let model = self.depth_model(&base.register)?;
        let each = CameraOptions { model, ..base };
        let mut options = CalibrateOptions { each, lens: self.lens.clone(), ..CalibrateOptions::default() };
        let is_camera = |name: &str| loaded.cameras.iter().any(|camera| camera.name() == name);
        for text in &self.with {
            let (is_held, spec) = match text.strip_prefix("fixed:") {
                Some(held) => (true, held),
                None => (false, text.as_str()),
            };
            let (camera, spec) = match spec.split_once(':') {
                Some((name, spec)) if is_camera(name) => (Some(name.to_owned()), spec),
                _ => (None, spec),
            };
            let wrong = |problem: String| TaskError::option(self.names.with, text, problem);
            if !is_held && spec == TIME_OFFSET {
                let camera = camera.ok_or_else(|| {
                    let example = loaded.cameras.last().map_or("CAMERA", LoadedCamera::name);
                    wrong(format!("name the camera whose offset is estimated, such as {example}:{TIME_OFFSET}"))
                })?;
                options.time_offsets.push(camera);
            } else if is_held {
                let parameter = spec.parse::<HeldParameter>().map_err(|e| wrong(e.to_string()))?;
                options.held.push(HeldOf { camera, parameter });
            } else {
                let effect = options.each.register.piece_spec(spec).map_err(|e| wrong(e.to_string()))?;
                options.effects.push(EffectOf { camera, effect });
            }
        }
        Ok(options)
    }
}
