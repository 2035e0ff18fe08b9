//! Frames of several boards: one for each board, so that every frame has one pose of the board.

use depthcal_model::Target;

use crate::observe::{MarkerObservation, RawFrame};

/// A frame once for every board of the target.
pub(super) fn per_board(raw: RawFrame, target: &Target) -> Vec<RawFrame> {
    let frame_of_board = |(board, part): (usize, depthcal_model::BoardPart<'_>)| RawFrame {
        name: part.frame_name(&raw.name),
        board,
        ..raw.clone()
    };
    target.parts().into_iter().enumerate().map(frame_of_board).collect()
}

/// The markers of a frame board by board.
pub(super) fn markers_per_board(markers: &[MarkerObservation], target: &Target) -> Vec<Vec<MarkerObservation>> {
    let markers_of_board = |part: depthcal_model::BoardPart<'_>| {
        markers.iter().filter(|m| part.markers.contains(&m.index)).copied().collect()
    };
    target.parts().into_iter().map(markers_of_board).collect()
}
