//! Captures to add, in words and as JSON.

use depthcal_calibration::plan::{Goal, Planned};
use depthcal_calibration::task::NextCaptures;
use serde_json::{Value, json};

use crate::format::{count, quantity};

/// The subject of a goal, in words.
pub fn goal_words(goal: &Goal) -> String {
    match goal {
        Goal::Depth { range_mm: [near, far] } => {
            let [near, far] = [near, far].map(|mm| quantity(*mm, "mm"));
            format!("error of corrected depth from {near} to {far}, rms over the image")
        }
        Goal::Projection { distance_mm } => {
            format!("error of projection at {}, rms over the image", quantity(*distance_mm, "mm"))
        }
        Goal::Parameter(name) => format!("error of {name}"),
    }
}

/// The error, and the frames until it is small enough, in one sentence.
pub fn next_sentence(next: &NextCaptures) -> String {
    let (plan, unit) = (&next.plan, next.unit.as_str());
    let [now, target] = [plan.now_certain, next.target].map(|value| quantity(value, unit));
    let about = goal_words(&next.goal);
    let pose = plan.poses.first().map(|planned| planned.frame.words()).unwrap_or_default();
    match plan.frames_needed {
        Some(0) => format!("{about}: below {now} with 95 % certainty, which is within {target}: frames are enough"),
        Some(frames) => {
            let frames = count(frames, "frame");
            format!("{about}: below {now} with 95 % certainty, within {target} after {frames} more, such as: {pose}")
        }
        None => {
            let reachable = quantity(plan.reachable, unit);
            format!(
                "{about}: below {now} with 95 % certainty, {reachable} after many more, not {target}; the best: {pose}"
            )
        }
    }
}

/// Captures to add as JSON: the result of `depthcal next --json`.
pub fn next_value(next: &NextCaptures) -> Value {
    let pose = |planned: &Planned| {
        let (q, t) = (planned.rig_from_board.rotation.quaternion(), planned.rig_from_board.translation.vector);
        json!({
            "words": planned.frame.words(),
            "distance_mm": planned.frame.distance_mm,
            "turned_deg": planned.frame.tilt.angles_deg(),
            "rotation": [q.w, q.i, q.j, q.k],
            "translation_mm": [t.x, t.y, t.z],
            "expected": planned.expected,
        })
    };
    let plan = &next.plan;
    json!({
        "camera": next.camera,
        "goal": goal_words(&next.goal),
        "unit": next.unit,
        "now": plan.now,
        "now_95": plan.now_certain,
        "within": next.target,
        "frames_needed": plan.frames_needed,
        "reachable_95": plan.reachable,
        "pixel_noise_mm": next.noise_mm,
        "capture_next": plan.poses.iter().map(pose).collect::<Vec<_>>(),
    })
}
