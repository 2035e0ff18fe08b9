//! Under which conditions the frames of a unit were captured.

use depthcal_io::{Calibration, FrameRecord};
use nalgebra::Point3;

/// Under which conditions a unit was calibrated.
#[derive(Debug, Clone, Default)]
pub struct Conditions {
    /// Distances of the middle of the board, mm.
    pub distances_mm: Vec<f64>,
    /// Temperatures of the frames, °C.
    pub temperatures_c: Vec<f64>,
    /// Times of the frames since the first, s.
    pub times_s: Vec<f64>,
}

impl Conditions {
    /// Those of a calibration's frames.
    pub(crate) fn of(calibration: &Calibration) -> Self {
        let [low, high] = calibration.target.marker_rectangle();
        let middle = Point3::new(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.0);
        let frames = || calibration.frames.iter();
        let distance = |frame: &FrameRecord| (frame.rig_from_board() * middle).z;
        let times = || frames().filter_map(|frame| frame.metadata.timestamp_s);
        let first = times().fold(f64::INFINITY, f64::min);
        Self {
            distances_mm: frames().map(distance).filter(|z| *z > 0.0).collect(),
            temperatures_c: frames().filter_map(|frame| frame.metadata.temperature_c).collect(),
            times_s: times().map(|time| time - first).collect(),
        }
    }
}
