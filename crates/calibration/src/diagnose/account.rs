//! The account of a diagnosis as text for terminals.

use std::fmt::Write;

use depthcal_io::Verdict;

use super::diagnosis::Diagnosis;
use super::record::candidate;

/// A p-value as people read it.
fn p_value(p: f64) -> String {
    if p < 1e-16 {
        "p < 1e-16".to_owned()
    } else if p < 1e-3 {
        format!("p = {p:.0e}")
    } else {
        format!("p = {p:.3}")
    }
}

fn mm(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |v| if v < 0.995 { format!("{v:.3}") } else { format!("{v:.2}") })
}

/// The verdict in a sentence.
pub fn verdict(d: &Diagnosis) -> String {
    let names: Vec<&str> = d.steps.iter().map(|s| s.effects[0].as_str()).collect();
    let added =
        if names.is_empty() { String::new() } else { format!("{} was missing and is added", names.join(", then ")) };
    match (d.verdict, names.is_empty()) {
        (Verdict::Adequate, _) => "adequate: these captures show nothing that the model lacks".to_owned(),
        (Verdict::Effect, _) => format!("effect: {added}; nothing else is left that these captures show"),
        (Verdict::Unexplained, true) => {
            "unexplained: something is left that no effect of the catalogue explains".to_owned()
        }
        (Verdict::Unexplained, false) => {
            format!("unexplained: {added}; something is left that no effect of the catalogue explains")
        }
    }
}

/// The one-page account: what was left, what was tested, what was added, what it brought, what else it could be, what these
/// data cannot show.
pub fn text(d: &Diagnosis) -> String {
    let mut t = String::new();
    let _ = writeln!(t, "{}\n", verdict(d));
    for sentence in &d.declarations {
        let _ = writeln!(t, "check the declarations: {sentence}");
    }
    for frame in &d.bad_frames {
        let _ = writeln!(t, "left out: {} ({})", frame.name, frame.reason);
    }
    for (i, step) in d.steps.iter().enumerate() {
        let _ =
            writeln!(t, "{}. added {}: {} mm rms, {}", i + 1, step.spec, mm(Some(step.size_mm)), p_value(step.p_value));
        for p in &step.parameters {
            let std = p.std.map_or_else(|| "held".to_owned(), |s| format!("± {s:.1e}"));
            let _ = writeln!(t, "     {:4} {:>12.4e} {std} {}", p.name, p.value, p.unit);
        }
        let (b, a) = (&step.before, &step.after);
        let _ = writeln!(
            t,
            "   on held-out frames: depth {} → {} mm rms, dot {} → {} mm, plane {} → {} mm, image {:.4} → {:.4} px",
            mm(b.depth_rms_mm),
            mm(a.depth_rms_mm),
            mm(b.dot_error_mm),
            mm(a.dot_error_mm),
            mm(b.plane_error_mm),
            mm(a.plane_error_mm),
            b.reprojection_px,
            a.reprojection_px
        );
        if let Some(gain) = step.gain_percent {
            let _ = writeln!(
                t,
                "   depth error falls by {:.1} % (95 % interval over frames {:.1} to {:.1} %)",
                gain.value, gain.low, gain.high
            );
        }
        if !step.indistinguishable.is_empty() {
            let _ = writeln!(t, "   these captures cannot tell it from: {}", step.indistinguishable.join(", "));
        }
        if step.effects.len() > 1 {
            let _ = writeln!(t, "   explained together with: {}", step.effects[1..].join(", "));
        }
    }
    for sentence in &d.left_over {
        let _ = writeln!(t, "left: {sentence}");
    }
    let (b, a) = (&d.before.errors, &d.after.errors);
    let _ = writeln!(
        t,
        "\nheld-out frames, first model → last: depth {} → {} mm rms, dot {} → {} mm, image {:.4} → {:.4} px",
        mm(b.depth_rms_mm),
        mm(a.depth_rms_mm),
        mm(b.dot_error_mm),
        mm(a.dot_error_mm),
        b.reprojection_px,
        a.reprojection_px
    );
    let cost = d.examination.cost();
    let _ = writeln!(t, "\nbeside the last model:");
    let _ = writeln!(
        t,
        "  {:22} {:>10} {:>13} {:>15} {:>13}",
        "", "p-value", "held-out gain", "expected size", "detectable"
    );
    for e in d.examination.evidence.iter().filter(|e| e.along.is_none()) {
        let c = candidate(e, cost);
        let _ = writeln!(
            t,
            "  {:22} {:>10.1e} {:>11.3} % {:>12} mm {:>10} mm",
            c.effect,
            c.p_value,
            c.held_out_gain_percent,
            mm(c.expected_size_mm),
            mm(c.minimal_detectable_mm)
        );
    }
    for sentence in &d.capture_next {
        let _ = writeln!(t, "capture next: {sentence}");
    }
    t
}
