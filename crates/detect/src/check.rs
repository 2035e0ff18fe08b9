//! Input that is refused before anything is searched or fitted.

use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};

use crate::board::{kind, step_mm};
use crate::detection::Detection;
use crate::error::DetectError;

/// Checks that the number of an image's values is its width times its height, and not 0.
pub(crate) fn check_image(image: &GrayImage) -> Result<(), DetectError> {
    let expected = image.width.checked_mul(image.height);
    if image.width == 0 || image.height == 0 || expected != Some(image.data.len()) {
        return Err(DetectError::ImageSize { width: image.width, height: image.height, got: image.data.len() });
    }
    Ok(())
}

/// Checks that all markers of a detection are on the board.
pub(crate) fn check_markers(detection: &Detection, target: &Target) -> Result<(), DetectError> {
    match detection.markers.iter().find(|m| m.index >= target.len()) {
        Some(marker) => Err(DetectError::MarkerIndex { index: marker.index, len: target.len() }),
        None => Ok(()),
    }
}

/// Checks that a board's lengths are possible and that it has enough markers to be found without ambiguity.
pub(crate) fn check_target(target: &Target) -> Result<(), DetectError> {
    if let Pattern::Several { boards } = &target.pattern {
        return boards.iter().try_for_each(|part| check_target(&part.board));
    }
    let positive = |field, value: f64| {
        let remedy = "must be a positive length in mm";
        if value > 0.0 && value.is_finite() { Ok(()) } else { Err(DetectError::Field { field, value, remedy }) }
    };
    positive("board.spacing_mm", target.spacing_mm)?;
    let too_small = |need| {
        let (kind, columns, rows) = (kind(target), target.columns, target.rows);
        Err(DetectError::BoardTooSmall { kind, columns, rows, need })
    };
    match target.pattern {
        Pattern::AsymmetricCircles { circle_diameter_mm } | Pattern::SymmetricCircles { circle_diameter_mm } => {
            // 0 stands for a diameter that is not known.
            if circle_diameter_mm != 0.0 {
                positive("board.circle_diameter_mm", circle_diameter_mm)?;
            }
            if circle_diameter_mm >= step_mm(target) {
                let remedy = "dots must not touch: smaller than the distance between neighbours, in mm";
                return Err(DetectError::Field {
                    field: "board.circle_diameter_mm",
                    value: circle_diameter_mm,
                    remedy,
                });
            }
            if target.columns < 2 || target.rows < 3 || target.len() < 9 {
                return too_small("2 columns, 3 rows and 9 dots");
            }
        }
        Pattern::Chessboard if target.columns < 3 || target.rows < 3 => {
            return too_small("3 x 3 inner corners");
        }
        Pattern::Charuco { marker_mm, .. } => {
            positive("board.marker_mm", marker_mm)?;
            if marker_mm >= target.spacing_mm {
                let remedy = "markers must be smaller than the squares that they are in, spacing_mm";
                return Err(DetectError::Field { field: "board.marker_mm", value: marker_mm, remedy });
            }
            if target.columns < 3 || target.rows < 3 {
                return too_small("3 x 3 squares");
            }
        }
        Pattern::Aprilgrid { marker_mm } => {
            positive("board.marker_mm", marker_mm)?;
            if marker_mm >= target.spacing_mm {
                let remedy = "tags must be smaller than their pitch, spacing_mm";
                return Err(DetectError::Field { field: "board.marker_mm", value: marker_mm, remedy });
            }
            if target.is_empty() {
                return too_small("one tag");
            }
        }
        _ => {}
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_truncated_image_is_refused() {
        let image = GrayImage { width: 8, height: 8, data: vec![0; 63], bits: 8 };
        assert!(matches!(check_image(&image), Err(DetectError::ImageSize { got: 63, .. })));
    }
}
