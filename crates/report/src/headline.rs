//! The verdict: one sentence made from the numbers.

use super::html::{count, number};
use super::pool::Pool;
use super::statistics::{Change, Estimate};
use super::{ReportInput, Role};

/// Which way an error went by the correction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Smaller, by more than the frames' disagreement.
    Fell,
    /// No difference beyond the frames' disagreement.
    Same,
    /// Larger, by more than the frames' disagreement.
    Rose,
}

/// Which way an error went.
pub(super) fn direction(change: &Change) -> Direction {
    match change.difference {
        Estimate { high, .. } if high < 0.0 => Direction::Fell,
        Estimate { low, .. } if low > 0.0 => Direction::Rose,
        _ => Direction::Same,
    }
}

/// `95 % interval 1.9–2.4 mm`, where there is one.
pub(super) fn interval(e: &Estimate, unit: &str) -> Option<String> {
    e.has_interval().then(|| format!("95 % interval {}–{} {unit}", number(e.low), number(e.high)))
}

fn whose(role: Role) -> &'static str {
    match role {
        Role::HeldOut => "Held-out",
        Role::Other => "On captures that the fit did not see, the",
        Role::Fitted => "On the very frames that the camera was fitted to, the",
    }
}

/// The sentence.
pub(super) fn sentence(input: &ReportInput<'_>) -> String {
    let (pool, role) = Pool::headline(input);
    let what = whose(role);
    if let Some(change) = pool.depth_rms() {
        let (before, after) = (number(change.before.value), number(change.after.value));
        let frames = count(change.frames, "frame");
        let unit = interval(&change.after, "mm").map_or(format!("over {frames}"), |i| format!("{i} over {frames}"));
        return match direction(&change) {
            _ if !change.after.has_interval() => format!(
                "{what} depth error went from {before} mm to {after} mm rms over {frames}: too few frames to say how \
                 sure that is."
            ),
            Direction::Fell => format!("{what} depth error fell from {before} mm to {after} mm rms ({unit})."),
            Direction::Rose => format!(
                "{what} depth error rose from {before} mm to {after} mm rms ({unit}): the \
                                        correction does harm there."
            ),
            Direction::Same => format!(
                "{what} depth error did not change measurably: {before} mm rms before and {after} mm after correction \
                 ({unit})."
            ),
        };
    }
    if let Some((e, frames)) = pool.reprojection() {
        let frames = count(frames, "frame");
        let unit = interval(&e, "px").map_or(format!("over {frames}"), |i| format!("{i} over {frames}"));
        return format!(
            "{what} reprojection error is {} px rms ({unit}); there is no depth here, so nothing is said about it.",
            number(e.value)
        );
    }
    match input.calibrated {
        Some(c) => format!(
            "A camera was fitted to {} with {} px rms, but it was not evaluated on any frame.",
            count(c.capture.frames.len(), "frame"),
            number(c.reprojection_rms_px)
        ),
        None => "No frame could be evaluated.".to_owned(),
    }
}
