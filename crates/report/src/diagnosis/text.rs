//! A diagnosis as a page of text for a terminal.

use std::fmt::Write;

use depthcal_io::{CameraDiagnosis, DiagnosisCandidate, DiagnosisParameter, DiagnosisStep, HeldOutErrors, Verdict};
use depthcal_model::Register;

use super::answers::arrow;
use super::formula::{FormulaText, formula_sentences};
use super::remedies::remedy;
use super::sentences::{
    capture, declaration, frame_cause, left_over, place, possible, pure_error, rivals_of_other_technologies, searched,
};
use crate::format::{count, interval, join, measured, number, p_equals, p_value, percent, quantity, shown_unit};
use crate::left_out::share;
use crate::parameters::summary;

/// The verdict of a diagnosis in a sentence, without full stop.
pub fn verdict_sentence(d: &CameraDiagnosis) -> String {
    let is_certain = |s: &&DiagnosisStep| s.gain().is_none_or(|gain| gain.is_certain());
    let name = |s: &DiagnosisStep| s.effects.first().cloned();
    let (certain, possible): (Vec<&DiagnosisStep>, Vec<&DiagnosisStep>) = d.steps.iter().partition(is_certain);
    let [certain, possible] = [certain, possible].map(|steps| steps.into_iter().filter_map(name).collect::<Vec<_>>());
    let were = if certain.len() == 1 { "was" } else { "were" };
    let missing = (!certain.is_empty()).then(|| format!("{} {were} missing and {were} added", join(&certain)));
    let maybe = (!possible.is_empty()).then(|| format!("added, but not certain: {}", join(&possible)));
    let added = [missing, maybe].into_iter().flatten().collect::<Vec<_>>().join("; ");
    match (d.verdict, d.steps.is_empty()) {
        (Verdict::Adequate, _) => "adequate: these captures show nothing that the model lacks".to_owned(),
        (Verdict::Effect, _) => format!("effect: {added}; these captures show nothing else"),
        (Verdict::Unexplained, true) => "unexplained: something is left that no known effect explains".to_owned(),
        (Verdict::Unexplained, false) if d.lacks_only_causes() => {
            format!("unexplained: {added}; nothing else is left, but the cause of a function is not known")
        }
        (Verdict::Unexplained, false) => {
            format!("unexplained: {added}; something is left that no known effect explains")
        }
    }
}

/// How much of a diagnosis a terminal shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// As much as one screen holds.
    Screen,
    /// Parameters, places and every effect that was tested as well.
    All,
}

/// Most captures that a screen proposes.
const MOST_PROPOSED: usize = 2;

/// A diagnosis as text: excluded frames, added effects with their gains, what is left, held-out errors, what to capture next, and
/// last the verdict; with [`Detail::All`] also parameters, and the effects that were tested given the last model.
pub fn diagnosis_text(d: &CameraDiagnosis, register: &Register, detail: Detail) -> String {
    let mut t = String::new();
    for finding in &d.declarations {
        let _ = writeln!(t, "check the dataset file: {}", declaration(finding));
    }
    for frame in &d.bad_frames {
        let _ = writeln!(t, "excluded: {} ({})", frame.name, frame_cause(&frame.cause));
    }
    for (i, step) in d.steps.iter().enumerate() {
        t += &step_text(i + 1, step, register, detail);
    }
    for found in &d.possible {
        let _ = writeln!(t, "possible, not added: {}", possible(found, register));
    }
    if let Some(refused) = &d.formula_refused {
        let _ = writeln!(t, "no formula: {refused}");
    }
    for left in &d.left_over {
        let _ = writeln!(t, "left: {}", left_over(left));
    }
    if let Some(functions) = &d.searched {
        let _ = writeln!(t, "tried on what is left: {}", searched(functions));
    }
    if let Some(error) = &d.pure_error {
        let _ = writeln!(t, "{}", pure_error(error));
    }
    let all = detail == Detail::All;
    if let Some(round) = d.rounds.last() {
        match all {
            true => t += &candidates(&round.effects),
            false => {
                let tested = count(round.effects.len(), "effect");
                let _ = writeln!(t, "{tested} tested given the last model; -v lists them");
            }
        }
    }
    let proposed = if all { d.capture_next.len() } else { MOST_PROPOSED };
    for proposal in d.capture_next.iter().take(proposed) {
        let _ = writeln!(t, "capture next: {}", capture(proposal));
    }
    let _ = writeln!(t, "\nheld-out frames, declared → last model: {}", errors(&d.held_out.before, &d.held_out.after));
    let _ = writeln!(t, "{}", verdict_sentence(d));
    t
}

fn step_text(number_of_step: usize, s: &DiagnosisStep, register: &Register, detail: Detail) -> String {
    let mut t = String::new();
    let all = detail == Detail::All;
    let (size, p) = (quantity(s.size_mm, "mm"), p_equals(s.p_value));
    let _ = writeln!(t, "{number_of_step}. added {}: {size} rms, {p}", register.words(&s.with));
    if let Some(name) = s.effects.first()
        && let Some(remedy) = remedy(name)
    {
        let _ = writeln!(t, "   {}: {remedy}", summary(register, name));
    }
    if all {
        t += &place(s).map_or_else(String::new, |place| format!("   {place}\n"));
        let (parameters, splines) = s.parameters_and_splines();
        parameters.into_iter().for_each(|p| t += &parameter(p));
        splines.iter().for_each(|spline| t += &format!("     {}\n", spline_words(spline)));
        let _ = writeln!(t, "   held-out frames: {}", errors(&s.before, &s.after));
    }
    if let Some(gain) = &s.gain_percent {
        let (fall, range) = (percent(gain.value), interval(gain.low, gain.high, "%"));
        let _ =
            writeln!(t, "   given all others, the error on left-out frames falls by {fall} (95 % interval {range})");
    }
    if !s.indistinguishable.is_empty() {
        let _ = writeln!(t, "   these captures cannot distinguish it from: {}", s.indistinguishable.join(", "));
    }
    if let Some(sentence) = rivals_of_other_technologies(s) {
        let _ = writeln!(t, "   {sentence}");
    }
    if let Some(formula) = &s.formula {
        let _ = writeln!(t, "   {}", formula_sentences(formula, &FormulaText::Plain).join("\n   "));
    }
    if all && s.effects.len() > 1 {
        let _ = writeln!(t, "   found together with: {}", s.effects[1..].join(", "));
    }
    t
}

fn parameter(p: &DiagnosisParameter) -> String {
    let shown = measured(p.value, p.std);
    let std = shown.std.map_or_else(|| "fixed".to_owned(), |std| format!("± {std}"));
    let unit = shown_unit(&p.unit);
    let line = format!("     {:6} {:>12} {std:<11} {unit}", p.name, shown.value);
    format!("{}\n", line.trim_end())
}

/// The coefficients of a spline in words: their names, and the least and the largest value.
pub(super) fn spline_words(coefficients: &[&DiagnosisParameter]) -> String {
    let (Some(first), Some(last)) = (coefficients.first(), coefficients.last()) else { return String::new() };
    let least = coefficients.iter().map(|p| p.value).fold(f64::INFINITY, f64::min);
    let largest = coefficients.iter().map(|p| p.value).fold(f64::NEG_INFINITY, f64::max);
    let (least, largest, unit) = (number(least), number(largest), shown_unit(&first.unit));
    format!(
        "{} … {}: {} coefficients of a spline, {least} to {largest} {unit}",
        first.name,
        last.name,
        coefficients.len()
    )
}

/// Errors before and after, in one line.
fn errors(before: &HeldOutErrors, after: &HeldOutErrors) -> String {
    let kinds = [
        ("depth", "rms", before.depth_rms_mm, after.depth_rms_mm),
        ("plane", "mean", before.plane_error_mm, after.plane_error_mm),
        ("dot", "mean", before.dot_error_mm, after.dot_error_mm),
    ];
    let depth = kinds.iter().filter(|k| k.2.is_some() || k.3.is_some());
    let mut parts: Vec<String> =
        depth.map(|(kind, how, before, after)| format!("{kind} {} {how}", arrow(*before, *after, "mm"))).collect();
    if let Some(after) = after.outliers {
        let (before, after) = (before.outliers.map(|o| share(Some(o.share))), share(Some(after.share)));
        let shares =
            before.filter(|before| *before != after).map_or_else(|| after.clone(), |b| format!("{b} → {after}"));
        parts.push(format!("{shares} of the board left out"));
    }
    if before.reprojection_px.is_some() || after.reprojection_px.is_some() {
        parts.push(format!("reprojection {} rms", arrow(before.reprojection_px, after.reprojection_px, "px")));
    }
    parts.join(", ")
}

/// The table of the effects that were tested given the last model.
fn candidates(effects: &[DiagnosisCandidate]) -> String {
    let mut t = String::new();
    let size = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |v| format!("{} mm", number(v)));
    let _ = writeln!(t, "\neffects tested given the last model:");
    let _ = writeln!(
        t,
        "  {:22} {:>9} {:>13} {:>14} {:>15}",
        "", "p-value", "held-out gain", "estimated size", "detectable size"
    );
    for c in effects {
        let _ = writeln!(
            t,
            "  {:22} {:>9} {:>13} {:>14} {:>15}",
            c.effect,
            p_value(c.p_value),
            percent(c.held_out_gain_percent),
            size(c.expected_size_mm),
            c.minimal_detectable_mm
                .filter(|mm| *mm > 0.0)
                .map_or_else(|| "not testable".to_owned(), |mm| quantity(mm, "mm"))
        );
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;
    use depthcal_io::{DiagnosisPlace, DiagnosisRound, GainInterval};
    use depthcal_model::{Of, On};

    /// A record of one step, without errors of depth before it.
    fn record() -> CameraDiagnosis {
        let errors = |mm: Option<f64>| HeldOutErrors {
            depth_rms_mm: mm,
            reprojection_px: Some(0.1234),
            ..HeldOutErrors::default()
        };
        let step = DiagnosisStep {
            effects: vec!["cyclic_depth".to_owned(), "range_offset".to_owned()],
            indistinguishable: vec!["disparity_ripple".to_owned()],
            of_other_technologies: vec!["disparity_ripple".to_owned()],
            with: "cyclic_depth@of=measured@period_mm=299.90356313997415".parse().unwrap(),
            place: Some(DiagnosisPlace { of: Of::Measured, on: On::Depth }),
            places_not_told_apart: vec![DiagnosisPlace { of: Of::True, on: On::Factor }],
            parameters: vec![
                DiagnosisParameter { name: "a".into(), value: 2.98123, unit: "mm".into(), std: Some(0.0123) },
                DiagnosisParameter { name: "b".into(), value: 0.5, unit: "1".into(), std: None },
            ],
            size_mm: 2.1,
            p_value: 1e-30,
            before: errors(Some(6.604)),
            after: errors(Some(5.512)),
            depth_rms_after_mm: None,
            depth_gain_percent: None,
            gain_percent: Some(GainInterval { value: 16.53, low: 13.49, high: 20.1 }),
            formula: None,
        };
        let candidate = DiagnosisCandidate {
            effect: "board_bow".to_owned(),
            along: None,
            p_value: 0.3,
            expected_size_mm: Some(0.01),
            minimal_detectable_mm: None,
            held_out_gain_percent: -0.2,
        };
        CameraDiagnosis {
            dataset: depthcal_io::FileReference { path: "captures".to_owned(), digest: "00".to_owned() },
            model: "projective".parse().unwrap(),
            verdict: Verdict::Effect,
            steps: vec![step],
            possible: Vec::new(),
            pure_error: None,
            candidates: Vec::new(),
            rounds: vec![DiagnosisRound { effects: vec![candidate], ..DiagnosisRound::default() }],
            bad_frames: Vec::new(),
            declarations: Vec::new(),
            left_over: Vec::new(),
            searched: None,
            formula_refused: None,
            capture_next: vec![depthcal_io::DiagnosisCapture::Record {
                covariate: depthcal_io::DiagnosisCovariate::Time,
                effects: vec!["temporal_drift".to_owned()],
            }],
            frame_planes: Vec::new(),
            separability: None,
            held_out: depthcal_io::DiagnosisHeldOut { before: errors(Some(6.604)), after: errors(Some(5.512)) },
        }
    }

    #[test]
    fn the_text_has_numbers_for_people() {
        let expected = "\
1. added cyclic_depth (after the depth model, period 300 mm): 2.10 mm rms, p < 1e−16
   depth waves over distance (time-of-flight wiggling): keep the correction: no setting removes it
   acts after the depth model, added to depth; these captures cannot tell this from: before the depth model, as a factor of depth
     a             2.981 ± 0.012     mm
     b               0.5 fixed
   held-out frames: depth 6.60 → 5.51 mm rms, reprojection 0.123 → 0.123 px rms
   given all others, the error on left-out frames falls by 16.5 % (95 % interval 13.5 to 20.1 %)
   these captures cannot distinguish it from: disparity_ripple
   cameras of another technology have disparity_ripple instead: technology in [camera] of dataset.toml decides
   found together with: range_offset

effects tested given the last model:
                           p-value held-out gain estimated size detectable size
  board_bow                  0.300       −0.20 %      0.0100 mm    not testable
capture next: for temporal_drift: the frames have no times; record timestamp_s in frames.csv, from the moment when the camera is switched on

held-out frames, declared → last model: depth 6.60 → 5.51 mm rms, reprojection 0.123 → 0.123 px rms
effect: cyclic_depth was missing and was added; these captures show nothing else
";
        assert_eq!(diagnosis_text(&record(), &Register::builtin(), Detail::All), expected);
        let screen = diagnosis_text(&record(), &Register::builtin(), Detail::Screen);
        assert!(screen.lines().count() < 12 && !screen.contains("± 0.012"), "{screen}");
        assert!(
            screen.contains("1 effect tested given the last model; -v lists them")
                && screen.contains("keep the correction")
        );
        assert!(screen.ends_with("these captures show nothing else\n"), "the verdict is last: {screen}");
    }

    #[test]
    fn the_share_that_was_left_out_stands_beside_the_errors() {
        let mut d = record();
        let some = |share| Some(depthcal_io::Outliers { count: 4, share, limit_mm: 50.0 });
        (d.held_out.before.outliers, d.held_out.after.outliers) = (some(0.0004), some(0.0004));
        assert!(
            diagnosis_text(&d, &Register::builtin(), Detail::All)
                .contains("depth 6.60 → 5.51 mm rms, 0.04 % of the board left out, reprojection")
        );
        d.held_out.after.outliers = some(0.01);
        assert!(
            diagnosis_text(&d, &Register::builtin(), Detail::All)
                .contains("mm rms, 0.04 % → 1.00 % of the board left out, reprojection")
        );
    }

    /// A step that is a spline of six coefficients.
    fn with_smooth_function() -> CameraDiagnosis {
        let text = "[[effect]]\nname = \"found_r\"\nhook = \"depth\"\nformula = \"spline(r, r0, r1, c1, c2, c3, c4)\"\n\
                    parameters = { c1 = \"mm\", c2 = \"mm\", c3 = \"mm\", c4 = \"mm\" }\nconstants = { r0 = 0, r1 = 0.7 }\n\
                    smooth = [{ parameters = [\"c1\", \"c2\", \"c3\", \"c4\"], roughness = 0.5, deviation = 10 }]\n";
        let effect = depthcal_formula::FormulaFile::parse(text).unwrap().effects()[0].clone();
        let mut d = record();
        let step = &mut d.steps[0];
        (step.effects, step.indistinguishable, step.with) = (vec!["found_r".to_owned()], Vec::new(), effect.spec());
        let values = [("c1", -1.0), ("c2", 2.0), ("c3", 0.5), ("c4", 0.0)];
        let parameter = |(name, value): (&str, f64)| DiagnosisParameter {
            name: name.into(),
            value,
            unit: "mm".into(),
            std: Some(0.1),
        };
        step.parameters = values.map(parameter).to_vec();
        step.formula = Some(depthcal_io::DiagnosisFormula {
            expression: "spline(r, r0, r1, c1, c2, c3, c4)".to_owned(),
            covariates: vec!["r".to_owned()],
            covariates_not_told_apart: Vec::new(),
            place: DiagnosisPlace { of: Of::True, on: On::Depth },
            stability: 1.0,
            confirmed: false,
            resembles: Vec::new(),
            replication: None,
            share_of_free_function: 1.0,
            terms: 100,
            replaced: Vec::new(),
            runners_up: Vec::new(),
            components: Vec::new(),
            definition: effect.definition().clone(),
        });
        d.verdict = Verdict::Unexplained;
        d
    }

    #[test]
    fn a_smooth_function_is_a_correction_without_a_cause() {
        let mut d = with_smooth_function();
        let text = diagnosis_text(&d, &Register::builtin(), Detail::All);
        for expected in [
            "unexplained: found_r was missing and was added; nothing else is left, but the cause of a function is not known",
            "     c1 … c4: 4 coefficients of a spline, −1.00 to 2.00 mm\n",
            "z + spline(r, r₀, r₁, c₁, …, c₄): a smooth function of r, which no effect and no formula explains as well",
        ] {
            assert!(text.contains(expected), "{text}");
        }
        assert!(!text.contains("resampled captures"), "{text}");
        d.left_over.push(depthcal_io::DiagnosisLeftOver::FramePlanes { share_of_frames: 0.5, rms_mm: 1.0 });
        assert!(verdict_sentence(&d).ends_with("something is left that no known effect explains"));
    }

    #[test]
    fn every_verdict_has_a_sentence() {
        let mut d = record();
        let sentence = |d: &CameraDiagnosis, verdict| verdict_sentence(&CameraDiagnosis { verdict, ..d.clone() });
        assert!(
            sentence(&d, Verdict::Unexplained).starts_with("unexplained: cyclic_depth was missing and was added; ")
        );
        d.steps.push(d.steps[0].clone());
        assert!(sentence(&d, Verdict::Effect).contains("cyclic_depth and cyclic_depth were missing"));
        d.steps[1].gain_percent = Some(GainInterval { value: 1.0, low: -1.0, high: 3.0 });
        d.steps[1].effects = vec!["board_warp".to_owned()];
        let unsure = sentence(&d, Verdict::Effect);
        assert!(
            unsure.contains("cyclic_depth was missing and was added; added, but not certain: board_warp;"),
            "{unsure}"
        );
        d.steps.clear();
        assert_eq!(sentence(&d, Verdict::Unexplained), "unexplained: something is left that no known effect explains");
        assert!(sentence(&d, Verdict::Adequate).starts_with("adequate: "));
    }
}
