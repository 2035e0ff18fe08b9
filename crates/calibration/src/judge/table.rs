//! Errors of datasets as text.

use depthcal_io::{BeforeAfter, DatasetEvaluation, MeanStd};

/// Text of the thesis' table 6.1: errors of every dataset without and with correction, and the share of board pixels that were
/// left out. The dataset with the name `marked`, to which the camera was fitted, gets an asterisk.
pub fn table(records: &[DatasetEvaluation], marked: Option<&str>) -> String {
    use std::fmt::Write;
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{:24} {:>6}  {:10} {:>17}  {:>17}  {:>9}  {:>8}  {:>9}",
        "", "", "depth", "dot error/mm", "plane error/mm", "depth rms", "left out", "reproj."
    );
    let _ = writeln!(
        text,
        "{:24} {:>6}  {:10} {:>8} {:>8}  {:>8} {:>8}  {:>9}  {:>8}  {:>9}",
        "dataset", "frames", "correction", "mean", "std", "mean", "std", "mm", "%", "px"
    );
    let cell = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.2}"));
    for r in records {
        let star = if marked == Some(r.name.as_str()) { "*" } else { "" };
        for (after, label) in [(false, "no"), (true, "yes")] {
            let pick = |b: Option<BeforeAfter<MeanStd>>| b.map(|b| if after { b.after } else { b.before });
            let (dot, plane) = (pick(r.dot_error_mm), pick(r.plane_error_mm));
            let rms = r.depth_rms_mm.map(|b| if after { b.after } else { b.before });
            let first = |text: String| if after { String::new() } else { text };
            let _ = writeln!(
                text,
                "{:24} {:>6}  {label:10} {:>8} {:>8}  {:>8} {:>8}  {:>9}  {:>8}  {:>9}",
                first(format!("{}{star}", r.name)),
                first(r.frames.to_string()),
                cell(dot.map(|d| d.mean)),
                cell(dot.map(|d| d.std)),
                cell(plane.map(|d| d.mean)),
                cell(plane.map(|d| d.std)),
                cell(rms),
                first(cell(r.outliers.map(|o| 100.0 * o.share))),
                first(r.reprojection_px.map_or_else(|| "–".to_owned(), |error| format!("{:.3}", error.rms))),
            );
        }
    }
    text
}
