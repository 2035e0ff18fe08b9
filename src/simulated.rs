//! Simulated observations as captures: for tests, power studies and the demo. The simulator shares no code with the
//! model; this is the only place where they meet.

use depthcal_model::{Context, Pattern, Target};
use depthcal_simulate as simulate;

use crate::observations::{Capture, DepthSample, Frame, MarkerObservation};

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
pub fn capture(observed: &simulate::PointObservations) -> Capture {
    let truth = &observed.truth;
    let frames = observed.frames.iter().map(|frame| Frame {
        name: frame.name.clone(),
        markers: frame
            .markers
            .iter()
            .map(|m| MarkerObservation { index: m.index, pixel: m.pixel, std_px: 1.0 })
            .collect(),
        samples: frame
            .depths
            .iter()
            .map(|d| DepthSample {
                context: Context {
                    pixel: d.pixel,
                    amplitude: d.amplitude,
                    time_s: frame.conditions.time_s,
                    temperature_c: frame.conditions.temperature_c,
                    ..Context::default()
                },
                depth_mm: d.z_mm,
                board_seed: [f64::NAN; 2],
            })
            .collect(),
        time_s: frame.conditions.time_s,
        temperature_c: frame.conditions.temperature_c,
        ..Frame::default()
    });
    Capture {
        name: truth.kind.to_string(),
        target: target(&truth.board, truth.declared_spacing_mm),
        width: truth.camera.width,
        height: truth.camera.height,
        depth_unit_mm: Some(1.0),
        frames: frames.collect(),
        dropped: Vec::new(),
    }
}

/// True values of the camera's parameters in the order of a joint calibration with `projective`: k1 k2 p1 p2 k3, fx fy
/// cx cy skew, dx dy dz dw.
pub fn true_theta(camera: &simulate::CameraTruth) -> Vec<f64> {
    let pinhole = [camera.focal_px[0], camera.focal_px[1], camera.centre_px[0], camera.centre_px[1], camera.skew_px];
    camera.lens.iter().copied().chain(pinhole).chain(camera.depth).collect()
}
