//! A small renderer of boards under known pose and lens that shares no code with the crate: several rays per pixel are
//! cast to the board.
#![allow(dead_code, unused_imports)]

pub mod measured;
#[cfg(all(feature = "opencv", fiducials = "contrib"))]
pub mod opencv_charuco;
pub mod scene;
pub mod tag_print;
pub mod texture;

pub use scene::{Camera, Pose, Scene};
pub use tag_print::Style;
pub use texture::Texture;

use depthcal_model::target::{Pattern, Target};

pub fn asymmetric(columns: usize, rows: usize, spacing_mm: f64, circle_diameter_mm: f64) -> Target {
    Target { pattern: Pattern::AsymmetricCircles { circle_diameter_mm }, columns, rows, spacing_mm }
}

pub fn symmetric(columns: usize, rows: usize, spacing_mm: f64, circle_diameter_mm: f64) -> Target {
    Target { pattern: Pattern::SymmetricCircles { circle_diameter_mm }, columns, rows, spacing_mm }
}

pub fn chessboard(columns: usize, rows: usize, spacing_mm: f64) -> Target {
    Target { pattern: Pattern::Chessboard, columns, rows, spacing_mm }
}

pub fn charuco(columns: usize, rows: usize, spacing_mm: f64, marker_mm: f64, dictionary: &str) -> Target {
    let pattern = Pattern::Charuco { marker_mm, dictionary: dictionary.into() };
    Target { pattern, columns, rows, spacing_mm }
}

pub fn aprilgrid(columns: usize, rows: usize, spacing_mm: f64, marker_mm: f64) -> Target {
    Target { pattern: Pattern::Aprilgrid { marker_mm }, columns, rows, spacing_mm }
}

/// Frames of a test of the detection rate; the environment variable DEPTHCAL_TEST_FRAMES sets another number.
pub fn frames(default: usize) -> usize {
    std::env::var("DEPTHCAL_TEST_FRAMES").ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0usize), |(s, n), v| (s + v * v, n + 1));
    (sum / count.max(1) as f64).sqrt()
}

/// Says that a test is skipped, and why. Written past the test runner, which shows the output of failed tests only.
pub fn skipped(why: &str) {
    use std::io::Write as _;
    let _ = write!(std::io::stderr(), "\nSKIPPED: {why}\n");
}
