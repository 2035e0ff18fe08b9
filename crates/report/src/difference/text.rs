//! The difference of two calibrations as text for a terminal.

use std::fmt::Write;

use depthcal_io::{CameraDifference, Difference, DifferenceSize};

use super::sentences::{difference_sentences, distance, notes};
use crate::format::{number, p_value};

/// The difference as text: a table for every camera, then the verdict.
pub fn difference_text(d: &Difference) -> String {
    let mut t = String::new();
    for camera in &d.cameras {
        if d.cameras.len() > 1 {
            let _ = writeln!(t, "camera {}", camera.name);
        }
        table(&mut t, camera);
    }
    for sentence in difference_sentences(d).into_iter().chain(notes(d)) {
        let _ = writeln!(t, "{sentence}");
    }
    t
}

fn table(t: &mut String, camera: &CameraDifference) {
    let _ = writeln!(t, "{:<12} {:>10} {:>10} {:>16} {:>9}", "difference", "at", "rms", "by uncertainties", "p");
    for d in &camera.depth {
        row(t, "depth / mm", Some(d.distance_mm), &d.size);
    }
    for p in &camera.projection {
        row(t, "image / px", p.distance_mm, &p.size);
    }
    let _ = writeln!(t);
}

fn row(t: &mut String, name: &str, mm: Option<f64>, size: &DifferenceSize) {
    let mark = if size.differs { "  more than the uncertainties" } else { "" };
    let _ = writeln!(
        t,
        "{name:<12} {:>10} {:>10} {:>16} {:>9}{mark}",
        mm.map_or_else(|| "all".to_owned(), distance),
        number(size.rms),
        size.expected_rms.map_or_else(|| "–".to_owned(), number),
        size.p_value.map_or_else(|| "–".to_owned(), p_value),
    );
}
