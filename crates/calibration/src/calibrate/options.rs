//! Options of a capture's calibration.

use std::collections::BTreeMap;
use std::sync::Arc;

use depthcal_model::{ModelSpec, PieceSpec, Register};

use super::camera_options::CameraOptions;
use super::error::CalibrateError;
use super::held::HeldParameter;
use crate::adjust::blocks::is_depth_only;
use crate::adjust::camera_prior::CameraPrior;
use crate::observe::{CameraCapture, PlaceDrift};

/// An effect of one camera, or of all.
#[derive(Debug, Clone)]
pub struct EffectOf {
    /// The camera; `None` for all that can have it.
    pub camera: Option<String>,
    /// The effect.
    pub effect: PieceSpec,
}

/// A held parameter of one camera, or of all.
#[derive(Debug, Clone)]
pub struct HeldOf {
    /// The camera; `None` for all.
    pub camera: Option<String>,
    /// The parameter.
    pub parameter: HeldParameter,
}

/// Options of a capture's calibration.
#[derive(Debug, Clone, Default)]
pub struct CalibrateOptions {
    /// Options of every camera: depth model, register, lens unless the dataset declares one. Its effects, held parameters and
    /// camera are not used.
    pub each: CameraOptions,
    /// The lens of every camera, whatever the dataset declares.
    pub lens: Option<String>,
    /// Effects of single cameras or of all.
    pub effects: Vec<EffectOf>,
    /// Held parameters of single cameras or of all.
    pub held: Vec<HeldOf>,
    /// Registers of single cameras, instead of that of [`each`](Self::each): two cameras may have different formulas of one name.
    pub registers: BTreeMap<String, Register>,
    /// Priors of single cameras from other units of their types.
    pub priors: Vec<(String, Arc<CameraPrior>)>,
    /// Cameras whose place changes with time or temperature, and how; the change is where the fit starts.
    pub drifts: Vec<(String, PlaceDrift)>,
    /// Cameras, but the reference, that expose at other moments than their times say: by how much is estimated, from frames in
    /// which the board moves.
    pub time_offsets: Vec<String>,
}

impl CalibrateOptions {
    /// Options for one camera of several. A camera without depth has, of model and effects for all, those that images show.
    ///
    /// # Errors
    ///
    /// [`CalibrateError::Camera`] where an effect is unknown.
    pub fn of(&self, camera: &CameraCapture) -> Result<CameraOptions, CalibrateError> {
        let mut options = self.of_only(camera);
        if !camera.capture.has_depth() {
            options.model = ModelSpec::none();
            let mut image_effects = Vec::new();
            for effect in std::mem::take(&mut options.effects) {
                let block = options.register.make(&effect, None);
                let block = block.map_err(|e| CalibrateError::of_camera(&camera.name)(e.into()))?;
                if !is_depth_only(&block) {
                    image_effects.push(effect);
                }
            }
            options.effects = image_effects;
        }
        Ok(options)
    }

    /// Options for a camera that is alone.
    pub fn of_only(&self, camera: &CameraCapture) -> CameraOptions {
        let concerns = |name: &Option<String>| name.as_ref().is_none_or(|name| *name == camera.name);
        let prior = self.priors.iter().find(|(name, _)| *name == camera.name).map(|(_, prior)| prior.clone());
        let lens = self.lens.as_ref().or(camera.lens.as_ref()).unwrap_or(&self.each.lens).clone();
        let effects = self.effects.iter().filter(|e| concerns(&e.camera)).map(|e| e.effect.clone()).collect();
        let held = self.held.iter().filter(|held| concerns(&held.camera)).map(|held| held.parameter.clone()).collect();
        // Pieces of the board are the same for all cameras, also for those that are never adjusted alone.
        let register = self.registers.get(&camera.name).unwrap_or(&self.each.register).clone();
        let register = register.for_board(&camera.capture.target);
        CameraOptions { camera: camera.declared.clone(), prior, lens, effects, held, register, ..self.each.clone() }
    }
}
