//! Options and raw values of a stream.

use std::str::FromStr;

use clap::{Args, ValueEnum};
use depthcal_correction::{CorrectionSummary, Corrector, CorrectorError, FrameContext, PointsMut};
use depthcal_io::{DepthImage, GrayImage};
use depthcal_model::{Quantities, Quantity};

/// Type of a raw frame's values: little-endian, row by row, nothing between frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Raw {
    /// 16-bit steps of --unit-mm; 0 is no depth.
    U16,
    /// 32-bit floating-point mm; 0, negative and NaN are no depth.
    F32,
}

/// Type of the values that are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Written {
    /// Corrected depth in 16-bit steps of --unit-mm.
    U16,
    /// Corrected depth in 32-bit floating-point mm.
    F32,
    /// Points: x y z of every pixel, 32-bit floating-point mm; NaN where there is no depth. With --register in the frame of the
    /// rig.
    Xyz,
    /// Points as of `xyz`, each followed by red, green, blue and 255 in 8 bits, or by four zeros where another surface hides it
    /// from the camera of --register or there is no depth.
    Xyzrgb,
}

/// Options of a stream.
#[derive(Debug, Args)]
pub(super) struct StreamArgs {
    /// Type of the values on standard input.
    #[arg(long, value_name = "TYPE", value_enum, default_value = "u16", requires = "stream_output")]
    pub(super) stream_input: Raw,
    /// Type of the values on standard output; required for DEPTH `-`.
    #[arg(long, value_name = "TYPE", value_enum)]
    pub(super) stream_output: Option<Written>,
    /// Width and height of the frames, checked against those of the calibration.
    #[arg(long, value_name = "WxH", requires = "stream_output")]
    pub(super) stream_size: Option<String>,
    /// Each depth frame on standard input is followed by its infrared image: 16-bit values of the same size.
    #[arg(long, requires = "stream_output")]
    pub(super) stream_amplitude: bool,
    /// Camera of a rig whose depth the stream is [default: the first with depth].
    #[arg(long, value_name = "CAMERA", requires = "stream_output", requires = "register")]
    pub(super) stream_camera: Option<String>,
    /// Each frame on standard input ends with the image of the camera of --register: red, green and blue in 8 bits, row by row.
    #[arg(long, requires = "stream_output", requires = "register")]
    pub(super) stream_color: bool,
    /// Frames per second, for effects that depend on time; the first frame is at 0 s.
    #[arg(long, value_name = "FPS", requires = "stream_output")]
    pub(super) stream_fps: Option<f64>,
    /// Temperature in °C, for effects that depend on it.
    #[arg(long, value_name = "CELSIUS", requires = "stream_output")]
    pub(super) stream_temperature: Option<f64>,
    /// Value of a quantity such as exposure_ms=8.5, for effects that depend on it.
    #[arg(long, value_name = "NAME=VALUE", requires = "stream_output")]
    pub(super) stream_value: Vec<GivenValue>,
}

/// The value of a quantity of all frames.
#[derive(Debug, Clone, Copy)]
pub(super) struct GivenValue {
    pub(super) quantity: Quantity,
    value: f64,
}

impl FromStr for GivenValue {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let given = text.split_once('=').and_then(|(name, value)| {
            let value = value.parse().ok().filter(|value: &f64| value.is_finite())?;
            Some(Self { quantity: Quantity::named(name)?, value })
        });
        given.ok_or_else(|| {
            "give the name of a column of frames.csv with its unit and a number, as exposure_ms=8.5".to_owned()
        })
    }
}

/// The work on the frames of a stream.
pub(super) trait FrameJob {
    /// Bytes of a frame on standard input.
    fn frame_bytes(&self) -> usize;

    /// Corrects frame number `index` from its bytes into those of the result.
    fn correct(&mut self, index: usize, frame: &[u8], out: &mut Vec<u8>) -> Result<CorrectionSummary, CorrectorError>;
}

/// Depth and amplitude of the current frame.
pub(super) struct FrameInput<'a> {
    pub(super) args: &'a StreamArgs,
    pub(super) corrector: &'a Corrector,
    pub(super) unit_mm: f64,
    pub(super) steps: DepthImage,
    pub(super) millimetres: Vec<f32>,
    pub(super) amplitude: GrayImage,
}

impl<'a> FrameInput<'a> {
    pub(super) fn new(args: &'a StreamArgs, corrector: &'a Corrector, unit_mm: f64) -> Self {
        let (width, height) = (corrector.width(), corrector.height());
        let n = width * height;
        Self {
            args,
            corrector,
            unit_mm,
            steps: DepthImage { width, height, data: vec![0; n] },
            millimetres: vec![0.0; n],
            amplitude: GrayImage { width, height, data: vec![0; n], bits: 16 },
        }
    }

    /// Bytes of depth and of amplitude in a frame.
    fn parts(&self) -> [usize; 2] {
        let pixels = self.millimetres.len();
        [pixels * self.args.stream_input.bytes(), if self.args.stream_amplitude { 2 * pixels } else { 0 }]
    }

    /// Bytes of a frame.
    pub(super) fn bytes(&self) -> usize {
        self.parts().iter().sum()
    }

    /// Takes depth and amplitude from the bytes of a frame; returns those that follow.
    pub(super) fn take<'b>(&mut self, frame: &'b [u8]) -> &'b [u8] {
        let [of_depth, of_amplitude] = self.parts();
        let (depth, after_depth) = frame.split_at(of_depth);
        let (amplitude, others) = after_depth.split_at(of_amplitude);
        match self.args.stream_input {
            Raw::U16 => u16_from_bytes(depth, &mut self.steps.data),
            Raw::F32 => f32_from_bytes(depth, &mut self.millimetres),
        }
        if self.args.stream_amplitude {
            u16_from_bytes(amplitude, &mut self.amplitude.data);
        }
        others
    }

    /// Corrected points of frame number `index`, mm.
    pub(super) fn points(&mut self, index: usize, out: PointsMut<'_>) -> Result<CorrectionSummary, CorrectorError> {
        let context = self.args.context(index, &self.amplitude);
        if self.args.stream_input == Raw::U16 {
            return self.corrector.correct_to_points(&self.steps, self.unit_mm, &context, out);
        }
        let summary = self.corrector.correct_f32_in_place(&mut self.millimetres, &context)?;
        self.corrector.points_f32_into(&self.millimetres, out)?;
        Ok(summary)
    }
}

impl StreamArgs {
    /// Whether the values on standard input are whole steps.
    pub(super) fn takes_steps(&self) -> bool {
        self.stream_input == Raw::U16
    }

    /// The conditions of frame number `index`.
    pub(super) fn context<'a>(&self, index: usize, amplitude: &'a GrayImage) -> FrameContext<'a> {
        FrameContext {
            time_s: self.stream_fps.map_or(0.0, |fps| index as f64 / fps),
            temperature_c: self.stream_temperature.unwrap_or(f64::NAN),
            quantities: Quantities::new(self.stream_value.iter().map(|given| (given.quantity, given.value))),
            amplitude: self.stream_amplitude.then(|| amplitude.into()),
        }
    }
}

impl Raw {
    /// Bytes of a value.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::U16 => 2,
            Self::F32 => 4,
        }
    }
}

/// Depth in mm as steps of a unit; 0 where there is none.
pub(super) fn in_steps(z: f32, unit_mm: f64) -> u16 {
    let steps = (f64::from(z) / unit_mm).round().clamp(1.0, f64::from(u16::MAX)) as u16;
    if z > 0.0 { steps } else { 0 }
}

fn u16_from_bytes(bytes: &[u8], values: &mut [u16]) {
    for (value, bytes) in values.iter_mut().zip(bytes.as_chunks().0) {
        *value = u16::from_le_bytes(*bytes);
    }
}

fn f32_from_bytes(bytes: &[u8], values: &mut [f32]) {
    for (value, bytes) in values.iter_mut().zip(bytes.as_chunks().0) {
        *value = f32::from_le_bytes(*bytes);
    }
}

pub(super) fn bytes_of<const N: usize>(values: impl ExactSizeIterator<Item = [u8; N]>, out: &mut Vec<u8>) {
    out.resize(N * values.len(), 0);
    for (bytes, value) in out.as_chunks_mut().0.iter_mut().zip(values) {
        *bytes = value;
    }
}
