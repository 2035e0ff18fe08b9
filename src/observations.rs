//! What was measured, frame by frame: the input of every estimator.

use std::sync::Arc;

use depthcal_io::{DepthImage, FrameMetadata, GrayImage};
use depthcal_model::{Context, SURROUND_PX, Target};

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
        let neighbourhood = self.image.as_ref().and_then(|image| Neighbourhood::at(image, pixel));
        let unknown = Neighbourhood { amplitude: f64::NAN, surround: f64::NAN, slope: [f64::NAN; 2] };
        let Neighbourhood { amplitude, surround, slope } = neighbourhood.unwrap_or(unknown);
        Context { pixel, amplitude, surround, slope, time_s: self.time_s, temperature_c: self.temperature_c }
    }
}

/// Infrared amplitude at and about a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Neighbourhood {
    /// At the pixel.
    pub amplitude: f64,
    /// Mean about it, see [`Context::surround`].
    pub surround: f64,
    /// See [`Context::slope`].
    pub slope: [f64; 2],
}

impl Neighbourhood {
    /// Pixels to either side that count.
    const REACH: i64 = 4;

    /// At the pixel nearest to (u, v); `None` outside the image.
    pub fn at(image: &GrayImage, [u, v]: [f64; 2]) -> Option<Self> {
        let (u, v) = (u.round(), v.round());
        let inside = u >= 0.0 && v >= 0.0 && u < image.width as f64 && v < image.height as f64;
        inside.then(|| Self::around(image, u as i64, v as i64))
    }

    fn around(image: &GrayImage, u: i64, v: i64) -> Self {
        const SPREAD: f64 = 1.0 / (2.0 * SURROUND_PX * SURROUND_PX);
        let weights: [f64; 2 * Self::REACH as usize + 1] =
            std::array::from_fn(|i| (-((i as i64 - Self::REACH) as f64).powi(2) * SPREAD).exp());
        let (mut total, mut sum, mut moment) = (0.0, 0.0, [0.0; 2]);
        for (dv, wv) in (-Self::REACH..).zip(weights) {
            let row = v + dv;
            if row < 0 || row >= image.height as i64 {
                continue;
            }
            for (du, wu) in (-Self::REACH..).zip(weights) {
                let column = u + du;
                if column < 0 || column >= image.width as i64 {
                    continue;
                }
                let weighted = wu * wv * f64::from(image.data[row as usize * image.width + column as usize]);
                total += wu * wv;
                sum += weighted;
                moment[0] += weighted * du as f64;
                moment[1] += weighted * dv as f64;
            }
        }
        // The derivative of a Gaussian mean is its first moment over the variance.
        let slope = moment.map(|m| if sum > 0.0 { m / (sum * SURROUND_PX * SURROUND_PX) } else { 0.0 });
        let amplitude = f64::from(image.data[v as usize * image.width + u as usize]);
        Self { amplitude, surround: sum / total, slope }
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
