//! `apply - --register`: raw frames of a rig from standard input, resampled into another camera or as points in the frame of the
//! rig.

use depthcal_calibration::observe::PlacedCamera;
use depthcal_calibration::observe::Taken;
use depthcal_correction::{CorrectionSummary, Corrector, CorrectorError, PointsMut, colours_of, depth_into};
use depthcal_io::{Calibration, CameraRecord, DepthImage, GrayImage, RgbImage};

use super::stream_args::{FrameJob, Raw, StreamArgs, Written, bytes_of, f32_from_bytes, u16_from_bytes};
use crate::failure::Failure;

/// The two cameras of a stream.
#[derive(Debug, Clone)]
pub(super) struct Registered {
    /// The one whose depth the stream is.
    pub(super) depth: PlacedCamera,
    /// Millimetres per step of its depth, where the calibration has them.
    pub(super) unit_mm: Option<f64>,
    /// The one in whose image depth is resampled.
    pub(super) target: PlacedCamera,
}

impl Registered {
    /// The cameras of these names; without a name for the first, the first camera with depth.
    pub(super) fn of(
        cameras: &[PlacedCamera],
        record: &Calibration,
        depth: Option<&str>,
        target: &str,
    ) -> Result<Self, Failure> {
        let known = || cameras.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
        let named = |option: &str, name: &str| {
            let camera = cameras.iter().find(|camera| camera.name == name).cloned();
            camera
                .ok_or_else(|| Failure::Input(format!("{option} {name}: the calibration has the cameras {}", known())))
        };
        let unit = |name: &str| record.cameras().find(|c| c.name == name).and_then(unit_of_depth);
        let depth = match depth {
            Some(name) => named("--stream-camera", name)?,
            None => cameras.iter().find(|camera| unit(&camera.name).is_some()).cloned().ok_or_else(|| {
                Failure::Input(
                    "no camera of the calibration has depth: name the one that the stream is of with --stream-camera"
                        .to_owned(),
                )
            })?,
        };
        if unit(&depth.name).is_none() {
            return Err(Failure::Input(format!("--stream-camera {}: this camera has no depth", depth.name)));
        }
        Ok(Self { unit_mm: unit(&depth.name), depth, target: named("--register", target)? })
    }
}

/// Millimetres of a step of a camera's depth; disparities become mm.
fn unit_of_depth(camera: &CameraRecord) -> Option<f64> {
    camera.depth_unit_mm.or(camera.disparity.map(|_| 1.0))
}

/// Buffers of the current frame.
pub(super) struct RegisterJob<'a> {
    args: &'a StreamArgs,
    corrector: &'a Corrector,
    unit_mm: f64,
    written: Written,
    cameras: &'a Registered,
    steps: DepthImage,
    millimetres: Vec<f32>,
    amplitude: GrayImage,
    color: RgbImage,
}

impl<'a> RegisterJob<'a> {
    pub(super) fn new(
        args: &'a StreamArgs,
        (corrector, unit_mm): (&'a Corrector, f64),
        cameras: &'a Registered,
        written: Written,
    ) -> Self {
        let (width, height) = (corrector.width(), corrector.height());
        let n = width * height;
        let target = &cameras.target.camera;
        Self {
            args,
            corrector,
            unit_mm,
            written,
            cameras,
            steps: DepthImage { width, height, data: vec![0; n] },
            millimetres: vec![0.0; n],
            amplitude: GrayImage { width, height, data: vec![0; n], bits: 16 },
            color: RgbImage {
                width: target.width,
                height: target.height,
                data: vec![[0; 3]; target.width * target.height],
            },
        }
    }

    fn depth_bytes(&self) -> usize {
        self.millimetres.len() * self.args.stream_input.bytes()
    }

    fn amplitude_bytes(&self) -> usize {
        if self.args.stream_amplitude { 2 * self.millimetres.len() } else { 0 }
    }

    /// Corrected points of the depth camera, mm, in its frame.
    fn points(&mut self, index: usize, depth: &[u8]) -> Result<(Vec<[f32; 3]>, CorrectionSummary), CorrectorError> {
        let context = self.args.context(index, &self.amplitude);
        let mut points = vec![[0.0; 3]; self.millimetres.len()];
        let out = PointsMut::Interleaved(points.as_flattened_mut());
        let summary = match self.args.stream_input {
            Raw::F32 => {
                f32_from_bytes(depth, &mut self.millimetres);
                let summary = self.corrector.correct_f32_in_place(&mut self.millimetres, &context)?;
                self.corrector.points_f32_into(&self.millimetres, out)?;
                summary
            }
            Raw::U16 => {
                u16_from_bytes(depth, &mut self.steps.data);
                self.corrector.correct_to_points(&self.steps, self.unit_mm, &context, out)?
            }
        };
        Ok((points, summary))
    }
}

impl FrameJob for RegisterJob<'_> {
    fn frame_bytes(&self) -> usize {
        let color = if self.args.stream_color { 3 * self.color.data.len() } else { 0 };
        self.depth_bytes() + self.amplitude_bytes() + color
    }

    fn correct(&mut self, index: usize, frame: &[u8], out: &mut Vec<u8>) -> Result<CorrectionSummary, CorrectorError> {
        let (depth, after_depth) = frame.split_at(self.depth_bytes());
        let (amplitude, color) = after_depth.split_at(self.amplitude_bytes());
        if self.args.stream_amplitude {
            u16_from_bytes(amplitude, &mut self.amplitude.data);
        }
        if self.args.stream_color {
            self.color.data.copy_from_slice(color.as_chunks().0);
        }
        let (points, summary) = self.points(index, depth)?;
        let taken = Taken {
            time_s: self.args.stream_fps.map_or(f64::NAN, |fps| index as f64 / fps),
            temperature_c: self.args.stream_temperature.unwrap_or(f64::NAN),
        };
        let (placed, target) = (self.cameras.depth.at(&taken), self.cameras.target.at(&taken));
        let in_rig = |p: &[f32; 3]| placed.in_rig(p.map(f64::from)).map(|c| c as f32);
        if self.written == Written::Xyz {
            bytes_of(points.iter().flat_map(in_rig).map(f32::to_le_bytes).collect::<Vec<_>>().into_iter(), out);
            return Ok(summary);
        }
        let target_from_camera = target.from(&placed);
        let registered = depth_into(&points, self.steps.width, &target.camera, &target_from_camera);
        match self.written {
            Written::Xyz | Written::Xyzrgb => {
                let colours = colours_of(&points, &target.camera, &target_from_camera, &registered, &self.color);
                let value = |(p, colour): (&[f32; 3], &Option<[u8; 3]>)| {
                    let colour = colour.map_or([0; 4], |[r, g, b]| [r, g, b, u8::MAX]);
                    let [x, y, z] = in_rig(p).map(f32::to_le_bytes);
                    let mut bytes = [0; 16];
                    bytes.copy_from_slice([x, y, z, colour].as_flattened());
                    bytes
                };
                bytes_of(points.iter().zip(&colours).map(value), out);
            }
            Written::F32 => bytes_of(registered.depth_mm.iter().map(|z| z.to_le_bytes()), out),
            Written::U16 => {
                let unit_mm = self.unit_mm;
                let step = |z: &f32| {
                    let steps = (f64::from(*z) / unit_mm).round().clamp(1.0, f64::from(u16::MAX)) as u16;
                    if *z > 0.0 { steps.to_le_bytes() } else { [0; 2] }
                };
                bytes_of(registered.depth_mm.iter().map(step), out);
            }
        }
        Ok(summary)
    }
}
