//! The verdict of a report without a diagnosis: one sentence about the errors before and after correction.

use super::format::{self, count, number};
use super::input::{ReportCamera, Role};
use super::pool::Pool;
use depthcal_calibration::judge::intervals::Change;
use depthcal_statistics::Estimate;

/// How the correction changed an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    /// Smaller: the 95 % interval of the change lies below zero.
    Fell,
    /// No significant change: the interval contains zero, or there is none.
    Same,
    /// Larger: the interval lies above zero.
    Rose,
}

/// How an error changed.
pub(super) fn direction(change: &Change) -> Direction {
    match change.difference {
        Estimate { high, .. } if high < 0.0 => Direction::Fell,
        Estimate { low, .. } if low > 0.0 => Direction::Rose,
        _ => Direction::Same,
    }
}

/// Largest ratio of the ends of an interval that says something about an error.
const WIDEST: f64 = 5.0;

/// Whether the frames determine an error at all: its interval, where there is one, is not too wide.
pub(super) fn is_determined(e: &Estimate) -> bool {
    !e.has_interval() || e.high <= WIDEST * e.low
}

/// The interval of an error over some frames: `95 % interval 1.90 to 2.41 mm over 9 frames`. Where it is too wide, why these
/// frames do not determine the error; without one, the frames alone.
pub(super) fn certainty(e: &Estimate, unit: &str, frames: usize) -> String {
    let frames = count(frames, "frame");
    match (e.has_interval(), is_determined(e)) {
        (false, _) => format!("over {frames}"),
        (true, true) => format!("95 % interval {} over {frames}", format::interval(e.low, e.high, unit)),
        (true, false) => format!("not determined by these frames: the errors of {frames} differ too much"),
    }
}

fn whose(role: Role) -> &'static str {
    match role {
        Role::HeldOut => "Held-out",
        Role::Other => "On captures that are not part of the fit, the",
        Role::Fitted => "On the frames that the camera was fitted to, the",
    }
}

/// The sentence, about held-out frames where there are any.
pub(super) fn sentence(camera: &ReportCamera<'_>) -> String {
    let (pool, role) = Pool::headline(camera);
    let what = whose(role);
    if let Some(change) = pool.depth_rms() {
        let (before, after) = (number(change.before.value), number(change.after.value));
        let frames = count(change.frames, "frame");
        let certainty = certainty(&change.after, "mm", change.frames);
        return match direction(&change) {
            _ if !change.after.has_interval() => format!(
                "{what} depth error went from {before} mm to {after} mm rms over {frames}: too few frames for an interval."
            ),
            Direction::Fell => format!("{what} depth error fell from {before} mm to {after} mm rms ({certainty})."),
            Direction::Rose => format!(
                "{what} depth error rose from {before} mm to {after} mm rms ({certainty}): the correction makes depth worse there."
            ),
            Direction::Same => format!(
                "{what} depth error did not change significantly: {before} mm rms before and {after} mm after correction ({certainty})."
            ),
        };
    }
    if let Some((e, frames)) = pool.reprojection() {
        let certainty = certainty(&e, "px", frames);
        return format!(
            "{what} reprojection error is {} px rms ({certainty}). There are no depth images, so depth errors are unknown.",
            number(e.value)
        );
    }
    match camera.calibrated {
        // Without images there are no markers, whose reprojection could be wrong.
        Some(c) if c.reprojection_rms_px == 0.0 => format!(
            "A camera was fitted to {}, but it was not evaluated on any frame.",
            count(c.capture.frames.len(), "frame")
        ),
        Some(c) => format!(
            "A camera was fitted to {} with a reprojection error of {} px rms, but it was not evaluated on any frame.",
            count(c.capture.frames.len(), "frame"),
            number(c.reprojection_rms_px)
        ),
        None => "No frame could be evaluated.".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_intervals_are_not_shown() {
        let estimate = |low, high| Estimate { value: 2.0, low, high };
        assert_eq!(certainty(&estimate(1.9, 2.4), "mm", 9), "95 % interval 1.90 to 2.40 mm over 9 frames");
        assert_eq!(certainty(&estimate(1.0, 5.0), "mm", 9), "95 % interval 1.00 to 5.00 mm over 9 frames");
        let wide = "not determined by these frames: the errors of 3 frames differ too much";
        assert_eq!(certainty(&estimate(0.5, 2.6), "mm", 3), wide);
        assert_eq!(certainty(&estimate(0.0, 2.6), "mm", 3), wide);
        assert_eq!(certainty(&Estimate::without_interval(2.0), "mm", 1), "over 1 frame");
    }
}
