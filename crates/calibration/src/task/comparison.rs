//! Depth models compared on every camera of a dataset that has depth.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_io::{Comparison, FileError};
use depthcal_model::{ModelSpec, Register};

use super::error::TaskError;
use super::made::Made;
use super::model_request::ModelRequest;
use super::results::{Results, Shown};
use crate::calibrate::{CalibratedCamera, CameraOptions, calibrate};
use crate::compare::{CompareOptions, compare};
use crate::diagnose::rig::examined;
use crate::judge::evaluate::placed_by_others;
use crate::load::Loaded;
use crate::observe::CameraFrames;

/// Depth models that are compared.
#[derive(Debug, Clone)]
pub struct CompareRequest {
    /// Lens and further effects, which are part of every model.
    pub model: ModelRequest,
    /// The depth models.
    pub models: Vec<ModelSpec>,
    /// Parts of the cross-validation without other datasets.
    pub folds: usize,
    /// Whether the tables of Sjöholm 2017 are made.
    pub thesis: bool,
    /// Fits per number of frames in the learning curve; 0 without one.
    pub learning_fits: usize,
}

/// Depth models compared on one camera.
#[derive(Debug, Clone)]
pub struct Compared {
    /// The camera.
    pub camera: String,
    /// The captures that the models were fitted to and evaluated on.
    pub captures: Vec<CameraFrames>,
    /// `comparison.json`.
    pub record: Comparison,
    /// The best model, fitted to all frames; `None` where none could be fitted.
    pub best: Option<CalibratedCamera>,
    /// The pieces that the record names.
    pub register: Register,
}

impl CompareRequest {
    /// Compares the models on every camera of `train` that has depth, by their errors on the same camera of `verify`; `base` has
    /// the register and receives progress.
    ///
    /// # Errors
    ///
    /// [`TaskError`].
    pub fn compare(
        &self,
        train: &Loaded,
        verify: &[Arc<Loaded>],
        base: CameraOptions,
    ) -> Result<Vec<Compared>, TaskError> {
        let register = base.register.clone();
        let options = self.model.options(base, train)?;
        let capture = train.capture(self.model.lens.as_deref(), &register)?;
        if let [camera] = &capture.cameras[..] {
            let captures = verify.iter().map(|v| Ok(v.only_camera()?.capture.clone()));
            let captures = captures.collect::<Result<Vec<_>, TaskError>>()?;
            let base = options.of_only(camera);
            return Ok(vec![self.compare_camera(&camera.name, camera.capture.clone(), captures, base)?]);
        }
        let fit = calibrate(&capture, &options)?;
        let mut compared = Vec::new();
        for camera in capture.cameras.iter().filter(|c| c.capture.has_depth()) {
            let Some((train, base)) = examined(camera, &fit, &options)? else { continue };
            let of_camera = |v: &Arc<Loaded>| match camera.has_markers() {
                true => v.cameras.iter().find(|c| c.name() == camera.name).map(|c| c.capture.clone()),
                false => placed_by_others(&fit.placed(), &v.observed(), &camera.name),
            };
            let captures = verify.iter().filter_map(of_camera).collect();
            compared.push(self.compare_camera(&camera.name, train, captures, base)?);
        }
        match compared.is_empty() {
            true => Err(TaskError::NoDepth { dataset: train.name.clone() }),
            false => Ok(compared),
        }
    }

    fn compare_camera(
        &self,
        name: &str,
        train: CameraFrames,
        verify: Vec<CameraFrames>,
        base: CameraOptions,
    ) -> Result<Compared, TaskError> {
        if let Some(capture) = std::iter::once(&train).chain(&verify).find(|capture| !capture.has_depth()) {
            return Err(TaskError::NoDepth { dataset: capture.name.clone() });
        }
        let (folds, frames) = (self.folds, train.frames.len());
        if folds < 2 || (verify.is_empty() && frames < folds) {
            return Err(TaskError::Folds { names: Box::new(self.model.names), folds, frames });
        }
        let options = CompareOptions {
            models: self.models.clone(),
            calibrate: base,
            folds,
            thesis: self.thesis,
            learning_fits: self.learning_fits,
            ..CompareOptions::default()
        };
        let (record, best) = compare(&train, &verify, &options)?;
        let captures = std::iter::once(train).chain(verify).collect();
        Ok(Compared { camera: name.to_owned(), captures, record, best, register: options.calibrate.register })
    }
}

impl Compared {
    /// Whether no model could be fitted.
    pub fn is_untrusted(&self) -> bool {
        self.record.models.iter().all(|model| model.failed.is_some())
    }
}

impl Results for Compared {
    fn main_file(&self) -> &'static str {
        "comparison.json"
    }

    fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        self.record.write(folder.join("comparison.json"))?;
        Ok(vec![PathBuf::from("comparison.json")])
    }

    fn shown(&self, made: &Made) -> Shown<'_> {
        Shown::Comparison {
            comparison: &self.record,
            best: self.best.as_ref(),
            register: &self.register,
            made: made.clone(),
        }
    }
}
