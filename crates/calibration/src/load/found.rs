//! What detection gives for a dataset.

use super::circle_diameter::MeasuredDiameter;
use crate::observe::MarkerObservation;

/// The markers of every frame, in order, none where the board was not found, and the diameter of the dots.
pub(crate) struct Found {
    pub(crate) markers: Vec<Vec<MarkerObservation>>,
    /// `None` for boards without dots.
    pub(crate) circle_diameter: Option<MeasuredDiameter>,
}
