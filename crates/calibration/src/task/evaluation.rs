//! Errors of a calibration on datasets.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_io::{Calibration, DATASET_FILE, DatasetError, Evaluation, FileError};
use depthcal_model::Camera;

use super::error::TaskError;
use super::evaluated::{evaluation_of, extend};
use super::made::Made;
use super::report_input::{ReportCamera, ReportInput, ReportRig, Role};
use super::results::{Results, Shown};
use super::unlike_calibration::UnlikeCalibration;
use crate::calibrate::{CameraOptions, check_declared_depth};
use crate::judge::camera::evaluate_camera;
use crate::judge::evaluate::{Evaluated, evaluate};
use crate::judge::table::table;
use crate::load::{Loaded, LoadedCamera};
use crate::observe::{CameraCapture, CameraFrames, Capture, PlacedCamera};
use crate::progress::ProgressHandle;

/// Errors of a calibration on datasets, one after another.
#[derive(Debug, Clone)]
pub struct Evaluations {
    /// Name of the calibration.
    pub title: String,
    /// Its cameras, of which there is at least one.
    pub cameras: Vec<PlacedCamera>,
    /// Its record; `None` of a camera of another program.
    pub calibration: Option<Arc<Calibration>>,
    /// Errors on every dataset.
    pub datasets: Vec<(Evaluated, Role)>,
}

impl Evaluations {
    /// Measures the errors on a dataset; returns the names of calibrated cameras that it does not have. A dataset of one camera
    /// is evaluated with the camera of its name or, where the dataset or the calibration gives none, with the reference.
    ///
    /// # Errors
    ///
    /// [`TaskError::Unlike`], [`TaskError::Load`]; [`TaskError::Contradiction`] where depth contradicts the boards in the images.
    pub fn add(&mut self, loaded: &Loaded, path: &Path, progress: &ProgressHandle) -> Result<Vec<String>, TaskError> {
        let role = match &self.calibration {
            Some(calibration) if loaded.is_fitted_by(calibration) => Role::Fitted,
            _ => Role::Other,
        };
        let options = CameraOptions { progress: progress.clone(), ..CameraOptions::default() };
        let checked = |camera: &Camera, capture: &CameraFrames| {
            let contradiction =
                |error| TaskError::Contradiction { path: path.display().to_string(), error: Box::new(error) };
            check_declared_depth(camera, capture, &options).map_err(contradiction)
        };
        let (evaluated, missing) = match self.only_pair(loaded)? {
            Some((placed, camera)) => {
                let (actual, expected) = (size(camera), [placed.camera.width, placed.camera.height]);
                if actual != expected {
                    let path = path.display().to_string();
                    return Err(UnlikeCalibration::Size { path, found: actual, expected }.into());
                }
                let _stage = progress.stage("evaluation");
                checked(&placed.camera, &camera.capture)?;
                (Evaluated::of_camera(&placed.name, evaluate_camera(&placed.camera, &camera.capture)), Vec::new())
            }
            None => {
                let missing = missing_cameras(&self.cameras, loaded, path)?;
                let capture = loaded.observed();
                let _stage = progress.stage("evaluation");
                for (placed, camera) in pairs(&self.cameras, &capture) {
                    checked(&placed.camera, &camera.capture)?;
                }
                (evaluate(&self.cameras, &capture), missing)
            }
        };
        self.datasets.push((evaluated, role));
        Ok(missing)
    }

    /// The calibrated and the loaded camera, where one of each is evaluated.
    fn only_pair<'a>(&'a self, loaded: &'a Loaded) -> Result<Option<(&'a PlacedCamera, &'a LoadedCamera)>, TaskError> {
        let Some(reference) = self.cameras.first() else { return Ok(None) };
        match loaded.cameras.as_slice() {
            [camera] if self.cameras.len() == 1 || camera.declared.is_unnamed() => {
                let named = self.cameras.iter().find(|placed| placed.name == *camera.declared.name);
                Ok(Some((named.unwrap_or(reference), camera)))
            }
            [camera, ..] if self.cameras.len() == 1 && reference.name == depthcal_io::CAMERA => {
                let path = camera.declared.root.join(DATASET_FILE);
                Err(TaskError::Load(DatasetError::SeveralCameras { path }.into()))
            }
            _ => Ok(None),
        }
    }

    /// `evaluation.json`.
    pub fn record(&self) -> Evaluation {
        let mut evaluation = Evaluation::default();
        self.datasets.iter().for_each(|(rig, _)| extend(&mut evaluation, evaluation_of(rig, "", |_| None)));
        evaluation
    }

    /// Name of the dataset that one camera was fitted to, where it was evaluated.
    pub fn fitted_name(&self) -> Option<&str> {
        let fitted = |(rig, role): &&(Evaluated, Role)| *role == Role::Fitted && rig.cameras.len() == 1;
        self.datasets.iter().find(fitted).map(|(rig, _)| rig.name.as_str())
    }

    /// The errors as a table of text, with a mark at the dataset that one camera was fitted to.
    pub fn table(&self) -> String {
        table(&self.record().datasets, self.fitted_name())
    }
}

/// Placed cameras with what the cameras of their names have seen.
fn pairs<'a>(
    cameras: &'a [PlacedCamera],
    capture: &'a Capture,
) -> impl Iterator<Item = (&'a PlacedCamera, &'a CameraCapture)> {
    let seen = |placed: &&PlacedCamera| capture.cameras.iter().find(|camera| camera.name == placed.name);
    cameras.iter().filter_map(move |placed| Some((placed, seen(&placed)?)))
}

fn size(camera: &LoadedCamera) -> [usize; 2] {
    [camera.capture.width, camera.capture.height]
}

/// Checks that cameras of a calibration are those of a dataset; returns the names of those that the dataset does not have.
fn missing_cameras(cameras: &[PlacedCamera], loaded: &Loaded, path: &Path) -> Result<Vec<String>, UnlikeCalibration> {
    let path = path.display().to_string();
    let mut missing = Vec::new();
    for placed in cameras {
        let Some(camera) = loaded.cameras.iter().find(|camera| camera.name() == placed.name) else {
            missing.push(placed.name.clone());
            continue;
        };
        let (actual, expected) = (size(camera), [placed.camera.width, placed.camera.height]);
        if actual != expected {
            return Err(UnlikeCalibration::CameraSize { path, camera: placed.name.clone(), found: actual, expected });
        }
    }
    if missing.len() == cameras.len() {
        let has: Vec<&str> = loaded.cameras.iter().map(LoadedCamera::name).collect();
        return Err(UnlikeCalibration::Names { path, has: has.join(", "), calibrated: missing.join(", ") });
    }
    Ok(missing)
}

impl Results for Evaluations {
    fn main_file(&self) -> &'static str {
        "evaluation.json"
    }

    fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        self.record().write(folder.join("evaluation.json"))?;
        Ok(vec![PathBuf::from("evaluation.json")])
    }

    fn shown(&self, made: &Made) -> Shown<'_> {
        let datasets: Vec<_> = self.datasets.iter().map(|(rig, role)| (rig, *role)).collect();
        let cameras = self.cameras.iter().map(|placed| ReportCamera::of_rig(&placed.name, None, &datasets));
        let rig = self.calibration.as_deref().filter(|calibration| !calibration.others.is_empty());
        let is_rig = self.datasets.iter().any(|(rig, _)| rig.cameras.len() > 1);
        Shown::Cameras(ReportInput {
            title: format!("Evaluation of {}", self.title),
            made: made.clone(),
            cameras: cameras.filter(|camera| !camera.evaluations.is_empty()).collect(),
            rig: rig.filter(|_| is_rig).map(|record| ReportRig {
                cameras: self.cameras.clone(),
                record,
                evaluated: self.datasets.iter().map(|(rig, _)| rig).collect(),
            }),
            story: &[],
        })
    }
}
