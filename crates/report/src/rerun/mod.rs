//! Recordings for the rerun viewer (`--rrd`): boards, camera, images, depth and clouds, frame by frame.
//!
//! | entity | what |
//! |---|---|
//! | `world` | the camera's frame (x right, y down, z forward), in metres |
//! | `world/camera` | pinhole with image plane; `image` below it, with dots `found` and `reprojected` |
//! | `world/board` | the board at this frame's pose: its `points` and `outline` |
//! | `world/poses` | outlines at the poses of all frames |
//! | `world/cloud` | board pixels as `measured` and `corrected`, coloured by their depth error |
//! | `depth` | the depth image as measured |
//! | `error` | errors of every frame as curves |
//! | `frame`, `about` | name of the frame; what the recording shows |
//!
//! The one timeline is `frame`, which counts over all captures. The depth image is not below the camera: the viewer's
//! pinhole has no lens, and would show a cloud of its own that is wrong by it. Pixel centres are at integers here and at
//! halves there.

mod cloud;
mod file;
mod scene;
#[cfg(test)]
mod tests;

use std::path::Path;

use depthcal_io::{FileError, write_atomically};
use depthcal_model::Camera;
use nalgebra::Point3;
use rayon::prelude::*;

use cloud::Colours;
use depthcal_calibration::judge::evaluate::{Evaluated, EvaluatedFrame};
use depthcal_calibration::observe::{Capture, DetectedFrame};
use file::Recording;

/// Frames that are built at once, in parallel, before they are written.
const AT_ONCE: usize = 16;

/// A capture and its errors under the camera that is recorded.
#[derive(Debug, Clone, Copy)]
pub struct RecordedCapture<'a> {
    /// What was measured.
    pub capture: &'a Capture,
    /// [`depthcal_calibration::judge::evaluate::evaluate`] of the camera on it.
    pub evaluated: &'a Evaluated,
}

impl<'a> RecordedCapture<'a> {
    /// The frames that were evaluated, with what was measured of them.
    fn frames(self) -> impl Iterator<Item = (&'a Capture, &'a DetectedFrame, &'a EvaluatedFrame)> {
        let measured = |e: &EvaluatedFrame| self.capture.frames.iter().find(|f| f.name == e.name);
        self.evaluated.frames.iter().filter_map(move |e| Some((self.capture, measured(e)?, e)))
    }
}

/// A point in mm as the viewer's metres.
fn metres(p: &Point3<f64>) -> [f32; 3] {
    [p.x, p.y, p.z].map(|c| (c / 1000.0) as f32)
}

/// Writes a recording of a camera on captures; those of other boards may follow each other.
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
