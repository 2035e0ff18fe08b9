//! Effects that may be missing, but that these captures do not prove.

use depthcal_io::GainInterval;
use depthcal_model::PieceSpec;

/// An effect whose gain on left-out frames may be chance, or that would raise an error that users read. It is not added.
#[derive(Debug, Clone, PartialEq)]
pub struct Possible {
    /// The effect, with its constants.
    pub spec: PieceSpec,
    /// Fall of the weighted error on left-out frames, per cent, with its 95 % interval over frames.
    pub gain_percent: GainInterval,
    /// Number of further frames like these with which the gain, if it is real, would be certain; `None` where it is no question
    /// of certainty.
    pub further_frames: Option<u64>,
}

impl Possible {
    /// An effect with its gain over `frames` frames.
    pub(super) fn new(spec: PieceSpec, gain_percent: GainInterval, frames: usize) -> Self {
        // The interval shrinks with the root of the number of frames.
        let below = gain_percent.value - gain_percent.low;
        let needed = frames as f64 * (below / gain_percent.value).powi(2);
        let further = (needed - frames as f64).ceil();
        let further_frames =
            (further.is_finite() && further > 0.0 && gain_percent.value > 0.0).then_some(further as u64);
        Self { spec, gain_percent, further_frames }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_would_settle_it() {
        let further_frames = |low| {
            let gain = GainInterval { value: 1.0, low, high: 3.0 };
            Possible::new(PieceSpec::new("range_offset"), gain, 20).further_frames
        };
        // Twice the half width: four times the frames.
        assert_eq!(further_frames(-1.0), Some(60));
        assert_eq!(further_frames(0.1), None, "certain already");
        let gain = GainInterval { value: -1.0, low: -2.0, high: 0.0 };
        assert_eq!(Possible::new(PieceSpec::new("range_offset"), gain, 20).further_frames, None);
    }
}
