//! `observations.json`: the measurements in every frame, as the cache of a detection and the record of a fit.

use std::collections::BTreeMap;

use depthcal_model::Target;
use serde::{Deserialize, Serialize};

use super::board::check_board;
use super::reference::FileReference;
use super::result_file::result_file;
use crate::dataset::FrameMetadata;
use crate::file::{Fault, Versioned, read_versioned, write_versioned};

/// Markers and depth samples of a dataset's frames.
///
/// The file carries `"format": "depthcal-observations"` and `"version": 1` in addition to these fields, and no white
/// space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Observations {
    /// The dataset, with the digest that tells whether this file is still valid.
    pub dataset: FileReference,
    /// The board.
    pub target: Target,
    /// Settings of detection and sampling, by name; this file is valid for these settings only.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub settings: BTreeMap<String, String>,
    /// The frames, in the dataset's order; a frame whose board was not found has no markers.
    pub frames: Vec<FrameObservations>,
}

result_file!(Observations, "observations.json", read_versioned, write_versioned);

/// The measurements in one frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FrameObservations {
    /// Name of the frame: the stem of its files.
    pub name: String,
    /// Width of the image in px.
    pub width: usize,
    /// Height of the image in px.
    pub height: usize,
    /// The detected markers.
    #[serde(default)]
    pub markers: Vec<MarkerObservation>,
    /// The depth pixels on the board.
    #[serde(default)]
    pub depth: Vec<DepthSample>,
    /// The frame's row in the dataset's table.
    #[serde(default)]
    pub metadata: FrameMetadata,
}

/// A marker in the image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct MarkerObservation {
    /// Index of the marker on the board, see [`Target::point`].
    pub index: usize,
    /// Position [u, v] in px; the centre of the first pixel is (0, 0).
    pub pixel: [f64; 2],
    /// Standard deviation of each coordinate, px, up to a factor common to all markers; 1 where it is unknown.
    pub std_px: f64,
}

/// A depth pixel on the board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DepthSample {
    /// Position [u, v] in px.
    pub pixel: [f64; 2],
    /// Measured depth (z, not range), mm.
    pub depth_mm: f64,
    /// Grey value of the image at this pixel; absent when image and depth image do not share their pixel grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<f64>,
}

impl Observations {
    /// The frame called `name`.
    pub fn frame(&self, name: &str) -> Option<&FrameObservations> {
        self.frames.iter().find(|frame| frame.name == name)
    }
}

impl Versioned for Observations {
    const FORMAT: &'static str = "depthcal-observations";
    const VERSION: u32 = 1;
    const COMPACT: bool = true;

    fn check(&self) -> Result<(), Fault> {
        check_board(&self.target, "target")?;
        let markers = self.target.len();
        for (i, frame) in self.frames.iter().enumerate() {
            for (j, marker) in frame.markers.iter().enumerate() {
                if marker.index >= markers {
                    let problem = format!("is {}, but the board has {markers} markers", marker.index);
                    return Err(Fault::new(format!("frames[{i}].markers[{j}].index"), problem));
                }
                if marker.std_px <= 0.0 {
                    return Err(Fault::new(format!("frames[{i}].markers[{j}].std_px"), "must be greater than 0"));
                }
            }
            if let Some(j) = frame.depth.iter().position(|sample| sample.depth_mm <= 0.0) {
                return Err(Fault::new(format!("frames[{i}].depth[{j}].depth_mm"), "must be greater than 0"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use depthcal_model::Pattern;

    use super::*;

    fn example() -> Observations {
        Observations {
            dataset: FileReference { path: "captures".into(), digest: "ab".into() },
            target: Target { pattern: Pattern::Chessboard, columns: 5, rows: 7, spacing_mm: 30.0 },
            settings: BTreeMap::from([("stride".into(), "3".into())]),
            frames: vec![FrameObservations {
                name: "0001".into(),
                width: 512,
                height: 424,
                markers: vec![MarkerObservation { index: 34, pixel: [0.1 + 0.2, 17.0], std_px: 0.05 }],
                depth: vec![
                    DepthSample { pixel: [10.0, 11.0], depth_mm: 999.0, amplitude: Some(1200.0) },
                    DepthSample { pixel: [13.0, 11.0], depth_mm: 1001.0, amplitude: None },
                ],
                metadata: FrameMetadata::default(),
            }],
        }
    }

    #[test]
    fn reads_back_what_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("observations.json");
        example().write(&path).unwrap();
        assert_eq!(Observations::read(&path).unwrap(), example());
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 1);
        assert_eq!(example().frame("0001").unwrap().width, 512);
    }

    #[test]
    fn faults_name_the_field() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("observations.json");
        let mut faulty = example();
        faulty.frames[0].markers[0].index = 35;
        assert!(faulty.write(&path).unwrap_err().to_string().contains("frames[0].markers[0].index"));
        let mut faulty = example();
        faulty.frames[0].depth[1].depth_mm = 0.0;
        assert!(faulty.write(&path).unwrap_err().to_string().contains("frames[0].depth[1].depth_mm"));
        assert!(!path.exists());
    }
}
