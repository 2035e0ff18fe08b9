//! The wording of findings, decisions and proposals for the record and for terminals. No other file of the diagnosis words them.

use std::fmt::{Display, Formatter, Result};

use super::bad_frames::BadFrameReason;
use super::decision::Decision;
use super::declarations::ImplausibleScale;
use super::experiment_design::{BoardTilt, CaptureProposal, ImagePlace, ProposedFrame};
use super::free_functions::Along;
use super::left_over::LeftOver;
use super::round::{Round, RoundOutcome};

/// Largest ratio that is written: of next to nothing anything is a multiple.
const LARGEST_RATIO: f64 = 1e3;

impl Display for Along {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        f.write_str(match self {
            Along::Pixel => "position in the image",
            Along::Column => "image column",
            Along::Row => "image row",
            Along::Depth => "depth",
            Along::Amplitude => "infrared amplitude",
            Along::Incidence => "angle of incidence",
            Along::Time => "time",
            Along::Temperature => "temperature",
            Along::Board => "position on the board",
        })
    }
}

impl Display for BadFrameReason {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::DepthExchanged { with } => {
                write!(f, "its depth image fits the pose of {with}: the two depth images seem to be exchanged")
            }
            Self::Moved { offset_mm, rms_mm } => write!(
                f,
                "its depth deviates from its image by a plane of its own ({offset_mm:+.1} mm in the middle, {rms_mm:.1} mm \
                 rms): the board or the camera seems to have moved between the two"
            ),
            Self::SameImage { of } => write!(f, "its image is that of {of}: the frame is stored twice"),
            Self::SameDepthImage { of } => write!(f, "its depth image is that of {of}: the frame is stored twice"),
        }
    }
}

impl Display for ImplausibleScale {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let percent = 100.0 * (self.scale - 1.0);
        write!(
            f,
            "depth is {percent:+.1} % of what the board's declared size says ({:.4} times): no depth camera is that wrong. \
             Check spacing_mm under [board] (declared {:.3} mm; {:.3} mm would fit) and unit_mm under [depth] (declared {} mm; \
             {:.6} mm would fit). The scale is taken up by dw and is no effect",
            self.scale,
            self.spacing_mm,
            self.fitting_spacing_mm(),
            self.unit_mm,
            self.fitting_unit_mm(),
        )
    }
}

impl Display for Round {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match &self.decision {
            Decision::Nothing => f.write_str("nothing is left that these data show")?,
            Decision::Add { effect, leaves_unexplained: true, explained, .. } => write!(
                f,
                "something is left of which named effects explain {:.0} % at most; {} holds beside every free function",
                100.0 * explained,
                self.evidence[*effect].spec,
            )?,
            Decision::Add { effect, jointly_with, explained, of_planes, .. } => {
                self.evidence[*effect].spec.fmt(f)?;
                if !jointly_with.is_empty() {
                    write!(f, " with {}", self.names(jointly_with).join(", "))?;
                }
                write!(
                    f,
                    " explains {:.0} % of what it and any free function explain, {:.2} times what planes of the frames' own do",
                    100.0 * explained,
                    of_planes.min(LARGEST_RATIO)
                )?;
            }
            Decision::Unexplained { free, explained } => write!(
                f,
                "something is left along {}; named effects explain {:.0} % of it",
                self.evidence[*free].along.map_or_else(String::new, |a| a.to_string()),
                100.0 * explained
            )?,
        }
        self.outcome.as_ref().map_or(Ok(()), |outcome| write!(f, "; {outcome}"))
    }
}

impl Display for RoundOutcome {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Negligible => f.write_str("too little to be a finding"),
            Self::LimitReached => f.write_str("no more rounds"),
            Self::NoHeldOutGain => f.write_str("added, it brings nothing on held-out frames"),
            Self::NotFitted { error } => write!(f, "it cannot be fitted: {error}"),
            Self::MadeUnnecessary { effects } => {
                let effects: Vec<String> = effects.iter().map(ToString::to_string).collect();
                write!(f, "beside it nothing is left for {}", effects.join(", "))
            }
        }
    }
}

impl Display for LeftOver {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::FreeFunction { along, size_mm, explained } => write!(
                f,
                "a free function of {along} takes up {size_mm:.3} mm rms that no named effect explains (the best of them: \
                 {:.0} %)",
                100.0 * explained
            ),
            Self::FramePlanes { share, rms_mm } => write!(
                f,
                "{:.0} % of the frames deviate by a plane of their own, {rms_mm:.2} mm rms over all frames: something changes \
                 from frame to frame that no covariate describes",
                100.0 * share
            ),
        }
    }
}

impl Display for CaptureProposal {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Distinguish {
                effect,
                rival,
                frame,
                frames,
                practicable,
                noncentrality,
                noncentrality_with_frame,
                sufficient_noncentrality,
            } => {
                write!(f, "to tell {effect} from {rival}: {frame}; ")?;
                if *practicable {
                    write!(f, "about {frames:.0} of them would do")?;
                } else {
                    f.write_str("even many frames like it would hardly do")?;
                }
                write!(
                    f,
                    " (squared distance in standard deviations {noncentrality:.1} now, {noncentrality_with_frame:.1} with one, \
                     {sufficient_noncentrality} is enough)"
                )
            }
            Self::Record { covariate, effects } => {
                let (missing, how) = (covariate.missing(), covariate.how_to_record());
                write!(f, "{}: {missing}; {how}", effects.join(", "))
            }
        }
    }
}

impl Display for ProposedFrame {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "a frame {:.1} m away, {}, {}", self.distance_mm / 1000.0, self.place, self.tilt)?;
        self.warmer_c.map_or(Ok(()), |warmer| write!(f, ", {warmer} °C warmer than the warmest"))
    }
}

impl Display for ImagePlace {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        f.write_str(match self {
            Self::Middle => "in the middle",
            Self::LeftEdge => "at the left edge",
            Self::RightEdge => "at the right edge",
            Self::Top => "at the top",
            Self::UpperLeft => "in the upper left corner",
            Self::LowerRight => "in the lower right corner",
        })
    }
}

impl Display for BoardTilt {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Parallel => f.write_str("parallel to the image"),
            Self::AboutVertical(angle) => write!(f, "turned by {angle}° about the vertical"),
            Self::AboutHorizontal(angle) => write!(f, "turned by {angle}° about the horizontal"),
        }
    }
}
