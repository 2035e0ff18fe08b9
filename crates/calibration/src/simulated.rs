//! Simulated observations as captures: for tests, power studies and the demo. The simulator shares no code with the
//! model; this is the only place where they meet.

use depthcal_io::{DepthFrame, DepthValues, ImageError};
use depthcal_model::{Context, Pattern, Target};
use depthcal_simulate as simulate;
use thiserror::Error;

use crate::observe::stored::depth_digest;
use crate::observe::{CameraFrames, DepthPixel, DetectedFrame, MarkerObservation, MeasuredDepth, RawFrame, Stored};

/// Why an effect cannot be planted in a capture.
#[derive(Debug, Error)]
pub enum PlantError {
    /// The effect cannot be planted.
    #[error(transparent)]
    Simulate(#[from] simulate::SimulateError),
    /// An image of the capture cannot be read.
    #[error(transparent)]
    Image(#[from] ImageError),
}

/// The board of a simulation, in the model's terms.
pub fn target(board: &simulate::Board, declared_spacing_mm: f64) -> Target {
    let pattern = match board.pattern {
        simulate::Pattern::AsymmetricCircles { circle_diameter_mm } => {
            Pattern::AsymmetricCircles { circle_diameter_mm }
        }
        simulate::Pattern::SymmetricCircles { circle_diameter_mm } => Pattern::SymmetricCircles { circle_diameter_mm },
        simulate::Pattern::Chessboard => Pattern::Chessboard,
    };
    Target { pattern, columns: board.columns, rows: board.rows, spacing_mm: declared_spacing_mm }
}

/// Observations at the point level as a capture whose depth samples are given.
pub fn capture(observed: &simulate::PointObservations) -> CameraFrames {
    let truth = &observed.truth;
    let frames = observed.frames.iter().map(|frame| {
        let markers = frame.markers.iter().map(|m| MarkerObservation { index: m.index, pixel: m.pixel, std_px: 1.0 });
        let pixels = frame
            .depths
            .iter()
            .map(|d| DepthPixel {
                context: Context {
                    pixel: d.pixel,
                    amplitude: d.amplitude,
                    time_s: frame.conditions.time_s,
                    temperature_c: frame.conditions.temperature_c,
                    ..Context::default()
                },
                depth_mm: d.z_mm,
            })
            .collect();
        let raw = RawFrame {
            name: frame.name.clone(),
            time_s: frame.conditions.time_s,
            temperature_c: frame.conditions.temperature_c,
            depth: MeasuredDepth::Pixels(pixels),
            ..RawFrame::default()
        };
        DetectedFrame { raw, markers: markers.collect(), ..DetectedFrame::default() }
    });
    CameraFrames {
        name: truth.kind.to_string(),
        target: target(&truth.board, truth.declared_spacing_mm),
        width: truth.camera.width,
        height: truth.camera.height,
        depth_unit_mm: Some(1.0),
        disparity: None,
        technology: None,
        frames: frames.collect(),
        dropped: Vec::new(),
    }
}

/// A capture with `effect` planted in its depth images, and the effect's root mean square over all valid pixels, mm. The
/// pinhole is fx, fy, cx, cy, skew, px. Amplitudes count as shares of the brightest pixel of each image.
///
/// # Errors
///
/// [`PlantError`] where the effect cannot be planted in depth images, or where these cannot be read.
pub fn planted(
    capture: &CameraFrames,
    [fx, fy, cx, cy, _]: [f64; 5],
    effect: &simulate::Effect,
) -> Result<(CameraFrames, f64), PlantError> {
    let unit_mm = capture.depth_unit_mm.unwrap_or(1.0);
    let session_s = capture.frames.iter().map(|f| f.time_s).fold(1.0, f64::max);
    let mut planted = capture.clone();
    let (mut sum, mut count) = (0.0, 0_usize);
    for (index, frame) in planted.frames.iter_mut().enumerate() {
        let Some(depth) = frame.depth_image().map(Stored::get).transpose()? else { continue };
        let image = frame.image.as_ref().map(Stored::get).transpose()?;
        let amplitude: Option<Vec<f32>> = image.map(|image| {
            let brightest = image.data.iter().copied().max().map_or(1.0, f32::from).max(1.0);
            image.data.iter().map(|v| f32::from(*v) / brightest).collect()
        });
        let view = simulate::PlantView {
            width: depth.width,
            height: depth.height,
            unit_mm,
            focal_px: [fx, fy],
            centre_px: [cx, cy],
            conditions: simulate::Conditions {
                frame: index,
                time_s: frame.time_s,
                session_s,
                temperature_c: if frame.temperature_c.is_finite() { frame.temperature_c } else { 25.0 },
            },
            amplitude: amplitude.as_deref(),
            unit: 0,
            seed: 1,
        };
        // Effects are planted in whole steps, which is what the datasets of these studies hold.
        let DepthValues::Steps(measured) = &depth.values else { continue };
        let mut data = measured.clone();
        simulate::plant(effect, &mut data, &view)?;
        for (a, b) in measured.iter().zip(&data).filter(|(a, b)| **a > 0 && **b > 0) {
            sum += (unit_mm * (f64::from(*a) - f64::from(*b))).powi(2);
            count += 1;
        }
        let depth = DepthFrame { values: DepthValues::Steps(data), ..*depth };
        frame.depth_digest = depth_digest(&depth);
        frame.depth = MeasuredDepth::Image(depth.into());
    }
    Ok((planted, (sum / count.max(1) as f64).sqrt()))
}

/// True values of the camera's parameters in the order of a joint calibration with `projective`: k1 k2 p1 p2 k3, fx fy
/// cx cy skew, dx dy dz dw.
pub fn true_theta(camera: &simulate::CameraTruth) -> Vec<f64> {
    let pinhole = [camera.focal_px[0], camera.focal_px[1], camera.centre_px[0], camera.centre_px[1], camera.skew_px];
    camera.lens.iter().copied().chain(pinhole).chain(camera.depth).collect()
}
