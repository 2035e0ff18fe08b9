//! The verdict of a report without a diagnosis: one sentence about the errors before and after correction.

use super::format::{self, count, number};
use super::input::{ReportCamera, Role};
use super::pool::Pool;
use super::statistics::Change;
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

/// `95 % interval 1.90 to 2.41 mm`, where there is one.
pub(super) fn interval(e: &Estimate, unit: &str) -> Option<String> {
    e.has_interval().then(|| format!("95 % interval {}", format::interval(e.low, e.high, unit)))
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
        let unit = interval(&change.after, "mm").map_or(format!("over {frames}"), |i| format!("{i} over {frames}"));
        return match direction(&change) {
            _ if !change.after.has_interval() => format!(
                "{what} depth error went from {before} mm to {after} mm rms over {frames}: too few frames for an interval."
            ),
            Direction::Fell => format!("{what} depth error fell from {before} mm to {after} mm rms ({unit})."),
            Direction::Rose => format!(
                "{what} depth error rose from {before} mm to {after} mm rms ({unit}): the correction makes depth worse there."
            ),
            Direction::Same => format!(
                "{what} depth error did not change significantly: {before} mm rms before and {after} mm after correction ({unit})."
            ),
        };
    }
    if let Some((e, frames)) = pool.reprojection() {
        let frames = count(frames, "frame");
        let unit = interval(&e, "px").map_or(format!("over {frames}"), |i| format!("{i} over {frames}"));
        return format!(
            "{what} reprojection error is {} px rms ({unit}). There are no depth images, so depth errors are unknown.",
            number(e.value)
        );
    }
    match camera.calibrated {
        Some(c) => format!(
            "A camera was fitted to {} with a reprojection error of {} px rms, but it was not evaluated on any frame.",
            count(c.capture.frames.len(), "frame"),
            number(c.reprojection_rms_px)
        ),
        None => "No frame could be evaluated.".to_owned(),
    }
}
