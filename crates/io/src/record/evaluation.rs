//! `evaluation.json`: errors of a calibration on datasets, before and after correction.

use serde::{Deserialize, Serialize};

use super::interval::Interval;
use super::result_file::result_file;
use crate::file::{read_json, write_json};

/// Errors of one calibration on several datasets.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Evaluation {
    /// One entry per dataset, in the order in which they were given.
    pub datasets: Vec<DatasetEvaluation>,
    /// Errors from one camera of a rig to another; empty for one camera.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub transfer: Vec<TransferError>,
}

result_file!(Evaluation, "evaluation.json", read_json, write_json);

/// Markers that one camera sees, taken through its corrected depth into another camera's image, against where that camera sees
/// them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct TransferError {
    /// Name of the dataset.
    pub dataset: String,
    /// The camera whose depth is taken.
    pub from: String,
    /// The camera in whose image they are compared.
    pub to: String,
    /// Number of markers.
    pub markers: usize,
    /// Root mean square of the distance in the image of `to`, px.
    pub rms_px: f64,
    /// Root mean square of the distance between the marker's point and the line of sight of `to`, mm.
    pub rms_mm: f64,
    /// `rms_px` through depth as measured, px.
    pub before_rms_px: f64,
    /// Transfer errors in ranges of distance, from near to far.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub by_distance: Vec<TransferAtDistance>,
}

/// Transfer errors of markers in a range of distance.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct TransferAtDistance {
    /// Mean distance of the markers from the camera whose depth is taken, mm.
    pub distance_mm: f64,
    /// Number of markers.
    pub markers: usize,
    /// Root mean square, px.
    pub rms_px: f64,
    /// Root mean square, mm.
    pub rms_mm: f64,
}

/// Errors on one dataset. Those of depth are absent when the dataset has no depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DatasetEvaluation {
    /// Name of the dataset's folder.
    pub name: String,
    /// Number of frames that were evaluated.
    pub frames: usize,
    /// Reprojection error, px; absent of a camera without images, whose board is where other cameras see it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reprojection_px: Option<Rms>,
    /// Distance in 3D between a marker, back-projected with its depth into the board frame, and its position on the
    /// board, mm (Sjöholm 2017, eq. 5.1–5.3).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dot_error_mm: Option<BeforeAfter<MeanStd>>,
    /// Mean absolute distance from the board's plane of the valid depth pixels within the outermost markers, mm
    /// (Sjöholm 2017, eq. 5.4–5.5).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane_error_mm: Option<BeforeAfter<MeanStd>>,
    /// Root mean square of depth minus the board's depth, over all valid board pixels of all frames, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_rms_mm: Option<BeforeAfter<f64>>,
    /// Board pixels that are no measurements of the board, and are therefore in none of these errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outliers: Option<Outliers>,
    /// Their 95 % intervals; absent of fewer than three frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intervals: Option<ErrorIntervals>,
    /// The range in which 90 % of the errors of single pixels lie, those of depth minus the board's depth, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_90_percent_mm: Option<BeforeAfter<Spread>>,
    /// How far frames are off as wholes after correction; absent of fewer than eight frames, and of a calibration that was read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub whole_frames: Option<WholeFrames>,
    /// These errors for every frame.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub frames_detail: Vec<FrameEvaluation>,
}

/// Deviations of whole frames, each the median of its pixels' errors, against what the noise of pixels, the pose from the image
/// and the calibration's own uncertainty make of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct WholeFrames {
    /// Number of frames.
    pub frames: usize,
    /// Probability that the deviations are as large where nothing else moves the frames (χ² test). Standard deviations up to 1.5
    /// times as large as the expected ones are allowed for.
    pub p_value: f64,
    /// Root mean square of the deviations beyond the expected ones, mm.
    pub size_mm: f64,
    /// Root mean square of the deviations up to which they would go unnoticed, mm.
    pub detectable_mm: f64,
    /// The frame whose deviation is the largest multiple of its standard deviation.
    pub worst: FrameDeviation,
}

/// The deviation of a frame as a whole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FrameDeviation {
    /// Name of the frame.
    pub name: String,
    /// Mean distance of its board, mm.
    pub distance_mm: f64,
    /// Median error of its pixels after correction, mm; positive where they are too far.
    pub error_mm: f64,
    /// Standard deviation of that by noise, pose and fit, mm.
    pub std_dev_mm: f64,
}

/// 95 % intervals of errors with the meaning of [`DatasetEvaluation`], by resampling frames: pixels of a frame share errors.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ErrorIntervals {
    /// Of the reprojection error, px.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reprojection_px: Option<Interval>,
    /// Of the mean dot error, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dot_error_mm: Option<BeforeAfter<Interval>>,
    /// Of the mean plane error, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane_error_mm: Option<BeforeAfter<Interval>>,
    /// Of the root mean square depth error, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_rms_mm: Option<BeforeAfter<Interval>>,
}

/// A range of values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Spread {
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
}

/// Errors of one frame, with the meaning of [`DatasetEvaluation`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FrameEvaluation {
    /// Name of the frame.
    pub name: String,
    /// Number of markers that were found and count.
    pub markers: usize,
    /// Number of markers that are left out: more than a pixel and four standard deviations from where the fit has them.
    #[serde(default)]
    pub wrong_markers: usize,
    /// Number of valid depth pixels on the board.
    pub depth_pixels: usize,
    /// Number of board pixels that are no measurements of the board, and are left out.
    #[serde(default)]
    pub outliers: usize,
    /// Reprojection error, px; absent without an image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reprojection_px: Option<Rms>,
    /// Dot error, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dot_error_mm: Option<BeforeAfter<MeanStd>>,
    /// Plane error, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane_error_mm: Option<BeforeAfter<MeanStd>>,
    /// Root mean square of the depth error, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_rms_mm: Option<BeforeAfter<f64>>,
}

/// Board pixels that were left out: more than 20 robust standard deviations and 5 % of the distance off their frame's own
/// plane.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Outliers {
    /// Their number.
    pub count: usize,
    /// Their share of the valid depth pixels on the board.
    pub share: f64,
    /// Depth error from which on a pixel is left out, at the median frame's distance, mm.
    pub limit_mm: f64,
}

/// A quantity computed from the depth as measured and from the corrected depth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct BeforeAfter<T> {
    /// From the depth as measured.
    pub before: T,
    /// From the depth as corrected.
    pub after: T,
}

/// Mean and standard deviation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct MeanStd {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
}

/// Root mean square.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Rms {
    /// Root mean square.
    pub rms: f64,
}

impl Evaluation {
    /// The entry of the dataset called `name`.
    pub fn dataset(&self, name: &str) -> Option<&DatasetEvaluation> {
        self.datasets.iter().find(|dataset| dataset.name == name)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_file_is_the_contract_to_the_letter() {
        let error = BeforeAfter { before: MeanStd { mean: 7.5, std: 3.5 }, after: MeanStd { mean: 3.5, std: 1.5 } };
        let interval = Interval { mean: 6.5, low: 6.0, high: 7.25 };
        let of_depth = Some(BeforeAfter { before: interval, after: interval });
        let intervals = ErrorIntervals { depth_rms_mm: of_depth, ..ErrorIntervals::default() };
        let range = Spread { low: -4.5, high: 8.0 };
        let evaluation = Evaluation {
            datasets: vec![DatasetEvaluation {
                name: "general1".into(),
                frames: 27,
                reprojection_px: Some(Rms { rms: 0.125 }),
                dot_error_mm: Some(error),
                plane_error_mm: Some(error),
                depth_rms_mm: Some(BeforeAfter { before: 10.5, after: 6.5 }),
                outliers: Some(Outliers { count: 3, share: 0.125, limit_mm: 30.0 }),
                intervals: Some(intervals),
                depth_90_percent_mm: Some(BeforeAfter { before: range, after: range }),
                whole_frames: None,
                frames_detail: Vec::new(),
            }],
            transfer: Vec::new(),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("evaluation.json");
        evaluation.write(&path).unwrap();
        let both = json!({"before": {"mean": 7.5, "std": 3.5}, "after": {"mean": 3.5, "std": 1.5}});
        let interval = json!({"mean": 6.5, "low": 6.0, "high": 7.25});
        let range = json!({"low": -4.5, "high": 8.0});
        let expected = json!({"datasets": [{
            "name": "general1", "frames": 27, "reprojection_px": {"rms": 0.125}, "dot_error_mm": both,
            "plane_error_mm": both, "depth_rms_mm": {"before": 10.5, "after": 6.5},
            "outliers": {"count": 3, "share": 0.125, "limit_mm": 30.0},
            "intervals": {"depth_rms_mm": {"before": interval, "after": interval}},
            "depth_90_percent_mm": {"before": range, "after": range},
        }]});
        assert_eq!(read_json::<serde_json::Value>(&path).unwrap(), expected);
        assert_eq!(Evaluation::read(&path).unwrap(), evaluation);
        assert_eq!(evaluation.dataset("general1").unwrap().frames, 27);
    }

    #[test]
    fn a_missing_field_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("evaluation.json");
        std::fs::write(&path, "{\"datasets\": [{\"name\": \"a\", \"frames\": 1, \"reprojection_px\": {}}]}").unwrap();
        let message = Evaluation::read(&path).unwrap_err().to_string();
        assert!(message.contains("datasets[0].reprojection_px") && message.contains("rms"), "{message}");
    }
}
