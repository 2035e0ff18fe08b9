//! The movement that brings a board to a wanted view, in words.

use depthcal_calibration::plan::BoardView;
use depthcal_model::Camera;

/// How far a board is from a wanted view, in steps of [`BoardView::steps_to`]: at most 1 where it is there.
pub(crate) fn distance(view: &BoardView, wanted: &BoardView, camera: &Camera) -> f64 {
    view.steps_to(wanted, camera).into_iter().fold(0.0, f64::max)
}

/// The movement that brings it nearest to a wanted view, for who looks at the picture.
pub(crate) fn hint(view: &BoardView, wanted: &BoardView, camera: &Camera) -> &'static str {
    let [ratio, place, angle] = view.steps_to(wanted, camera);
    if place >= ratio.max(angle) {
        let [right, down] = [0, 1].map(|i| wanted.pixel[i] - view.pixel[i]);
        return match (right.abs() > down.abs(), right > 0.0, down > 0.0) {
            (true, true, _) => "to the right in the picture",
            (true, false, _) => "to the left in the picture",
            (false, _, true) => "down in the picture",
            (false, _, false) => "up in the picture",
        };
    }
    if ratio >= angle {
        let farther = view.distance_mm < wanted.distance_mm;
        return if farther { "away from the camera" } else { "nearer to the camera" };
    }
    let [upper, right] = [0, 1].map(|i| wanted.turn_deg[i] - view.turn_deg[i]);
    match (right.abs() > upper.abs(), right > 0.0, upper > 0.0) {
        (true, true, _) => "tilt: its right side nearer",
        (true, false, _) => "tilt: its left side nearer",
        (false, _, true) => "tilt: its upper side nearer",
        (false, _, false) => "tilt: its lower side nearer",
    }
}
