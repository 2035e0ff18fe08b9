//! The record of a diagnosis.

use depthcal_io::{
    DiagnosisCandidate, DiagnosisFile, DiagnosisFrame, DiagnosisFramePlane, DiagnosisHeldOut, DiagnosisParameter,
    DiagnosisRound, DiagnosisStep, FileReference,
};
use depthcal_model::Block;

use super::decision::Decision;
use super::evidence::{Evidence, Examination};
use super::frames::{BadFrame, FramePlane};
use super::{Diagnosis, Step};
use crate::calibrate::Calibrated;
use crate::observe::board_region::{BoardRegion, board_pixels};

/// Depth cameras are off by a few per cent, and print and focal scale add little: a scale beyond this is a declaration.
const PLAUSIBLE_SCALE: f64 = 0.08;

/// Declarations that cannot be right, in words: a square size or depth unit scales depth against the image as a whole, and
/// would hide in dw.
pub fn implausible_declarations(fit: &Calibrated) -> Vec<String> {
    let Some(scale) = depth_scale(fit) else { return Vec::new() };
    if (scale - 1.0).abs() <= PLAUSIBLE_SCALE {
        return Vec::new();
    }
    let percent = 100.0 * (scale - 1.0);
    vec![format!(
        "depth is {percent:+.1} % of what the board's declared size says ({scale:.4} times): no depth camera is that wrong. \
         Check spacing_mm under [board] (declared {:.3} mm; {:.3} mm would fit) and unit_mm under [depth] (declared {} mm; \
         {:.6} mm would fit). The scale is taken up by dw and is no effect",
        fit.capture.target.spacing_mm,
        fit.capture.target.spacing_mm * scale,
        fit.capture.depth_unit_mm.unwrap_or(1.0),
        fit.capture.depth_unit_mm.unwrap_or(1.0) / scale,
    )]
}

/// Median of measured depth over the depth at which the image sees the board; `None` without depth.
fn depth_scale(fit: &Calibrated) -> Option<f64> {
    let unit_mm = fit.capture.depth_unit_mm.unwrap_or(1.0);
    let region = BoardRegion::new(&fit.capture.target);
    let bare = fit.camera.filtered(|b| !crate::adjust::blocks::is_depth_only(b));
    let mut ratios: Vec<f64> = Vec::new();
    for frame in &fit.capture.frames {
        let pixels = board_pixels(frame, unit_mm, &bare, &region, &frame.camera_from_board, 7);
        ratios.extend(pixels.iter().map(|p| p.depth_mm / p.board_depth_mm));
    }
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied()
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// A candidate for the file.
pub fn candidate(evidence: &Evidence, cost: f64) -> DiagnosisCandidate {
    // From ½ Σ r² to its root mean square.
    let left = (1.0 - evidence.gain() / cost).max(0.0);
    DiagnosisCandidate {
        effect: evidence.name.clone(),
        p_value: evidence.p_value,
        expected_size_mm: finite(evidence.expected_size_mm),
        minimal_detectable_mm: finite(evidence.minimal_detectable_mm),
        held_out_gain_percent: 100.0 * (1.0 - left.sqrt()),
    }
}

/// The record of a round.
pub fn round(examination: &Examination, decision: &Decision) -> DiagnosisRound {
    let cost = examination.cost();
    let decision = match decision {
        Decision::Nothing => "nothing is left that these data show".to_owned(),
        Decision::Add { effect, beside_unexplained: true, explained, .. } => format!(
            "something is left of which named effects explain {:.0} % at most; {} holds beside every free function",
            100.0 * explained,
            examination.evidence[*effect].spec,
        ),
        Decision::Add { effect, beside, explained, of_planes, .. } => format!(
            "{}{} explains {:.0} % of what it and any free function explain, {:.2} times what planes of the frames' own do",
            examination.evidence[*effect].spec,
            if beside.is_empty() { String::new() } else { format!(" with {}", names(examination, beside).join(", ")) },
            100.0 * explained,
            of_planes.min(1e3)
        ),
        Decision::Unexplained { free, explained } => format!(
            "something is left along {}; named effects explain {:.0} % of it",
            examination.evidence[*free].along.map_or("", |a| a.words()),
            100.0 * explained
        ),
    };
    DiagnosisRound {
        effects: examination.effects().map(|e| candidate(e, cost)).collect(),
        free: examination.probes().map(|e| candidate(e, cost)).collect(),
        decision,
    }
}

/// Names of candidates.
pub fn names(examination: &Examination, places: &[usize]) -> Vec<String> {
    places.iter().map(|i| examination.evidence[*i].name.clone()).collect()
}

/// Adds to the last round why its effect was not added.
pub fn stopped(rounds: &mut [DiagnosisRound], why: &str) {
    if let Some(last) = rounds.last_mut() {
        last.decision = format!("{}; {why}", last.decision);
    }
}

/// The fitted block of a name; the pinhole where there is none.
pub fn fitted_block<'a>(fit: &'a Calibrated, name: &str) -> &'a Block {
    fit.camera.block(name).unwrap_or(&fit.camera.blocks()[0])
}

/// The fitted parameters of a block with their standard deviations.
pub fn fitted_parameters(fit: &Calibrated, name: &str) -> Vec<DiagnosisParameter> {
    let stds = fit.std_devs();
    let mut first = 0;
    for block in fit.camera.blocks() {
        if block.name() == name {
            let each = block.parameters().iter().zip(&block.theta).enumerate();
            return each
                .map(|(i, (p, value))| DiagnosisParameter {
                    name: p.name.to_string(),
                    value: *value,
                    unit: p.unit.to_string(),
                    std: stds[first + i],
                })
                .collect();
        }
        first += block.theta.len();
    }
    Vec::new()
}

/// What is left that no effect explains, in words.
pub fn left_over(unexplained: &Option<(Evidence, f64)>) -> Vec<String> {
    let Some((free, explained)) = unexplained else { return Vec::new() };
    let along = free.along.map_or("", |a| a.words());
    vec![format!(
        "a free function of {along} takes up {:.3} mm rms that no named effect explains (the best of them: {:.0} %)",
        free.expected_size_mm,
        100.0 * explained
    )]
}

/// Frames that deviate each by a plane of their own, in words.
pub fn own_planes(planes: &[FramePlane], share: f64) -> String {
    let rms = (planes.iter().map(|p| p.rms_mm * p.rms_mm).sum::<f64>() / planes.len().max(1) as f64).sqrt();
    format!(
        "{:.0} % of the frames deviate by a plane of their own, {rms:.2} mm rms over all frames: something changes from frame \
         to frame that no covariate describes",
        100.0 * share
    )
}

/// The diagnosis as `diagnosis.json` has it, but for [`super::separability`], which takes a linearisation of its own.
pub fn to_file(diagnosis: &Diagnosis, dataset: FileReference, model: &str) -> DiagnosisFile {
    let first = diagnosis.rounds.first();
    // The free map competes with the effects of the first round.
    let map = first.and_then(|r| r.free.iter().find(|f| f.effect.starts_with("map")));
    let map = map.map(|m| DiagnosisCandidate { effect: "free_map".to_owned(), ..m.clone() });
    let mut candidates: Vec<DiagnosisCandidate> = first.map(|r| r.effects.clone()).unwrap_or_default();
    candidates.extend(map);
    candidates.sort_by(|a, b| b.held_out_gain_percent.total_cmp(&a.held_out_gain_percent));
    let step = |s: &Step| DiagnosisStep {
        effects: s.effects.clone(),
        indistinguishable: s.indistinguishable.clone(),
        with: s.spec.clone(),
        parameters: s.parameters.clone(),
        size_mm: s.size_mm,
        p_value: s.p_value,
        before: s.before,
        after: s.after,
        depth_rms_after_mm: s.depth_rms_after_mm,
        depth_gain_percent: s.gain_percent,
    };
    let frame = |f: &BadFrame| DiagnosisFrame { name: f.name.clone(), reason: f.reason.clone() };
    let plane = |p: &FramePlane| DiagnosisFramePlane {
        name: p.name.clone(),
        offset_mm: p.offset_mm,
        rms_mm: p.rms_mm,
        p_value: p.p_value,
    };
    DiagnosisFile {
        dataset,
        model: model.to_owned(),
        verdict: diagnosis.verdict,
        steps: diagnosis.steps.iter().map(step).collect(),
        candidates,
        rounds: diagnosis.rounds.clone(),
        bad_frames: diagnosis.bad_frames.iter().map(frame).collect(),
        declarations: diagnosis.declarations.clone(),
        left_over: diagnosis.left_over.clone(),
        capture_next: diagnosis.capture_next.clone(),
        frame_planes: diagnosis.planes.iter().filter(|p| p.p_value.is_finite()).map(plane).collect(),
        separability: None,
        held_out: DiagnosisHeldOut { before: diagnosis.before.errors, after: diagnosis.after.errors },
    }
}
