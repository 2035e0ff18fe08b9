//! `apply - --register`: raw frames of a rig from standard input, resampled into another camera or as points in the frame of the
//! rig.

use depthcal_calibration::observe::PlacedCamera;
use depthcal_calibration::observe::Taken;
use depthcal_correction::{CorrectionSummary, CorrectorError, PointsMut, colours_of, depth_into};
use depthcal_io::{Calibration, CameraRecord, RgbImage};

use super::stream_args::{FrameInput, FrameJob, Written, bytes_of, in_steps};
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

/// Registration of the frames of a rig.
pub(super) struct RegisterJob<'a> {
    input: FrameInput<'a>,
    written: Written,
    cameras: &'a Registered,
    color: RgbImage,
}

impl<'a> RegisterJob<'a> {
    pub(super) fn new(input: FrameInput<'a>, cameras: &'a Registered, written: Written) -> Self {
        let (width, height) = (cameras.target.camera.width, cameras.target.camera.height);
        Self { input, written, cameras, color: RgbImage { width, height, data: vec![[0; 3]; width * height] } }
    }
}

impl FrameJob for RegisterJob<'_> {
    fn frame_bytes(&self) -> usize {
        self.input.bytes() + if self.input.args.stream_color { 3 * self.color.data.len() } else { 0 }
    }

    fn correct(&mut self, index: usize, frame: &[u8], out: &mut Vec<u8>) -> Result<CorrectionSummary, CorrectorError> {
        let color = self.input.take(frame);
        if self.input.args.stream_color {
            self.color.data.copy_from_slice(color.as_chunks().0);
        }
        let mut points = vec![[0.0; 3]; self.input.millimetres.len()];
        let summary = self.input.points(index, PointsMut::Interleaved(points.as_flattened_mut()))?;
        let args = self.input.args;
        let taken = Taken {
            time_s: args.stream_fps.map_or(f64::NAN, |fps| index as f64 / fps),
            temperature_c: args.stream_temperature.unwrap_or(f64::NAN),
        };
        let (placed, target) = (self.cameras.depth.at(&taken), self.cameras.target.at(&taken));
        let in_rig = |p: &[f32; 3]| placed.in_rig(p.map(f64::from)).map(|c| c as f32);
        if self.written == Written::Xyz {
            bytes_of(points.iter().flat_map(in_rig).map(f32::to_le_bytes).collect::<Vec<_>>().into_iter(), out);
            return Ok(summary);
        }
        let target_from_camera = target.from(&placed);
        let registered = depth_into(&points, self.input.steps.width, &target.camera, &target_from_camera);
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
                let step = |z: &f32| in_steps(*z, self.input.unit_mm).to_le_bytes();
                bytes_of(registered.depth_mm.iter().map(step), out);
            }
        }
        Ok(summary)
    }
}
