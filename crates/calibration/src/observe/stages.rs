//! A frame at each stage: raw, detected, posed, sampled. Each stage contains the one before it and dereferences to it, so that a
//! sampled frame has a pose, markers and images too. The type of an argument states which stage a function needs.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use depthcal_io::{DepthFrame, FrameMetadata, GrayImage, ImageError, MarkerObservation};
use depthcal_model::{Context, Quantities};
use nalgebra::Isometry3;

use super::kept_light::FrameLight;
use super::neighbourhood;
use super::stored::Stored;

/// A measured depth pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthPixel {
    /// The pixel with its covariates.
    pub context: Context,
    /// Measured depth, mm.
    pub depth_mm: f64,
}

/// A depth pixel on the board that is an observation of the adjustment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthSample {
    /// The pixel with its covariates.
    pub context: Context,
    /// Measured depth, mm.
    pub depth_mm: f64,
    /// The board point that the pixel sees under the start values, mm: start of Newton's method in the chain.
    pub board_seed: [f64; 2],
}

/// The measured depth of a frame.
#[derive(Debug, Clone, Default)]
pub enum MeasuredDepth {
    /// Nothing.
    #[default]
    None,
    /// A depth image on the pixel grid of the image.
    Image(Stored<DepthFrame>),
    /// Single pixels, for example of a simulation without images.
    Pixels(Vec<DepthPixel>),
}

/// A frame as it was read.
#[derive(Debug, Clone, Default)]
pub struct RawFrame {
    /// Its name in the dataset.
    pub name: String,
    /// Which of several boards it is about, by number; 0 where there is one.
    pub board: usize,
    /// Time since the first frame, s; 0 where unknown.
    pub time_s: f64,
    /// Temperature, °C; NaN where unknown.
    pub temperature_c: f64,
    /// Further quantities.
    pub quantities: Quantities,
    /// The frame's metadata as the dataset has them.
    pub metadata: FrameMetadata,
    /// The image (the infrared amplitude), where there is one.
    pub image: Option<Stored<GrayImage>>,
    /// The depth.
    pub depth: MeasuredDepth,
    /// [`depth_digest`](super::stored::depth_digest) of the depth image, where there is one with any measurement.
    pub depth_digest: Option<u64>,
    /// The light of the whole frame, where its depth was sampled for a model that depends on it.
    pub light: Option<FrameLight>,
}

/// A frame with its images in memory.
#[derive(Debug, Clone)]
pub struct OpenFrame<'a> {
    /// The frame.
    pub raw: &'a RawFrame,
    /// The image, where there is one.
    pub image: Option<Arc<GrayImage>>,
    /// The depth image, where there is one.
    pub depth: Option<Arc<DepthFrame>>,
}

impl RawFrame {
    /// A frame without image and depth, with the time, the temperature and the quantities of its metadata.
    pub fn named(name: &str, metadata: &FrameMetadata) -> Self {
        Self {
            name: name.to_owned(),
            time_s: metadata.timestamp_s.unwrap_or(0.0),
            temperature_c: metadata.temperature_c.unwrap_or(f64::NAN),
            quantities: metadata.quantities(),
            metadata: metadata.clone(),
            ..Self::default()
        }
    }

    /// The frame with its images in memory, where they are read from their files if need be.
    ///
    /// # Errors
    ///
    /// [`ImageError`] where a file has become unreadable.
    pub fn open(&self) -> Result<OpenFrame<'_>, ImageError> {
        let image = self.image.as_ref().map(Stored::get).transpose()?;
        let depth = self.depth_image().map(Stored::get).transpose()?;
        Ok(OpenFrame { raw: self, image, depth })
    }

    /// The depth image, where there is one.
    pub fn depth_image(&self) -> Option<&Stored<DepthFrame>> {
        match &self.depth {
            MeasuredDepth::Image(image) => Some(image),
            MeasuredDepth::None | MeasuredDepth::Pixels(_) => None,
        }
    }

    /// The single depth pixels; none where there is a depth image.
    pub fn depth_pixels(&self) -> &[DepthPixel] {
        match &self.depth {
            MeasuredDepth::Pixels(pixels) => pixels,
            MeasuredDepth::None | MeasuredDepth::Image(_) => &[],
        }
    }

    /// The single depth pixels, to be changed.
    pub fn depth_pixels_mut(&mut self) -> &mut [DepthPixel] {
        match &mut self.depth {
            MeasuredDepth::Pixels(pixels) => pixels,
            MeasuredDepth::None | MeasuredDepth::Image(_) => &mut [],
        }
    }

    /// Whether any depth was measured.
    pub fn has_depth(&self) -> bool {
        match &self.depth {
            MeasuredDepth::None => false,
            MeasuredDepth::Image(_) => true,
            MeasuredDepth::Pixels(pixels) => !pixels.is_empty(),
        }
    }
}

impl OpenFrame<'_> {
    /// Covariates of an observation at a pixel of the depth image, those of its surroundings among them.
    pub fn context(&self, pixel: [f64; 2]) -> Context {
        let mut context = self.conditions(pixel);
        if let Some(image) = &self.image {
            (context.surround, context.slope) = neighbourhood::surround(image, pixel);
        }
        context
    }

    /// [`context`](Self::context) without the covariates of the surroundings, which cost some hundred times as much.
    pub fn conditions(&self, pixel: [f64; 2]) -> Context {
        let amplitude = self.image.as_ref().map_or(f64::NAN, |image| neighbourhood::amplitude(image, pixel));
        let RawFrame { time_s, temperature_c, quantities, .. } = *self.raw;
        Context { pixel, amplitude, time_s, temperature_c, quantities, ..Context::default() }
    }
}

/// A frame in which the board was found.
#[derive(Debug, Clone, Default)]
pub struct DetectedFrame {
    /// The frame as it was read.
    pub raw: RawFrame,
    /// The markers in its image.
    pub markers: Vec<MarkerObservation>,
    /// Whether it has no image, and its markers are where the poses of other cameras put them: they say where the board is, but
    /// have no errors of their own.
    pub markers_are_projected: bool,
    /// Markers that are left out because they are far from where the board has them.
    pub wrong_markers: Vec<MarkerObservation>,
}

impl DetectedFrame {
    /// The markers that were found in an image.
    pub fn observed_markers(&self) -> &[MarkerObservation] {
        if self.markers_are_projected { &[] } else { &self.markers }
    }

    /// Whether another frame has the same depth image, to the bit, and any depth in it. Frames of several boards that one image
    /// shows share it rightly.
    pub fn has_depth_of(&self, other: &Self) -> bool {
        let is_of_same_board = self.raw.board == other.raw.board;
        is_of_same_board && self.raw.depth_digest.is_some() && self.raw.depth_digest == other.raw.depth_digest
    }
}

/// A frame whose board has a pose.
#[derive(Debug, Clone)]
pub struct PosedFrame {
    /// The frame with its markers.
    pub detected: DetectedFrame,
    /// Pose of the board: maps board coordinates to camera coordinates, mm.
    pub camera_from_board: Isometry3<f64>,
}

/// A frame with the depth pixels that are observations of the adjustment: none where it has no depth on the board, or where
/// the images alone were adjusted.
#[derive(Debug, Clone)]
pub struct SampledFrame {
    /// The frame with its pose.
    pub posed: PosedFrame,
    /// Its depth samples, shared by copies of the frame.
    pub samples: Arc<Vec<DepthSample>>,
}

macro_rules! holds {
    ($later:ty, $field:ident: $earlier:ty) => {
        impl Deref for $later {
            type Target = $earlier;
            fn deref(&self) -> &$earlier {
                &self.$field
            }
        }

        impl DerefMut for $later {
            fn deref_mut(&mut self) -> &mut $earlier {
                &mut self.$field
            }
        }
    };
}

holds!(DetectedFrame, raw: RawFrame);
holds!(PosedFrame, detected: DetectedFrame);
holds!(SampledFrame, posed: PosedFrame);

impl AsRef<DetectedFrame> for DetectedFrame {
    fn as_ref(&self) -> &DetectedFrame {
        self
    }
}

impl AsRef<DetectedFrame> for PosedFrame {
    fn as_ref(&self) -> &DetectedFrame {
        self
    }
}

impl AsRef<DetectedFrame> for SampledFrame {
    fn as_ref(&self) -> &DetectedFrame {
        self
    }
}

/// A frame that can be evaluated: it has markers, and may have a pose that is nearly right.
pub trait EvaluableFrame: AsRef<DetectedFrame> + Sync {
    /// The pose from which the search for the one that the image shows starts; without it, it starts from the markers.
    fn known_pose(&self) -> Option<&Isometry3<f64>> {
        None
    }
}

impl EvaluableFrame for DetectedFrame {}

impl EvaluableFrame for PosedFrame {
    fn known_pose(&self) -> Option<&Isometry3<f64>> {
        Some(&self.camera_from_board)
    }
}

impl EvaluableFrame for SampledFrame {
    fn known_pose(&self) -> Option<&Isometry3<f64>> {
        Some(&self.camera_from_board)
    }
}

/// A frame that can be adjusted: it has markers and a pose, and may have depth samples.
pub trait AdjustableFrame: AsRef<DetectedFrame> + Deref + Clone + Send + Sync {
    /// The frame with its pose.
    fn posed(&self) -> &PosedFrame;
    /// The frame with its pose, to be changed.
    fn posed_mut(&mut self) -> &mut PosedFrame;
    /// Its depth samples; none before the frame is sampled.
    fn samples(&self) -> &[DepthSample];
    /// Keeps the samples for which `keep` is true.
    fn retain_samples(&mut self, keep: impl FnMut(&DepthSample) -> bool);
}

impl AdjustableFrame for PosedFrame {
    fn posed(&self) -> &PosedFrame {
        self
    }
    fn posed_mut(&mut self) -> &mut PosedFrame {
        self
    }
    fn samples(&self) -> &[DepthSample] {
        &[]
    }
    fn retain_samples(&mut self, _: impl FnMut(&DepthSample) -> bool) {}
}

impl AdjustableFrame for SampledFrame {
    fn posed(&self) -> &PosedFrame {
        &self.posed
    }
    fn posed_mut(&mut self) -> &mut PosedFrame {
        &mut self.posed
    }
    fn samples(&self) -> &[DepthSample] {
        &self.samples
    }
    fn retain_samples(&mut self, keep: impl FnMut(&DepthSample) -> bool) {
        Arc::make_mut(&mut self.samples).retain(keep);
    }
}
