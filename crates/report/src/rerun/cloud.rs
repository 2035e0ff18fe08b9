//! Board pixels in space, as measured and as corrected, coloured by their depth error.

use depthcal_model::Camera;
use nalgebra::Point3;
use re_sdk_types::archetypes::Points3D;
use re_sdk_types::components::{Color, Radius};

use depthcal_calibration::judge::camera::EvaluatedFrame;
use depthcal_calibration::judge::depth_errors::DepthErrors;

/// Points of a cloud at most: every n-th pixel, where there are more.
pub(super) const MOST_POINTS: usize = 20_000;
/// The colours end at this many times the corrected depth's rms error.
const SPAN: f64 = 3.0;

/// Too near, right, too far.
const NEAR: [f64; 3] = [5.0, 113.0, 176.0];
const RIGHT: [f64; 3] = [235.0, 235.0, 235.0];
const FAR: [f64; 3] = [202.0, 0.0, 32.0];

/// Depth errors as colours, the same for all clouds of a recording.
#[derive(Debug, Clone, Copy)]
pub(super) struct Colours {
    /// The error of the fullest colour, mm.
    pub span_mm: f64,
}

impl Colours {
    /// For these frames.
    pub(super) fn of<'a>(frames: impl Iterator<Item = &'a EvaluatedFrame>) -> Self {
        let rms = DepthErrors::over(frames.map(|f| &f.depth)).rms_mm().map_or(0.0, |rms| rms.after);
        Self { span_mm: if rms > 0.0 { SPAN * rms } else { 1.0 } }
    }

    fn colour(&self, error_mm: f64) -> Color {
        let t = (error_mm / self.span_mm).clamp(-1.0, 1.0);
        let end = if t < 0.0 { NEAR } else { FAR };
        let [r, g, b] = [0, 1, 2].map(|i| (RIGHT[i] + t.abs() * (end[i] - RIGHT[i])).round() as u8);
        Color::from_rgb(r, g, b)
    }
}

/// The board pixels of a frame as measured and as corrected.
pub(super) fn clouds(camera: &Camera, frame: &EvaluatedFrame, colours: &Colours) -> [Points3D; 2] {
    // As in the evaluation: depth as measured is taken where the depth image says it is.
    let bare = camera.filtered(|block| !depthcal_calibration::adjust::blocks::is_depth_only(block));
    let step = frame.pixels.len().div_ceil(MOST_POINTS).max(1);
    let mut points = [Vec::new(), Vec::new()];
    let mut errors = [Vec::new(), Vec::new()];
    for p in frame.pixels.iter().step_by(step) {
        let measured_mm = p.board_depth_mm + p.before_mm;
        let Ok(ray) = bare.ray(bare.image_pixel(&p.context), 1.0 / measured_mm) else { continue };
        let corrected = camera.correct_near(&p.context, p.cos_incidence, 1.0 / measured_mm, Some(ray));
        let Ok((corrected_ray, rho)) = corrected else { continue };
        let positions = [(ray, measured_mm, p.before_mm), (corrected_ray, 1.0 / rho, p.after_mm)];
        for (i, ([x, y], z, error_mm)) in positions.into_iter().enumerate() {
            points[i].push(metres(&Point3::new(x * z, y * z, z)));
            errors[i].push(colours.colour(error_mm));
        }
    }
    let [measured, corrected] = points;
    let [before, after] = errors;
    [(measured, before), (corrected, after)]
        .map(|(points, colours)| Points3D::new(points).with_colors(colours).with_radii([Radius::new_ui_points(1.5)]))
}

/// A point in mm as the viewer's metres.
pub(super) fn metres(p: &Point3<f64>) -> [f32; 3] {
    [p.x, p.y, p.z].map(|c| (c / 1000.0) as f32)
}
