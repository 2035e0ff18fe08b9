//! A fleet as text for a terminal.

use std::fmt::Write;

use depthcal_io::Fleet;

use super::sentences::{joined, on_depth, outlier, replication, scatter, shared_effect};
use crate::format::{number, p_value, shown_unit};

/// Columns that names of parameters take.
const NAME: usize = 26;

/// A fleet as text: parameters with means and scatter, shared effects, outliers, replications.
pub fn fleet_text(fleet: &Fleet) -> String {
    let mut t = String::new();
    let _ = writeln!(t, "{}", joined(fleet));
    for unit in &fleet.left_out {
        let _ = writeln!(t, "left out: {} ({})", unit.calibration, unit.reason);
    }
    let _ = writeln!(
        t,
        "\n{:<NAME$} {:>10}   {:>10}  {:>13} {:>9}  {:>9}",
        "parameter", "mean", "± of mean", "between units", "of noise", "p differs"
    );
    for p in &fleet.parameters {
        let unit = shown_unit(&p.unit);
        let line = format!(
            "{:<NAME$} {:>10}   {:>10}  {:>13} {:>9}  {:>9}  {unit}",
            p.name,
            number(p.mean),
            number(p.mean_std_dev),
            number(p.between_units),
            number(p.of_noise),
            p_value(p.differs_p_value)
        );
        let _ = writeln!(t, "{}", line.trim_end());
    }
    let _ = writeln!(t, "\n{:<NAME$} {:>10} {:>14} {:>14}", "unit", "frames", "depth rms / mm", "image rms / px");
    for unit in &fleet.units {
        let error = |rms: Option<f64>| rms.map_or_else(|| "–".to_owned(), number);
        let (depth, image) = (error(unit.depth_rms_mm), error(unit.reprojection_rms_px));
        let _ = writeln!(t, "{:<NAME$} {:>10} {depth:>14} {image:>14}", unit.name, unit.frames);
    }
    let _ = writeln!(t, "\n{}", scatter(fleet));
    let shared: Vec<_> = fleet.effects.iter().filter(|e| e.shared).collect();
    if shared.is_empty() && !fleet.effects.is_empty() {
        let _ = writeln!(t, "of {} effects none is certain to be shared", fleet.effects.len());
    }
    for effect in shared {
        let _ = writeln!(t, "{}", shared_effect(effect));
    }
    for effect in fleet.effects.iter().filter(|e| e.differs_p_value < fleet.level) {
        let _ = writeln!(t, "differs between units: {} (p = {})", effect.with, p_value(effect.differs_p_value));
    }
    for found in &fleet.replications {
        let _ = writeln!(t, "{}", replication(found));
    }
    for compared in &fleet.on_depth {
        let _ = writeln!(t, "{}", on_depth(compared, fleet.level));
    }
    if fleet.outliers.is_empty() {
        let _ = writeln!(t, "no unit is unlike the others");
    }
    for found in &fleet.outliers {
        let _ = writeln!(t, "{}", outlier(found));
    }
    t
}
