//! Findings, decisions and proposals of a diagnosis in sentences, worded from their data in the record.

use std::fmt::Write;

use depthcal_io::{
    DiagnosisAddOutcome, DiagnosisCapture, DiagnosisCompetitor, DiagnosisCovariate, DiagnosisDecision,
    DiagnosisDeclaration, DiagnosisFrameCause, DiagnosisImage, DiagnosisLeftOver, DiagnosisPlace, DiagnosisPossible,
    DiagnosisProposedFrame, DiagnosisPureError, DiagnosisPureNoise, DiagnosisRefutation, DiagnosisRefuted,
    DiagnosisSearched, DiagnosisShared, DiagnosisStep, DiagnosisUnexplainedOutcome,
};
use depthcal_model::{Covariate, Of, On, PieceSpec, Register};

use crate::format::{count, interval, join, number, percent, quantity, signed};

/// Proposing more frames than this would be no remedy: nobody captures them.
const MOST_PROPOSED_FRAMES: u64 = 100;

/// The quantity that a free function depends on.
pub(crate) fn covariate(covariate: DiagnosisCovariate) -> &'static str {
    match covariate {
        DiagnosisCovariate::Pixel => "the position in the image",
        DiagnosisCovariate::Column => "the image column",
        DiagnosisCovariate::Row => "the image row",
        DiagnosisCovariate::Depth => "the distance",
        DiagnosisCovariate::RadiusAndDepth => "the distance from the image's centre and the depth together",
        DiagnosisCovariate::Amplitude => "the infrared amplitude",
        DiagnosisCovariate::Surroundings => "the infrared amplitude around the pixel",
        DiagnosisCovariate::StrayLight => "the infrared amplitude and the depth of the whole frame",
        DiagnosisCovariate::Incidence => "the angle of incidence",
        DiagnosisCovariate::Time => "the time",
        DiagnosisCovariate::Temperature => "the temperature",
        DiagnosisCovariate::Board => "the position on the board",
        DiagnosisCovariate::Quantity(quantity) => quantity.name(),
    }
}

/// A share in per cent; at most 100 is meant, more says "all of it".
fn share(share: f64) -> String {
    percent(100.0 * share)
}

/// The decision of a round and its outcome, without full stop.
pub(crate) fn decision(decision: &DiagnosisDecision, register: &Register) -> String {
    match decision {
        DiagnosisDecision::Nothing => "these captures show nothing that the model lacks".to_owned(),
        DiagnosisDecision::Add {
            spec, with, explained_share, of_frame_planes, despite_unexplained, outcome, ..
        } => {
            let effect = register.words(spec);
            let finding = if *despite_unexplained {
                format!(
                    "named effects explain {} of what is left, not most of it; {effect} retains its gain jointly with every \
                     free function",
                    share(*explained_share)
                )
            } else {
                let with = if with.is_empty() { String::new() } else { format!(" jointly with {}", join(with)) };
                let planes = of_frame_planes
                    .map(|ratio| format!(", {} times what a plane of its own in every frame explains", number(ratio)))
                    .unwrap_or_default();
                format!("{effect}{with} explains {} of what can be explained{planes}", share(*explained_share))
            };
            format!("{finding}; {}", added(outcome, register))
        }
        DiagnosisDecision::Explained { effects, taken_out } => {
            let outcome = DiagnosisAddOutcome::Added { effects: effects.clone(), taken_out: taken_out.clone() };
            format!("functions of what the errors depend on, found together; {}", added(&outcome, register))
        }
        DiagnosisDecision::Unexplained { along, explained_share, competitor, outcome } => {
            let reference = match competitor {
                DiagnosisCompetitor::FreeFunction => "",
                DiagnosisCompetitor::FramePlanes => " of what a plane of its own in every frame explains",
            };
            format!(
                "errors depend on {} in a way that no known effect has (the best explain {}{reference}); {}",
                covariate(*along),
                share(*explained_share),
                unexplained(outcome, register)
            )
        }
    }
}

/// An effect that a decision disregards, without full stop.
pub(crate) fn refuted(refuted: &DiagnosisRefuted) -> String {
    let why = match &refuted.because {
        DiagnosisRefutation::OwnFunction { along, explained_share } => format!(
            "explains only {} of what it and a free function of {} explain together",
            share(*explained_share),
            covariate(*along)
        ),
        DiagnosisRefutation::NotInImages => "is an effect of the lens that the images alone do not show".to_owned(),
    };
    format!("not considered: {}, which {why}", refuted.effect)
}

fn added(outcome: &DiagnosisAddOutcome, register: &Register) -> String {
    let list = |specs: &[PieceSpec]| join(&specs.iter().map(|s| register.words(s)).collect::<Vec<_>>());
    match outcome {
        DiagnosisAddOutcome::Added { effects, taken_out } if taken_out.is_empty() => {
            format!("added: {}", list(effects))
        }
        DiagnosisAddOutcome::Added { effects, taken_out } => {
            format!("added: {}; removed, because no longer needed: {}", list(effects), list(taken_out))
        }
        DiagnosisAddOutcome::NoHeldOutGain => "not added, because held-out errors do not fall with it".to_owned(),
        DiagnosisAddOutcome::TooSmall { share_of_cost, least_share } => format!(
            "not tried, because it is too small: {} of the squared residuals, less than {}",
            share(*share_of_cost),
            share(*least_share)
        ),
        DiagnosisAddOutcome::NotFitted { error } => format!("not added, because it cannot be fitted: {error}"),
        DiagnosisAddOutcome::RoundLimit { rounds } => {
            format!("not tried, because this was the last of {}", count(*rounds, "round"))
        }
        DiagnosisAddOutcome::RejectionLimit { rejected } => {
            format!("not tried, because {} before it lowered no held-out error", count(*rejected, "effect"))
        }
    }
}

fn unexplained(outcome: &DiagnosisUnexplainedOutcome, register: &Register) -> String {
    match outcome {
        DiagnosisUnexplainedOutcome::Reported => "nothing is added".to_owned(),
        DiagnosisUnexplainedOutcome::TakenOut { effects } => format!(
            "removed, because they are effects of the lens that the images alone do not show: {}",
            join(&effects.iter().map(|s| register.words(s)).collect::<Vec<_>>())
        ),
        DiagnosisUnexplainedOutcome::FreeMapAdded { spec } => format!("corrected by a map: {}", register.words(spec)),
        DiagnosisUnexplainedOutcome::TooSmall { share_of_cost, least_share } => format!(
            "too small to report: {} of the squared residuals, less than {}",
            share(*share_of_cost),
            share(*least_share)
        ),
    }
}

/// A pattern that the last model leaves, without full stop.
pub(crate) fn left_over(left: &DiagnosisLeftOver) -> String {
    match left {
        DiagnosisLeftOver::FreeFunction { along, rms_mm, explained_share } => {
            let size = rms_mm.map_or_else(String::new, |rms| format!(" of {} rms", quantity(rms, "mm")));
            format!(
                "a function of {}{size} that no known effect explains (the best of them: {})",
                covariate(*along),
                share(*explained_share)
            )
        }
        DiagnosisLeftOver::Together { covariates, share_of_cost } => format!(
            "a function of {} together that no known effect and no formula explains: {} of the squared residuals",
            covariates.join(" and "),
            share(*share_of_cost)
        ),
        DiagnosisLeftOver::FramePlanes { share_of_frames, rms_mm } => format!(
            "{} of the frames deviate each by a plane of its own, {} rms over all frames: something changes from frame to \
             frame that no recorded quantity describes",
            share(*share_of_frames),
            quantity(*rms_mm, "mm")
        ),
        DiagnosisLeftOver::Shared(found) => {
            format!("{}, which no free function that was tried has", shared(found))
        }
    }
}

/// The functions that were searched in what is left, without full stop.
pub(crate) fn searched(searched: &DiagnosisSearched) -> String {
    let pairs: Vec<String> = searched.functions_of_pairs.iter().map(|[a, b]| format!("{a} and {b}")).collect();
    let n = searched.functions_of.len();
    let pairs = match pairs.len() {
        0 => String::new(),
        // Radius is a function of x and y.
        all if all + 2 >= n * n.saturating_sub(1) / 2 => "; functions of any two of these".to_owned(),
        _ => format!("; functions of {}", pairs.join(", of ")),
    };
    let times = match &searched.times[..] {
        [] => String::new(),
        times => format!(", and times {}", times.join(", ")),
    };
    let unknown = match &searched.unknown[..] {
        [] => String::new(),
        unknown => format!("; not recorded, or constant: {}", unknown.join(", ")),
    };
    format!(
        "smooth functions of {}, singly and two at a time{times}{pairs}: none more lowers the error on left-out frames for \
         certain{unknown}",
        searched.functions_of.join(", ")
    )
}

/// Residuals that frames share, without full stop.
pub(crate) fn shared(found: &DiagnosisShared) -> String {
    let along: Vec<&str> = found.along.iter().map(|a| covariate(*a)).collect();
    let unit = match found.along.first() {
        Some(DiagnosisCovariate::Pixel | DiagnosisCovariate::Column | DiagnosisCovariate::Row) => "px",
        Some(DiagnosisCovariate::Board | DiagnosisCovariate::Depth) => "mm",
        _ => "1",
    };
    let scale = found.scale.map_or_else(String::new, |scale| match unit {
        "1" => String::new(),
        unit => format!(", finest at a scale of {}", quantity(scale, unit)),
    });
    format!(
        "residuals that different frames share at the same value of {}, {} rms{scale}",
        along.join(" and "),
        quantity(found.rms_mm, "mm")
    )
}

/// The residual beside the pure error, without full stop.
pub(crate) fn pure_error(error: &DiagnosisPureError) -> String {
    format!(
        "left over {} rms, pure error {} rms (ratio {}): pure error is what different frames do not share at the same value of \
         a covariate",
        quantity(error.residual_rms_mm, "mm"),
        quantity(error.pure_error_mm, "mm"),
        number(error.ratio)
    ) + &error.noise.as_ref().map_or_else(String::new, |noise| format!("; {}", pure_noise(noise)))
}

/// The noise of single pixels that the pure error has, without full stop.
pub(crate) fn pure_noise(noise: &DiagnosisPureNoise) -> String {
    let sizes =
        noise.at.iter().map(|d| format!("{} at {}", quantity(d.std_mm, "mm"), quantity(1e-3 * d.depth_mm, "m")));
    let sizes: Vec<String> = sizes.collect();
    let correlation = noise
        .correlation_length_px
        .map_or_else(String::new, |px| format!(", pixels {px} px apart are nearly uncorrelated"));
    format!("of single pixels it is {}{correlation}", join(&sizes))
}

/// An effect that is not certain, without full stop.
pub(crate) fn possible(found: &DiagnosisPossible, register: &Register) -> String {
    let gain = &found.gain_percent;
    let why = match found.further_frames {
        Some(1) => "1 further frame like these would settle it".to_owned(),
        Some(n) => format!("{n} further frames like these would settle it"),
        None => "an error that users read would rise".to_owned(),
    };
    format!(
        "{}: the weighted error of left-out frames falls by {} (95 % interval {}); {why}",
        register.words(&found.with),
        percent(gain.value),
        interval(gain.low, gain.high, "%")
    )
}

/// An implausible declaration, with full stop inside but not at the end.
pub(crate) fn declaration(declaration: &DiagnosisDeclaration) -> String {
    let DiagnosisDeclaration::DepthScale { scale, spacing_mm, unit_mm } = declaration;
    format!(
        "measured depth is {} times the depth that the board's declared size implies ({} %), more than any depth camera is off. \
         Check spacing_mm under [board] (declared {}, {} would fit) and unit_mm under [depth] (declared {}, {} would fit). The \
         parameter dw of D takes up this scale; it is not an effect",
        number(*scale),
        signed(100.0 * (scale - 1.0)),
        quantity(spacing_mm.declared, "mm"),
        quantity(spacing_mm.fitting, "mm"),
        quantity(unit_mm.declared, "mm"),
        quantity(unit_mm.fitting, "mm"),
    )
}

/// Why a frame was left out, without full stop.
pub(crate) fn frame_cause(cause: &DiagnosisFrameCause) -> String {
    match cause {
        DiagnosisFrameCause::Duplicate { of, image } => {
            let image = match image {
                DiagnosisImage::Image => "image",
                DiagnosisImage::Depth => "depth image",
            };
            format!("its {image} is that of {of}: the frame is stored twice")
        }
        DiagnosisFrameCause::ExchangedDepth { with } => {
            format!("its depth image fits the pose of {with}: the two depth images seem to be exchanged")
        }
        DiagnosisFrameCause::Moved { offset_mm, rms_mm } => format!(
            "its depth deviates from its image by a plane ({} mm on average, {} rms): the board or the camera seems to have \
             moved between the two",
            signed(*offset_mm),
            quantity(*rms_mm, "mm")
        ),
    }
}

/// A capture that would answer an open question, without full stop.
pub(crate) fn capture(capture: &DiagnosisCapture) -> String {
    match capture {
        DiagnosisCapture::TellApart { effect, rival, frame, frames, .. } => {
            let how_many = if *frames > MOST_PROPOSED_FRAMES {
                "even many such frames would hardly do".to_owned()
            } else {
                format!("about {} would do", count(*frames as usize, "such frame"))
            };
            format!("to distinguish {effect} from {rival}: {}; {how_many}", proposed_frame(frame))
        }
        DiagnosisCapture::Record { covariate: missing, effects } => match recorded(*missing) {
            Some(c) => format!("for {}: {}; {}", join(effects), c.missing(), c.how_to_record()),
            None => format!("for {}: vary {}", join(effects), covariate(*missing)),
        },
    }
}

/// The covariate of the model that has to be recorded with the frames.
fn recorded(covariate: DiagnosisCovariate) -> Option<Covariate> {
    match covariate {
        DiagnosisCovariate::Amplitude => Some(Covariate::Amplitude),
        DiagnosisCovariate::Surroundings => Some(Covariate::Surroundings),
        DiagnosisCovariate::StrayLight => Some(Covariate::StrayLight),
        DiagnosisCovariate::Time => Some(Covariate::Time),
        DiagnosisCovariate::Temperature => Some(Covariate::Temperature),
        DiagnosisCovariate::Quantity(quantity) => Some(Covariate::Quantity(quantity)),
        _ => None,
    }
}

fn proposed_frame(frame: &DiagnosisProposedFrame) -> String {
    let third = |x: f64| (x * 3.0).floor().clamp(0.0, 2.0) as usize;
    let [u, v] = frame.image_position.map(third);
    let place = match (["left", "", "right"][u], ["upper", "", "lower"][v]) {
        ("", "") => "in the middle of the image".to_owned(),
        ("", vertical) => format!("in the {vertical} part of the image"),
        (side, "") => format!("at the {side} edge of the image"),
        (side, vertical) => format!("in the {vertical} {side} corner of the image"),
    };
    let tilt = match frame.turned_deg {
        [0.0, 0.0] => "parallel to the image plane".to_owned(),
        [0.0, y] => format!("turned by {}° about the vertical", number(y)),
        [x, 0.0] => format!("turned by {}° about the horizontal", number(x)),
        [x, y] => format!("turned by {}° about the horizontal and {}° about the vertical", number(x), number(y)),
    };
    let warmer = frame.warmer_c.map_or_else(String::new, |c| {
        format!(", with the camera {} warmer than in the warmest frame", quantity(c, "°C"))
    });
    format!("a frame with the board {} away, {place}, {tilt}{warmer}", quantity(frame.distance_mm / 1000.0, "m"))
}

/// Where and how an effect of depth acts, with the places and forms that the captures cannot tell from it; `None` for other
/// effects.
pub fn place(step: &DiagnosisStep) -> Option<String> {
    let words = |p: &DiagnosisPlace| format!("{}, {}", p.of.words(), p.on.words());
    let mut text = format!("acts {}", words(step.place.as_ref()?));
    let others: Vec<String> = step.places_not_told_apart.iter().map(words).collect();
    let _ = match others.len() {
        0 => Ok(()),
        n if n + 1 == Of::ALL.len() * On::ALL.len() => {
            write!(text, ", as far as these captures tell: any other place and form explains them as well")
        }
        _ => write!(text, "; these captures cannot tell this from: {}", others.join("; ")),
    };
    Some(text)
}

/// The rivals of a step that only cameras of another technology have; `None` where there are none.
pub fn rivals_of_other_technologies(step: &DiagnosisStep) -> Option<String> {
    let rivals = &step.of_other_technologies;
    (!rivals.is_empty()).then(|| {
        format!(
            "cameras of another technology have {} instead: technology in [camera] of dataset.toml decides",
            join(rivals)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decisions_are_worded_with_their_outcome() {
        let add = |outcome| DiagnosisDecision::Add {
            effect: "cyclic_depth".into(),
            spec: "cyclic_depth@period_mm=299.90356313997415".parse().unwrap(),
            with: vec!["radial_range".into()],
            explained_share: 0.9712,
            of_frame_planes: Some(3.214),
            despite_unexplained: false,
            outcome,
        };
        assert_eq!(
            decision(&add(DiagnosisAddOutcome::NoHeldOutGain), &Register::builtin()),
            "cyclic_depth (period 300 mm) jointly with radial_range explains 97.1 % of what can be explained, 3.21 times what a \
             plane of its own in every frame explains; not added, because held-out errors do not fall with it"
        );
        let added = DiagnosisAddOutcome::Added {
            effects: vec![PieceSpec::new("board_bow")],
            taken_out: vec![PieceSpec::new("thin_prism")],
        };
        assert!(
            decision(&add(added), &Register::builtin())
                .ends_with("added: board_bow; removed, because no longer needed: thin_prism")
        );
    }

    #[test]
    fn proposals_say_where_and_how_many() {
        let frame = DiagnosisProposedFrame {
            distance_mm: 1500.0,
            image_position: [0.2, 0.2],
            turned_deg: [0.0, 45.0],
            warmer_c: Some(10.0),
        };
        let ask = |frames| DiagnosisCapture::TellApart {
            effect: "a".into(),
            rival: "b".into(),
            frame,
            frames,
            noncentrality: 1.0,
            noncentrality_with_frame: 2.0,
            noncentrality_needed: 11.7,
        };
        assert_eq!(
            capture(&ask(3)),
            "to distinguish a from b: a frame with the board 1.50 m away, in the upper left corner of the image, turned by 45.0° \
             about the vertical, with the camera 10.0 °C warmer than in the warmest frame; about 3 such frames would do"
        );
        assert!(capture(&ask(1000)).ends_with("even many such frames would hardly do"));
        let record =
            DiagnosisCapture::Record { covariate: DiagnosisCovariate::Time, effects: vec!["temporal_drift".into()] };
        assert!(capture(&record).starts_with("for temporal_drift: the frames have no times; record timestamp_s"));
    }
}
