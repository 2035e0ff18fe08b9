//! What was measured, frame by frame: the input of every estimator.

use std::sync::Arc;

use depthcal_io::{DepthImage, FrameMetadata, GrayImage};
use depthcal_model::{Context, Target};

/// A marker found in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerObservation {
    /// Its number on the board, see [`Target::point`].
    pub index: usize,
    /// Where it was found, px.
    pub pixel: [f64; 2],
    /// Standard deviation of each coordinate, px, up to a factor common to all markers; 1 where nothing is known.
    pub std_px: f64,
}

/// A depth pixel on the board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthSample {
    /// The pixel and what is known of it.
    pub context: Context,
    /// Measured depth, mm.
    pub depth_mm: f64,
    /// Roughly which board point it sees, mm.
    pub board_seed: [f64; 2],
}

/// One capture of the board.
#[derive(Debug, Clone, Default)]
pub struct Frame {
    /// Its name in the dataset.
    pub name: String,
    /// Markers in its image.
    pub markers: Vec<MarkerObservation>,
    /// Depth pixels for the joint adjustment; empty until they are sampled.
    pub samples: Vec<DepthSample>,
    /// Time since the first frame, s; 0 where unknown.
    pub time_s: f64,
    /// Temperature, °C; NaN where unknown.
    pub temperature_c: f64,
    /// What the dataset says about the frame, as it says it.
    pub metadata: FrameMetadata,
    /// The whole depth image, where there is one.
    pub depth: Option<Arc<DepthImage>>,
    /// The whole image (the infrared amplitude), where it was kept.
    pub image: Option<Arc<GrayImage>>,
}

impl Frame {
    /// What is known of the observation at a pixel of the depth image.
    pub fn context(&self, pixel: [f64; 2]) -> Context {
        let amplitude = self.image.as_ref().and_then(|image| {
            let (u, v) = (pixel[0].round(), pixel[1].round());
            let inside = u >= 0.0 && v >= 0.0 && u < image.width as f64 && v < image.height as f64;
            inside.then(|| f64::from(image.data[v as usize * image.width + u as usize]))
        });
        Context {
            pixel,
            amplitude: amplitude.unwrap_or(f64::NAN),
            time_s: self.time_s,
            temperature_c: self.temperature_c,
        }
    }
}

/// A frame that is not used, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DroppedFrame {
    /// Its name.
    pub name: String,
    /// Why it is not used.
    pub reason: String,
}

/// All captures of a dataset.
#[derive(Debug, Clone)]
pub struct Capture {
    /// The dataset's name.
    pub name: String,
    /// The board.
    pub target: Target,
    /// Width of the images, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// Millimetres per step of the depth images, where there are any.
    pub depth_unit_mm: Option<f64>,
    /// The frames in which the board was found.
    pub frames: Vec<Frame>,
    /// The others.
    pub dropped: Vec<DroppedFrame>,
}

impl Capture {
    /// The same capture with some of its frames.
    pub fn subset(&self, keep: impl Fn(usize, &Frame) -> bool) -> Self {
        let frames = self.frames.iter().enumerate().filter(|(i, f)| keep(*i, f)).map(|(_, f)| f.clone()).collect();
        Self { frames, ..self.clone() }
    }

    /// Whether any frame has depth, as an image or as samples.
    pub fn has_depth(&self) -> bool {
        self.frames.iter().any(|f| f.depth.is_some() || !f.samples.is_empty())
    }
}
