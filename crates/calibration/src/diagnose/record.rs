//! The record of a diagnosis: `diagnosis.json`.

use depthcal_io::{
    DiagnosisCandidate, DiagnosisFile, DiagnosisFrame, DiagnosisFramePlane, DiagnosisHeldOut, DiagnosisRound,
    DiagnosisStep, FileReference,
};

use super::bad_frames::BadFrame;
use super::diagnosis::Diagnosis;
use super::evidence::Evidence;
use super::frame_planes::FramePlane;
use super::free_map::FREE_MAP;
use super::round::Round;
use super::step::Step;

/// The record of a diagnosis of a dataset that was fitted with `model`. Its separability is left empty:
/// [`super::separability::separability`] takes a linearisation of its own.
pub fn to_file(diagnosis: &Diagnosis, dataset: FileReference, model: &str) -> DiagnosisFile {
    let rounds: Vec<DiagnosisRound> = diagnosis.rounds.iter().map(round).collect();
    DiagnosisFile {
        dataset,
        model: model.to_owned(),
        verdict: diagnosis.verdict,
        steps: diagnosis.steps.iter().map(step).collect(),
        candidates: first_candidates(rounds.first()),
        rounds,
        bad_frames: diagnosis.bad_frames.iter().map(bad_frame).collect(),
        declarations: diagnosis.declarations.iter().map(ToString::to_string).collect(),
        left_over: diagnosis.left_over.iter().map(ToString::to_string).collect(),
        capture_next: diagnosis.capture_next.iter().map(ToString::to_string).collect(),
        frame_planes: diagnosis.planes.iter().filter(|p| p.p_value.is_finite()).map(frame_plane).collect(),
        separability: None,
        held_out: DiagnosisHeldOut { before: diagnosis.before.errors, after: diagnosis.after.errors },
    }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// The record of a candidate in residuals with the cost ½ Σ r².
pub(super) fn candidate(evidence: &Evidence, cost: f64) -> DiagnosisCandidate {
    // The gain is a fall of ½ Σ r², its record one of the root mean square.
    let left = (1.0 - evidence.gain() / cost).max(0.0);
    DiagnosisCandidate {
        effect: evidence.name.clone(),
        p_value: evidence.p_value,
        expected_size_mm: finite(evidence.expected_size_mm),
        minimal_detectable_mm: finite(evidence.minimal_detectable_mm),
        held_out_gain_percent: 100.0 * (1.0 - left.sqrt()),
    }
}

fn round(round: &Round) -> DiagnosisRound {
    DiagnosisRound {
        effects: round.effects().map(|e| candidate(e, round.cost)).collect(),
        free: round.free_functions().map(|e| candidate(e, round.cost)).collect(),
        decision: round.to_string(),
    }
}

/// The effects of the first round and the free map, by falling gain.
fn first_candidates(first: Option<&DiagnosisRound>) -> Vec<DiagnosisCandidate> {
    let map = first.and_then(|r| r.free.iter().find(|f| f.effect.starts_with("map")));
    let map = map.map(|m| DiagnosisCandidate { effect: FREE_MAP.to_owned(), ..m.clone() });
    let mut candidates: Vec<DiagnosisCandidate> = first.map(|r| r.effects.clone()).unwrap_or_default();
    candidates.extend(map);
    candidates.sort_by(|a, b| b.held_out_gain_percent.total_cmp(&a.held_out_gain_percent));
    candidates
}

fn step(step: &Step) -> DiagnosisStep {
    DiagnosisStep {
        effects: step.effects.clone(),
        indistinguishable: step.indistinguishable.clone(),
        with: step.spec.to_string(),
        parameters: step.parameters.clone(),
        size_mm: step.size_mm,
        p_value: step.p_value,
        before: step.before,
        after: step.after,
        depth_rms_after_mm: step.depth_rms_after_mm,
        depth_gain_percent: step.gain_percent,
    }
}

fn bad_frame(frame: &BadFrame) -> DiagnosisFrame {
    DiagnosisFrame { name: frame.name.clone(), reason: frame.reason.to_string() }
}

fn frame_plane(plane: &FramePlane) -> DiagnosisFramePlane {
    DiagnosisFramePlane {
        name: plane.name.clone(),
        offset_mm: plane.offset_mm,
        rms_mm: plane.rms_mm,
        p_value: plane.p_value,
    }
}
