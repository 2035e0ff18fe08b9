//! The cause for which depth contradicts the boards, in words.

use thiserror::Error;

use super::depth_alternative::{DepthAlternative, Quantity};
use super::depth_points::Deviation;
use super::registration::Registration;

/// Scale, or its inverse, from which on the unit is at fault as well.
const MOST_SCALE: f64 = 1.5;

/// The cause for which depth contradicts the boards that the images show.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DepthCause {
    /// Depth is something else than what is declared.
    #[error("{}{} ({})", .alternative, further(.deviation, *.unit_mm, *.spacing_mm), compared(.declared, .deviation.relative))]
    Other {
        /// The alternative that fits.
        alternative: DepthAlternative,
        /// Deviation of depth as declared; `None` where nothing was measured on the boards.
        declared: Option<Deviation>,
        /// That of the alternative.
        deviation: Deviation,
        /// The declared `depth.unit_mm`.
        unit_mm: f64,
        /// The declared `board.spacing_mm`.
        spacing_mm: f64,
    },
    /// Depth lies on another pixel grid than the image.
    #[error("{} ({})", .registration, compared(.declared, .registration.relative))]
    OtherGrid {
        /// How the grids lie on each other.
        registration: Registration,
        /// Deviation of depth as declared.
        declared: Option<Deviation>,
    },
}

impl DepthCause {
    /// Whether depth is right but for holding ranges: errors of a few per cent that a fit survives.
    pub fn is_range_only(&self) -> bool {
        let range = DepthAlternative { quantity: Quantity::Range, ..DepthAlternative::DECLARED };
        matches!(self, Self::Other { alternative, deviation, .. } if *alternative == range && !is_scaled(deviation))
    }
}

fn is_scaled(deviation: &Deviation) -> bool {
    deviation.scale.max(1.0 / deviation.scale) > MOST_SCALE
}

/// The wrong unit, where there is one as well as the other faults, or how a disparity is converted.
fn further(deviation: &Deviation, unit_mm: f64, spacing_mm: f64) -> String {
    if let Some([a, b]) = deviation.affine {
        return format!(
            ": write disparity = [{a:.6e}, {b:.6e}] under [depth], in place of unit_mm (1/z = a + b d in 1/mm)"
        );
    }
    if !is_scaled(deviation) {
        return String::new();
    }
    let scale = deviation.scale;
    format!(
        "; and depth is {} times what the images show: check depth.unit_mm (declared {unit_mm}, {:.4} would fit) and \
         board.spacing_mm (declared {spacing_mm}, {:.4} would fit) in dataset.toml",
        significant(scale),
        unit_mm / scale,
        spacing_mm * scale
    )
}

/// The deviations that decided.
fn compared(declared: &Option<Deviation>, relative: f64) -> String {
    match declared {
        Some(declared) => format!(
            "depth is off the boards that the images show by {} as declared, by {} like this",
            percent(declared.relative),
            percent(relative)
        ),
        None => format!(
            "as declared hardly any depth lies on the boards that the images show, like this it is off by {}",
            percent(relative)
        ),
    }
}

fn percent(share: f64) -> String {
    format!("{} %", significant(100.0 * share))
}

/// Three significant digits.
fn significant(value: f64) -> String {
    let digits = (2.0 - value.abs().max(1e-3).log10().floor()).clamp(0.0, 4.0);
    format!("{value:.*}", digits as usize)
}
