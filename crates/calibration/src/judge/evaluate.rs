//! Errors of calibrated cameras, of which there may be one, and from one camera to another.

use std::collections::{BTreeMap, BTreeSet};

use crate::judge::camera::{EvaluatedCamera, evaluate_camera};
use depthcal_io::{DatasetEvaluation, TransferError};

use nalgebra::Isometry3;
use tracing::warn;

use super::transfer::{JudgedCamera, Transfer, transfers};
use crate::calibrate::{CalibrateError, Calibrated};
use crate::observe::projected_markers::with_projected_markers;
use crate::observe::{CameraCapture, CameraFrames, Capture, DetectedFrame, DroppedFrame, PlacedCamera, Taken};
use crate::start::views::numbered_for;

/// Errors of calibrated cameras on a capture.
#[derive(Debug, Clone)]
pub struct Evaluated {
    /// Errors of every camera and its name, as those of one camera alone: poses come from its own images, or without any from
    /// those of the others.
    pub cameras: Vec<(String, EvaluatedCamera)>,
    /// Errors from every camera with depth to every other one with images.
    pub transfers: Vec<Transfer>,
    /// The dataset's name.
    pub name: String,
}

/// Evaluates cameras on all frames of a capture. They are found by their names; those that the capture does not have are left
/// out. A camera without images is judged at the poses that the images of the others show.
pub fn evaluate(cameras: &[PlacedCamera], capture: &Capture) -> Evaluated {
    let capture = &*numbered_for(cameras, capture);
    judged(cameras, capture, |placed, seen| evaluate_camera(&placed.camera, &seen.capture))
}

/// Evaluates calibrated cameras on the frames that they were fitted to.
pub fn evaluate_fitted(fit: &Calibrated) -> Evaluated {
    judged(&fit.placed(), &fit.capture(), |placed, seen| match fit.camera(&placed.name) {
        // The search for a frame's pose starts from the fitted one.
        Some(camera) => evaluate_camera(&placed.camera, &camera.calibrated.capture),
        None => evaluate_camera(&placed.camera, &seen.capture),
    })
}

/// The frames of a camera without images, with markers where the images of the other `cameras` put its board. `None` where the
/// capture, or the cameras, lack it.
pub fn placed_by_others(cameras: &[PlacedCamera], capture: &Capture, name: &str) -> Option<CameraFrames> {
    let capture = &*numbered_for(cameras, capture);
    let (placed, seen) = pairs(cameras, capture).find(|(placed, _)| placed.name == name)?;
    let others = pairs(cameras, capture).filter(|(_, seen)| seen.has_markers());
    let others = others.map(|(placed, seen)| JudgedCamera {
        placed,
        seen,
        errors: evaluate_camera(&placed.camera, &seen.capture),
    });
    Some(at_poses_of(&others.collect::<Vec<_>>(), placed, seen))
}

/// Calibrated cameras with their parts of a capture.
fn pairs<'a>(
    cameras: &'a [PlacedCamera],
    capture: &'a Capture,
) -> impl Iterator<Item = (&'a PlacedCamera, &'a CameraCapture)> {
    cameras.iter().filter_map(|placed| Some((placed, capture.cameras.iter().find(|seen| seen.name == placed.name)?)))
}

/// Errors of cameras in a capture, of those with images by `by_images`, and between them.
fn judged(
    cameras: &[PlacedCamera],
    capture: &Capture,
    by_images: impl Fn(&PlacedCamera, &CameraCapture) -> EvaluatedCamera,
) -> Evaluated {
    let (with_images, without): (Vec<_>, Vec<_>) = pairs(cameras, capture).partition(|(_, seen)| seen.has_markers());
    let with_images = with_images.into_iter().map(|(placed, seen)| {
        let errors = EvaluatedCamera { name: part_name(capture, &placed.name), ..by_images(placed, seen) };
        JudgedCamera { placed, seen, errors }
    });
    let with_images: Vec<JudgedCamera<'_>> = with_images.collect();
    let transfers = transfers(&with_images);
    let without = without.into_iter().map(|(placed, seen)| {
        let errors = evaluate_camera(&placed.camera, &at_poses_of(&with_images, placed, seen));
        (placed.name.clone(), EvaluatedCamera { name: part_name(capture, &placed.name), ..errors })
    });
    let without: Vec<_> = without.collect();
    let with_images = with_images.into_iter().map(|camera| (camera.placed.name.clone(), camera.errors));
    let mut evaluated: Vec<_> = with_images.chain(without).collect();
    evaluated.sort_by_key(|(name, _)| cameras.iter().position(|placed| placed.name == *name));
    Evaluated { cameras: evaluated, transfers, name: capture.name.clone() }
}

/// A camera's frames with markers where other cameras put its board: of those that show it, the one with the most markers.
fn at_poses_of(others: &[JudgedCamera<'_>], placed: &PlacedCamera, seen: &CameraCapture) -> CameraFrames {
    let pose = |frame: &DetectedFrame| {
        let taken = Taken::of(frame);
        let shown = others.iter().filter_map(|other| {
            let shown = other.errors.frames.iter().find(|shown| shown.name == frame.name)?;
            Some((other.placed, shown))
        });
        let (other, shown) = shown.max_by_key(|(_, shown)| shown.reprojection.len())?;
        Some(placed.at(&taken).from(&other.at(&taken)) * shown.camera_from_board)
    };
    let frames = seen.capture.frames.iter();
    let camera_from_board: BTreeMap<&str, Isometry3<f64>> =
        frames.filter_map(|frame| Some((frame.name.as_str(), pose(frame)?))).collect();
    with_projected_markers(&seen.capture, &placed.camera, &camera_from_board)
}

/// The name of a camera's part of a capture: the capture's, of several cameras with the camera's.
fn part_name(capture: &Capture, camera: &str) -> String {
    match capture.cameras.len() {
        1 => capture.name.clone(),
        _ => format!("{}/{camera}", capture.name),
    }
}

/// A part of the frames without which the others determine nothing.
pub(super) struct NotFitted {
    /// Why.
    pub error: CalibrateError,
    /// The names of its frames by the names of the cameras.
    pub frames: Vec<(String, Vec<String>)>,
}

impl Evaluated {
    /// Adds the errors of all parts of a cross-validation. The frames of a part without which the others do not determine the
    /// `model` (a model or a rig, in words) are dropped with the reason.
    ///
    /// # Errors
    ///
    /// [`CalibrateError`] of a part where no frame is judged.
    pub(super) fn joined(
        mut self,
        parts: Vec<Result<Self, Box<NotFitted>>>,
        model: &str,
    ) -> Result<Self, CalibrateError> {
        let mut failure = None;
        for part in parts {
            match part {
                Ok(part) => self.extend(part),
                Err(failed) => {
                    let NotFitted { error, frames } = *failed;
                    let reason = format!("without its part of the frames the {model} cannot be fitted: {error}");
                    let names: BTreeSet<&String> = frames.iter().flat_map(|(_, names)| names).collect();
                    warn!("{} frames are not judged: {reason}", names.len());
                    for (camera, evaluated) in &mut self.cameras {
                        let camera_frames =
                            frames.iter().filter(|(name, _)| name == camera).flat_map(|(_, names)| names);
                        let dropped =
                            camera_frames.map(|name| DroppedFrame { name: name.clone(), reason: reason.clone() });
                        evaluated.dropped.extend(dropped);
                    }
                    failure = Some(error);
                }
            }
        }
        if let Some(failure) = failure.filter(|_| self.cameras.iter().all(|(_, camera)| camera.frames.is_empty())) {
            return Err(failure);
        }
        self.cameras.iter_mut().for_each(|(_, camera)| camera.frames.sort_by(|a, b| a.name.cmp(&b.name)));
        Ok(self)
    }

    /// No frames of any camera.
    pub(super) fn empty(capture: &Capture) -> Self {
        let cameras = capture.cameras.iter().map(|camera| {
            let name = part_name(capture, &camera.name);
            (camera.name.clone(), EvaluatedCamera { name, frames: Vec::new(), dropped: Vec::new() })
        });
        Self { cameras: cameras.collect(), transfers: Vec::new(), name: capture.name.clone() }
    }

    /// Adds the errors of other frames of the same rig.
    fn extend(&mut self, other: Self) {
        for (name, camera) in other.cameras {
            match self.cameras.iter_mut().find(|(known, _)| *known == name) {
                Some((_, known)) => {
                    known.frames.extend(camera.frames);
                    known.dropped.extend(camera.dropped);
                }
                None => self.cameras.push((name, camera)),
            }
        }
        for transfer in other.transfers {
            match self.transfers.iter_mut().find(|known| known.from == transfer.from && known.to == transfer.to) {
                Some(known) => known.points.extend(transfer.points),
                None => self.transfers.push(transfer),
            }
        }
    }

    /// The errors of one camera on its dataset, as those of a rig of one.
    pub fn of_camera(camera: &str, evaluated: EvaluatedCamera) -> Self {
        let name = evaluated.name.clone();
        Self { name, cameras: vec![(camera.to_owned(), evaluated)], transfers: Vec::new() }
    }

    /// The errors of a camera; `None` where it is not part of the capture.
    pub fn camera(&self, name: &str) -> Option<&EvaluatedCamera> {
        self.cameras.iter().find(|(camera, _)| camera == name).map(|(_, evaluated)| evaluated)
    }

    /// The records of the cameras for `evaluation.json`.
    pub fn records(&self) -> Vec<DatasetEvaluation> {
        self.cameras.iter().map(|(_, evaluated)| evaluated.record()).collect()
    }

    /// The records of the transfer errors for `evaluation.json`.
    pub fn transfer_records(&self) -> Vec<TransferError> {
        self.transfers.iter().map(|transfer| transfer.record(&self.name)).collect()
    }
}
