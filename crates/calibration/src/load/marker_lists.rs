//! Markers that another program found.

use std::collections::BTreeMap;

use depthcal_model::Target;

use super::error::LoadError;
use super::given_markers::is_mirrored;
use crate::observe::MarkerObservation;

/// Markers by the names of frames.
pub type GivenMarkers = BTreeMap<String, Vec<MarkerObservation>>;

/// The markers of frames with these names, in order; none where none are given.
pub(super) fn markers_of(
    names: &[&str],
    target: &Target,
    given: &GivenMarkers,
) -> Result<Vec<Vec<MarkerObservation>>, LoadError> {
    for (frame, markers) in given {
        if !names.contains(&frame.as_str()) {
            let known: Vec<&str> = names.iter().copied().take(3).collect();
            let problem = format!("there is no such frame; frames are named {}, …", known.join(", "));
            return Err(LoadError::Marker { frame: frame.clone(), problem });
        }
        check(frame, markers, target)?;
    }
    Ok(names.iter().map(|name| given.get(*name).cloned().unwrap_or_default()).collect())
}

/// Refuses markers that the board does not have, have no place in the image, are given twice, or run as on a board from behind.
pub(super) fn check(frame: &str, markers: &[MarkerObservation], target: &Target) -> Result<(), LoadError> {
    let fault = |problem: String| Err(LoadError::Marker { frame: frame.to_owned(), problem });
    let mut seen = vec![false; target.len()];
    for marker in markers {
        let index = marker.index;
        match seen.get_mut(index) {
            None => {
                let count = target.len();
                return fault(format!("marker {index} does not exist: the board has {count}, counted from 0"));
            }
            Some(seen) if *seen => return fault(format!("marker {index} is given twice")),
            Some(seen) => *seen = true,
        }
        if !marker.pixel.iter().all(|value| value.is_finite()) {
            return fault(format!("marker {index} is at {:?}: leave out markers that were not found", marker.pixel));
        }
        if !(marker.std_px > 0.0 && marker.std_px.is_finite()) {
            let problem =
                format!("marker {index} has the standard deviation {} px: give a positive number", marker.std_px);
            return fault(problem);
        }
    }
    if is_mirrored(markers, target) {
        let remedy = "give (u, v), the column before the row, and rows of markers that run to the right and follow each other downwards";
        return fault(format!("the markers run as on a board seen from behind: {remedy} on the print"));
    }
    Ok(())
}
