//! Results of detection in a dataset.

use depthcal_model::CharucoLayout;

use super::circle_diameter::MeasuredDiameter;
use crate::observe::MarkerObservation;

/// The markers of every frame, in order, none where the board was not found, and what was seen of the board itself.
#[derive(Default)]
pub(crate) struct Found {
    pub(crate) markers: Vec<Vec<MarkerObservation>>,
    /// `None` for boards without dots.
    pub(crate) circle_diameter: Option<MeasuredDiameter>,
    /// `None` where there is but one layout.
    pub(crate) charuco_layout: Option<CharucoLayout>,
    /// Boards other than the declared one that were looked for, in words.
    pub(crate) tried: Option<&'static str>,
}
