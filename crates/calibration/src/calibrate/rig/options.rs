//! Options of a rig's calibration.

use std::sync::Arc;

use crate::adjust::blocks::is_depth_only;
use crate::adjust::camera_prior::CameraPrior;
use crate::calibrate::{CalibrateOptions, HeldParameter};
use depthcal_model::{ModelSpec, PieceSpec};

use crate::calibrate::CalibrateError;
use crate::observe::CameraCapture;
use crate::observe::PlaceDrift;

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

/// Options of a rig's calibration.
#[derive(Debug, Clone, Default)]
pub struct RigOptions {
    /// Options of every camera: depth model, register, lens unless the dataset declares one. Its effects, held parameters and
    /// camera are not used.
    pub each: CalibrateOptions,
    /// The lens of every camera, whatever the dataset declares.
    pub lens: Option<String>,
    /// Effects of single cameras or of all.
    pub effects: Vec<EffectOf>,
    /// Held parameters of single cameras or of all.
    pub held: Vec<HeldOf>,
    /// Priors of single cameras from other units of their types.
    pub priors: Vec<(String, Arc<CameraPrior>)>,
    /// Cameras whose place changes with time or temperature, and how; the change is where the fit starts.
    pub drifts: Vec<(String, PlaceDrift)>,
    /// Cameras, but the reference, that expose at other moments than their times say: by how much is estimated, from frames in
    /// which the board moves.
    pub time_offsets: Vec<String>,
}

impl RigOptions {
    /// Options for one camera.
    ///
    /// # Errors
    ///
    /// [`CalibrateError::Camera`] where an effect is unknown.
    pub fn of(&self, camera: &CameraCapture) -> Result<CalibrateOptions, CalibrateError> {
        let has_depth = camera.capture.has_depth();
        let mut options =
            CalibrateOptions { effects: Vec::new(), camera: camera.declared.clone(), ..self.each.clone() };
        options.prior = self.priors.iter().find(|(name, _)| *name == camera.name).map(|(_, prior)| prior.clone());
        let lens = self.lens.as_ref().or(camera.lens.as_ref());
        options.lens = lens.unwrap_or(&self.each.lens).clone();
        if !has_depth {
            options.model = ModelSpec::none();
        }
        let concerns = |of: &Option<String>| of.as_ref().is_none_or(|name| *name == camera.name);
        options.held =
            self.held.iter().filter(|held| concerns(&held.camera)).map(|held| held.parameter.clone()).collect();
        for EffectOf { camera: of, effect } in &self.effects {
            let block =
                options.register.make(effect, None).map_err(|e| CalibrateError::of_camera(&camera.name)(e.into()))?;
            if concerns(of) && (has_depth || !is_depth_only(&block)) {
                options.effects.push(effect.clone());
            }
        }
        Ok(options)
    }
}
