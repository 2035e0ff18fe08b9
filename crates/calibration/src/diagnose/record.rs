//! The record of a diagnosis: `diagnosis.json`.

use depthcal_io::{
    CameraDiagnosis as CameraRecord, DiagnosisAddOutcome, DiagnosisCandidate, DiagnosisCapture, DiagnosisCompetitor,
    DiagnosisCovariate, DiagnosisDecision, DiagnosisExchange, DiagnosisFormula, DiagnosisFrame, DiagnosisFrameCause,
    DiagnosisFramePlane, DiagnosisHeldOut, DiagnosisImage, DiagnosisLeftOver, DiagnosisPossible,
    DiagnosisProposedFrame, DiagnosisPureError, DiagnosisPureNoise, DiagnosisRefutation, DiagnosisRefuted,
    DiagnosisReplication, DiagnosisRound, DiagnosisRunnerUp, DiagnosisShared, DiagnosisStep,
    DiagnosisUnexplainedOutcome, FileReference,
};
use depthcal_model::{Covariate, ModelSpec};

use super::bad_frames::{BadFrame, BadFrameReason};
use super::decision::{Competitor, Decision};
use super::diagnosis::CameraDiagnosis;
use super::discovery::RunnerUp;
use super::evidence::Evidence;
use super::experiment_design::CaptureProposal;
use super::frame_planes::FramePlane;
use super::free_functions::Along;
use super::free_map::FREE_MAP;
use super::left_over::LeftOver;
use super::possible::Possible;
use super::pure_error::{PureError, Shared};
use super::pure_noise::PureNoise;
use super::round::{Refutation, Refuted, Round, RoundOutcome};
use super::step::Step;
use crate::calibrate::ImplausibleScale;
use crate::plan::ProposedFrame;

/// Caps the ratio where the frames' planes are near zero.
const LARGEST_RATIO: f64 = 1e3;

/// The record of a diagnosis of a dataset that was fitted with `model`. Its separability is left empty:
/// [`super::separability::separability`] takes a linearisation of its own.
pub fn to_file(diagnosis: &CameraDiagnosis, dataset: FileReference, model: ModelSpec) -> CameraRecord {
    let rounds: Vec<DiagnosisRound> = diagnosis.rounds.iter().map(round).collect();
    CameraRecord {
        dataset,
        model,
        verdict: diagnosis.verdict,
        steps: diagnosis.steps.iter().map(|s| DiagnosisStep { formula: formula(diagnosis, s), ..step(s) }).collect(),
        possible: diagnosis.possible.iter().map(possible).collect(),
        pure_error: diagnosis.pure_error.as_ref().map(pure_error),
        candidates: first_candidates(rounds.first()),
        rounds,
        bad_frames: diagnosis.bad_frames.iter().map(bad_frame).collect(),
        declarations: diagnosis.declarations.iter().map(ImplausibleScale::record).collect(),
        left_over: diagnosis.left_over.iter().map(left_over).collect(),
        searched: diagnosis.searched.clone(),
        formula_refused: diagnosis.formula_refused.clone(),
        capture_next: diagnosis.capture_next.iter().map(capture).collect(),
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
        along: evidence.along.map(along),
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
        refuted: round.refuted.iter().map(|r| refuted(round, r)).collect(),
        decision: decision(round),
    }
}

fn refuted(round: &Round, refuted: &Refuted) -> DiagnosisRefuted {
    DiagnosisRefuted {
        effect: round.evidence[refuted.effect].name.clone(),
        because: match refuted.because {
            Refutation::OwnFunction { along: a, explained } => {
                DiagnosisRefutation::OwnFunction { along: along(a), explained_share: explained }
            }
            Refutation::NotInImages => DiagnosisRefutation::NotInImages,
        },
    }
}

/// The effects of the first round and the free map, by falling gain.
fn first_candidates(first: Option<&DiagnosisRound>) -> Vec<DiagnosisCandidate> {
    let map = first.and_then(|r| r.free.iter().find(|f| f.along == Some(DiagnosisCovariate::Pixel)));
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
        of_other_technologies: step.of_other_technologies.clone(),
        with: step.spec.clone(),
        place: step.place,
        places_not_told_apart: step.places_not_told_apart.clone(),
        parameters: step.parameters.clone(),
        size_mm: step.size_mm,
        p_value: step.p_value,
        before: step.before,
        after: step.after,
        depth_rms_after_mm: step.depth_rms_after_mm,
        depth_gain_percent: step.depth_gain_percent,
        gain_percent: step.gain_percent,
        formula: None,
    }
}

/// Evidence for a step that is a formula; `None` for other steps.
fn formula(diagnosis: &CameraDiagnosis, step: &Step) -> Option<DiagnosisFormula> {
    let discovery = diagnosis.formulas.iter().find(|formula| formula.effect.name() == step.spec.name)?;
    let definition = discovery.effect.definition();
    let runner_up = |r: &RunnerUp| DiagnosisRunnerUp {
        expression: r.effect.definition().formula.texts().join("; "),
        covariates: r.covariates.clone(),
        gain_share: r.gain_share,
    };
    Some(DiagnosisFormula {
        expression: definition.formula.texts().join("; "),
        covariates: discovery.covariates.clone(),
        covariates_not_told_apart: discovery.covariates_not_told_apart.iter().map(exchange).collect(),
        place: discovery.place,
        stability: discovery.stability,
        confirmed: discovery.confirmed,
        resembles: discovery.resembles.clone(),
        replication: discovery.replication.map(|[size, standard_error]| DiagnosisReplication { size, standard_error }),
        share_of_free_function: discovery.share_of_free_function,
        terms: discovery.terms,
        replaced: discovery.replaced.iter().map(ToString::to_string).collect(),
        runners_up: discovery.runners_up.iter().map(runner_up).collect(),
        components: discovery.components.clone(),
        definition: definition.clone(),
    })
}

fn exchange([covariate, instead]: &[String; 2]) -> DiagnosisExchange {
    DiagnosisExchange { covariate: covariate.clone(), instead: instead.clone() }
}

fn decision(round: &Round) -> DiagnosisDecision {
    if let Some(RoundOutcome::Explained { effects, removed }) = &round.outcome {
        return DiagnosisDecision::Explained { effects: effects.clone(), taken_out: removed.clone() };
    }
    match &round.decision {
        Decision::Nothing => DiagnosisDecision::Nothing,
        Decision::Add { effect, jointly_with, explained, of_planes, leaves_unexplained, .. } => {
            let evidence = &round.evidence[*effect];
            DiagnosisDecision::Add {
                effect: evidence.name.clone(),
                spec: evidence.spec.clone(),
                with: round.names(jointly_with),
                explained_share: *explained,
                of_frame_planes: (*of_planes < LARGEST_RATIO).then_some(*of_planes),
                despite_unexplained: *leaves_unexplained,
                outcome: match &round.outcome {
                    Some(RoundOutcome::Added { effects, removed }) => {
                        DiagnosisAddOutcome::Added { effects: effects.clone(), taken_out: removed.clone() }
                    }
                    Some(RoundOutcome::Negligible { share_of_cost, least_share }) => {
                        DiagnosisAddOutcome::TooSmall { share_of_cost: *share_of_cost, least_share: *least_share }
                    }
                    Some(RoundOutcome::NotFitted { error }) => DiagnosisAddOutcome::NotFitted { error: error.clone() },
                    Some(RoundOutcome::RoundLimit { rounds }) => DiagnosisAddOutcome::RoundLimit { rounds: *rounds },
                    Some(RoundOutcome::RejectionLimit { rejected }) => {
                        DiagnosisAddOutcome::RejectionLimit { rejected: *rejected }
                    }
                    _ => DiagnosisAddOutcome::NoHeldOutGain,
                },
            }
        }
        Decision::Unexplained { free, explained, competitor } => DiagnosisDecision::Unexplained {
            along: round.evidence[*free].along.map_or(DiagnosisCovariate::Pixel, along),
            explained_share: *explained,
            competitor: match competitor {
                Competitor::FreeFunction => DiagnosisCompetitor::FreeFunction,
                Competitor::FramePlanes => DiagnosisCompetitor::FramePlanes,
            },
            outcome: match &round.outcome {
                Some(RoundOutcome::TakenOut { effects }) => {
                    DiagnosisUnexplainedOutcome::TakenOut { effects: effects.clone() }
                }
                Some(RoundOutcome::FreeMapAdded { map }) => {
                    DiagnosisUnexplainedOutcome::FreeMapAdded { spec: map.clone() }
                }
                Some(RoundOutcome::Negligible { share_of_cost, least_share }) => {
                    DiagnosisUnexplainedOutcome::TooSmall { share_of_cost: *share_of_cost, least_share: *least_share }
                }
                _ => DiagnosisUnexplainedOutcome::Reported,
            },
        },
    }
}

fn along(along: Along) -> DiagnosisCovariate {
    match along {
        Along::Pixel => DiagnosisCovariate::Pixel,
        Along::Column => DiagnosisCovariate::Column,
        Along::Row => DiagnosisCovariate::Row,
        Along::Depth => DiagnosisCovariate::Depth,
        Along::RadiusAndDepth => DiagnosisCovariate::RadiusAndDepth,
        Along::Amplitude => DiagnosisCovariate::Amplitude,
        Along::Incidence => DiagnosisCovariate::Incidence,
        Along::Time => DiagnosisCovariate::Time,
        Along::Temperature => DiagnosisCovariate::Temperature,
        Along::Board => DiagnosisCovariate::Board,
        Along::Quantity(quantity) => DiagnosisCovariate::Quantity(quantity),
    }
}

fn covariate(covariate: Covariate) -> DiagnosisCovariate {
    match covariate {
        Covariate::Depth | Covariate::InverseDepth => DiagnosisCovariate::Depth,
        Covariate::Incidence => DiagnosisCovariate::Incidence,
        Covariate::Temperature => DiagnosisCovariate::Temperature,
        Covariate::Time => DiagnosisCovariate::Time,
        Covariate::Amplitude => DiagnosisCovariate::Amplitude,
        Covariate::Surroundings => DiagnosisCovariate::Surroundings,
        Covariate::StrayLight => DiagnosisCovariate::StrayLight,
        Covariate::Quantity(quantity) => DiagnosisCovariate::Quantity(quantity),
    }
}

fn left_over(left: &LeftOver) -> DiagnosisLeftOver {
    match left {
        LeftOver::FreeFunction { along: a, size_mm, explained } => {
            DiagnosisLeftOver::FreeFunction { along: along(*a), rms_mm: finite(*size_mm), explained_share: *explained }
        }
        LeftOver::Together { covariates, share_of_cost } => {
            DiagnosisLeftOver::Together { covariates: covariates.clone(), share_of_cost: *share_of_cost }
        }
        LeftOver::FramePlanes { share, rms_mm } => {
            DiagnosisLeftOver::FramePlanes { share_of_frames: *share, rms_mm: *rms_mm }
        }
        LeftOver::Shared(found) => DiagnosisLeftOver::Shared(shared(found)),
    }
}

fn shared(found: &Shared) -> DiagnosisShared {
    DiagnosisShared {
        along: found.along.iter().map(|a| along(*a)).collect(),
        scale: (found.scale > 0.0).then_some(found.scale),
        rms_mm: found.size_mm,
        z: found.z,
        p_value: found.p_value,
    }
}

fn pure_error(found: &PureError) -> DiagnosisPureError {
    DiagnosisPureError {
        residual_rms_mm: found.residual_mm,
        pure_error_mm: found.pure_mm,
        ratio: found.ratio(),
        shared: found.shared.iter().map(shared).collect(),
        noise: found.noise.as_ref().map(pure_noise),
    }
}

fn pure_noise(found: &PureNoise) -> DiagnosisPureNoise {
    DiagnosisPureNoise {
        a_per_mm: found.law.a_per_mm,
        b_mm: found.law.b_mm,
        at: found.at.to_vec(),
        correlation_length_px: found.correlation_px,
    }
}

fn possible(found: &Possible) -> DiagnosisPossible {
    DiagnosisPossible {
        effect: found.spec.name.clone(),
        with: found.spec.clone(),
        gain_percent: found.gain_percent,
        further_frames: found.further_frames,
    }
}

fn bad_frame(frame: &BadFrame) -> DiagnosisFrame {
    let cause = match &frame.reason {
        BadFrameReason::DepthExchanged { with } => DiagnosisFrameCause::ExchangedDepth { with: with.clone() },
        BadFrameReason::Moved { offset_mm, rms_mm } => {
            DiagnosisFrameCause::Moved { offset_mm: *offset_mm, rms_mm: *rms_mm }
        }
        BadFrameReason::SameImage { of } => {
            DiagnosisFrameCause::Duplicate { of: of.clone(), image: DiagnosisImage::Image }
        }
        BadFrameReason::SameDepthImage { of } => {
            DiagnosisFrameCause::Duplicate { of: of.clone(), image: DiagnosisImage::Depth }
        }
    };
    DiagnosisFrame { name: frame.name.clone(), cause }
}

fn capture(proposal: &CaptureProposal) -> DiagnosisCapture {
    match proposal {
        CaptureProposal::Distinguish {
            effect,
            rival,
            frame,
            frames,
            noncentrality,
            noncentrality_with_frame,
            sufficient_noncentrality,
        } => DiagnosisCapture::TellApart {
            effect: effect.clone(),
            rival: rival.clone(),
            frame: proposed_frame(frame),
            frames: *frames as u64,
            noncentrality: *noncentrality,
            noncentrality_with_frame: *noncentrality_with_frame,
            noncentrality_needed: *sufficient_noncentrality,
        },
        CaptureProposal::Record { covariate: c, effects } => {
            DiagnosisCapture::Record { covariate: covariate(*c), effects: effects.clone() }
        }
    }
}

fn proposed_frame(frame: &ProposedFrame) -> DiagnosisProposedFrame {
    DiagnosisProposedFrame {
        distance_mm: frame.distance_mm,
        image_position: frame.place.position(),
        turned_deg: frame.tilt.angles_deg(),
        warmer_c: frame.warmer_c,
    }
}

fn frame_plane(plane: &FramePlane) -> DiagnosisFramePlane {
    DiagnosisFramePlane {
        name: plane.name.clone(),
        offset_mm: plane.offset_mm,
        rms_mm: plane.rms_mm,
        p_value: plane.p_value,
    }
}
