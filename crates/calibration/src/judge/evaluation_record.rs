//! The record of an evaluation for `evaluation.json`, with intervals.

use depthcal_io::{BeforeAfter, DatasetEvaluation, ErrorIntervals, Spread};

use super::camera::{EvaluatedCamera, EvaluatedFrame};
use super::depth_errors::PixelError;
use super::intervals::{Change, depth_rms, dot_error, interval_of, plane_error, reprojection, spread};

impl EvaluatedCamera {
    /// The record for `evaluation.json`.
    pub fn record(&self) -> DatasetEvaluation {
        DatasetEvaluation {
            intervals: error_intervals(&self.frames),
            depth_90_percent_mm: spreads(&self.frames),
            frames_detail: self.frames.iter().map(EvaluatedFrame::record).collect(),
            ..self.errors()
        }
    }
}

/// The intervals of the errors of frames; `None` where there are too few for any.
fn error_intervals(frames: &[EvaluatedFrame]) -> Option<ErrorIntervals> {
    let both = |change: Option<Change>| change.and_then(|change| change.intervals());
    let intervals = ErrorIntervals {
        reprojection_px: reprojection(frames.iter()).and_then(|(e, _)| interval_of(&e)),
        dot_error_mm: both(dot_error(frames.iter())),
        plane_error_mm: both(plane_error(frames.iter())),
        depth_rms_mm: both(depth_rms(frames.iter())),
    };
    (intervals != ErrorIntervals::default()).then_some(intervals)
}

/// The ranges of the depth errors of 90 % of the pixels of frames that were kept one by one, mm.
fn spreads(frames: &[EvaluatedFrame]) -> Option<BeforeAfter<Spread>> {
    let pixels = || frames.iter().flat_map(|f| &f.pixels).filter(|p| p.is_usable());
    let side = |of: fn(&PixelError) -> f64| spread(pixels().map(of));
    Some(BeforeAfter { before: side(|p| p.before_mm)?, after: side(|p| p.after_mm)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_and_ranges_are_those_of_the_frames() {
        let frame = |i: usize| {
            let error_mm = if i.is_multiple_of(2) { 1.0 } else { 3.0 };
            EvaluatedFrame::of_depth_errors(format!("{i:03}"), &[error_mm; 10])
        };
        let evaluated = |frames: usize| {
            let frames = (0..frames).map(frame).collect();
            EvaluatedCamera { name: "test".into(), frames, dropped: Vec::new() }
        };
        let record = evaluated(40).record();
        let intervals = record.intervals.unwrap();
        let expected = depth_rms(evaluated(40).frames.iter()).unwrap().intervals();
        assert!(expected.is_some() && intervals.depth_rms_mm == expected);
        // These frames have no markers.
        assert!(intervals.plane_error_mm.is_some() && intervals.reprojection_px.is_none());
        assert_eq!(record.depth_90_percent_mm.map(|range| range.after), Some(Spread { low: 1.0, high: 3.0 }));
        assert_eq!(evaluated(2).record().intervals, None, "too few frames");
        assert_eq!(evaluated(0).record().depth_90_percent_mm, None);
    }
}
