//! Simulated captures as frames that arrive.

use std::path::Path;
use std::sync::OnceLock;

use depthcal_calibration::calibrate::{CameraOptions, Estimator};
use depthcal_calibration::judge::parts::Parts;
use depthcal_calibration::task::{FitRequest, ModelRequest, NextRequest, OptionNames};
use depthcal_io::{Dataset, read_depth_frame, read_gray};
use depthcal_live::{Arrival, LiveFit};
use depthcal_model::Target;
use depthcal_simulate::{CameraTruth, Kind, Simulation};
use tempfile::TempDir;

/// Number of frames of the capture.
pub const FRAMES: usize = 12;

/// A capture of boards in different poses, rendered once for all tests, as a dataset folder.
pub fn folder() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let camera = CameraTruth::ideal(320, 240, 290.0);
        let simulation = Simulation::new(camera, Kind::General(1), &[], 3).frames(FRAMES);
        simulation.write_dataset(folder.path().join("capture")).unwrap();
        folder
    });
    Box::leak(folder.path().join("capture").into_boxed_path())
}

/// The board of the capture.
pub fn board() -> Target {
    Dataset::open(folder()).unwrap().target
}

/// Its frames, as single shots or as those of a video.
pub fn arrivals(is_video: bool) -> Vec<Arrival> {
    let camera = Dataset::open(folder()).unwrap().into_only_camera().unwrap();
    let arrival = |frame: &depthcal_io::Frame| Arrival {
        name: frame.name.clone(),
        image: read_gray(frame.image.as_ref().unwrap()).unwrap(),
        depth: Some(read_depth_frame(frame.depth.as_ref().unwrap()).unwrap()),
        unit_mm: camera.depth_unit_mm,
        metadata: frame.metadata.clone(),
        is_video,
    };
    camera.frames.iter().map(arrival).collect()
}

/// Fits as `depthcal live` does by default.
pub fn live_fit() -> LiveFit {
    let model =
        ModelRequest { names: OptionNames::COMMAND_LINE, model: "projective".to_owned(), with: Vec::new(), lens: None };
    let request = FitRequest {
        model,
        estimator: Estimator::Joint,
        hold_out: None,
        cross_validate: None,
        parts: Parts::Interleaved,
        priors: Vec::new(),
    };
    let next = NextRequest { poses: 3, ..NextRequest::default() };
    LiveFit { request, options: CameraOptions::default(), next }
}
