//! A board as detection sees it: the name of its kind, the step of its lattice, which way up it is.

use depthcal_model::target::{Pattern, Target};

/// Name of a kind of board as in `dataset.toml`.
pub(crate) fn kind(target: &Target) -> &'static str {
    match target.pattern {
        Pattern::AsymmetricCircles { .. } => "asymmetric-circles",
        Pattern::SymmetricCircles { .. } => "symmetric-circles",
        Pattern::Chessboard => "chessboard",
        Pattern::Charuco { .. } => "charuco",
        Pattern::Aprilgrid { .. } => "aprilgrid",
        Pattern::Several { .. } => "several boards",
    }
}

/// Distance between nearest neighbours of a circle grid, mm.
pub(crate) fn step_mm(target: &Target) -> f64 {
    match target.pattern {
        Pattern::AsymmetricCircles { .. } => target.spacing_mm * std::f64::consts::SQRT_2,
        _ => target.spacing_mm,
    }
}

/// How upright the board appears, from −2 to 2: the cosine of the angle between its rows and the image's rows plus that
/// between its columns and the image's columns. `pixel` maps board points (mm) to the image (px).
pub(crate) fn upright(target: &Target, pixel: impl Fn([f64; 2]) -> Option<[f64; 2]>) -> Option<f64> {
    let middle = target.point(target.len() / 2);
    let centre = pixel(middle)?;
    let x = pixel([middle[0] + target.spacing_mm, middle[1]])?;
    let y = pixel([middle[0], middle[1] + target.spacing_mm])?;
    let (x, y) = ([x[0] - centre[0], x[1] - centre[1]], [y[0] - centre[0], y[1] - centre[1]]);
    Some(x[0] / x[0].hypot(x[1]) + y[1] / y[0].hypot(y[1]))
}
