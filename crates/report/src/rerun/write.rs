//! Writes a recording.

use std::path::Path;

use depthcal_io::{FileError, write_atomically};
use depthcal_model::Camera;
use rayon::prelude::*;

use super::cloud::Colours;
use super::file::Recording;
use super::scene;
use depthcal_calibration::judge::camera::{EvaluatedCamera, EvaluatedFrame};
use depthcal_calibration::observe::{CameraFrames, DetectedFrame};

/// Frames that are built at once, in parallel, before they are written.
const AT_ONCE: usize = 16;

/// A capture and its errors under the camera that is recorded.
#[derive(Debug, Clone, Copy)]
pub struct RecordedCapture<'a> {
    /// The measurements.
    pub capture: &'a CameraFrames,
    /// [`depthcal_calibration::judge::camera::evaluate`] of the camera on it.
    pub evaluated: &'a EvaluatedCamera,
}

impl<'a> RecordedCapture<'a> {
    /// The evaluated frames, each with its measurement.
    fn frames(self) -> impl Iterator<Item = (&'a CameraFrames, &'a DetectedFrame, &'a EvaluatedFrame)> {
        let measured = |e: &EvaluatedFrame| self.capture.frames.iter().find(|f| f.name == e.name);
        self.evaluated.frames.iter().filter_map(move |e| Some((self.capture, measured(e)?, e)))
    }
}

/// Writes a recording of captures of one camera, one after another; each may have a board of its own.
///
/// # Errors
///
/// [`FileError::Write`] where the file cannot be written.
pub fn write(path: &Path, camera: &Camera, captures: &[RecordedCapture<'_>]) -> Result<(), FileError> {
    let frames: Vec<_> = captures.iter().flat_map(|c| c.frames()).collect();
    let colours = Colours::of(frames.iter().map(|(_, _, e)| *e));
    write_atomically(path, |file| {
        let name = captures.first().map_or("", |c| c.capture.name.as_str());
        let mut recording = Recording::new(file, name)?;
        recording.append(&scene::still(camera, &frames, &colours)?)?;
        let numbered: Vec<_> = frames.iter().enumerate().collect();
        for part in numbered.chunks(AT_ONCE) {
            let chunks: Result<Vec<_>, _> =
                part.par_iter().map(|(i, (c, f, e))| scene::moving(*i, camera, (c, f, e), &colours)).collect();
            chunks?.iter().try_for_each(|chunks| recording.append(chunks))?;
        }
        recording.finish()
    })
}
