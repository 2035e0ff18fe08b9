//! Declarations of the dataset that cannot be right: the size of the board's squares and the unit of depth.

use depthcal_statistics::{Thinning, upper_median};

use super::thresholds::Thresholds;
use crate::adjust::blocks::is_depth_only;
use crate::calibrate::Calibrated;
use crate::observe::PixelRays;
use crate::observe::board_pixels::{board_area_px, board_pixels};
use crate::observe::board_region::BoardRegion;

/// Most pixels of a depth image that are compared with the board, about.
const MOST_PIXELS: usize = 2000;

/// Depth and image disagree in scale by more than a depth camera's error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImplausibleScale {
    /// Median of measured depth over the depth at which the image sees the board.
    pub scale: f64,
    /// The declared distance between the board's markers, `spacing_mm` under `[board]`.
    pub spacing_mm: f64,
    /// The declared unit of depth, `unit_mm` under `[depth]`.
    pub unit_mm: f64,
}

impl ImplausibleScale {
    /// The `spacing_mm` with which depth and image would agree.
    pub fn fitting_spacing_mm(&self) -> f64 {
        self.spacing_mm * self.scale
    }

    /// The `unit_mm` with which depth and image would agree.
    pub fn fitting_unit_mm(&self) -> f64 {
        self.unit_mm / self.scale
    }
}

/// Checks the scale of depth against the image; at most one finding. A wrong `spacing_mm` or `unit_mm` scales depth as a whole,
/// which the depth model's parameter dw takes up, so that residuals do not show it.
pub fn implausible_declarations(fit: &Calibrated, thresholds: &Thresholds) -> Vec<ImplausibleScale> {
    let Some(scale) = depth_scale(fit) else { return Vec::new() };
    if (scale - 1.0).abs() <= thresholds.plausible_scale_deviation {
        return Vec::new();
    }
    let unit_mm = fit.capture.depth_unit_mm.unwrap_or(1.0);
    vec![ImplausibleScale { scale, spacing_mm: fit.capture.target.spacing_mm, unit_mm }]
}

/// Median of measured depth over the depth at which the image sees the board; `None` without depth.
fn depth_scale(fit: &Calibrated) -> Option<f64> {
    let unit_mm = fit.capture.depth_unit_mm.unwrap_or(1.0);
    let without_depth_pieces = fit.camera.filtered(|b| !is_depth_only(b));
    let rays = PixelRays::new(&without_depth_pieces, &fit.capture.target);
    let mut ratios: Vec<f64> = Vec::new();
    for frame in &fit.capture.frames {
        let region = BoardRegion::within_markers(&fit.capture.target, &frame.markers);
        // Whoever needs the image will say that it cannot be read.
        let Ok(open) = frame.open() else { continue };
        let pose = &frame.camera_from_board;
        let thinning = Thinning::new(board_area_px(rays.camera(), &region, pose), MOST_PIXELS);
        let pixels = board_pixels(&open, unit_mm, &rays, &region, pose, thinning);
        ratios.extend(pixels.iter().map(|p| p.depth_mm / p.board_depth_mm));
    }
    upper_median(&mut ratios)
}
