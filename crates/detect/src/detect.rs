//! Detection of one board in one image.

use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};

use crate::check::{check_image, check_target};
use crate::chessboard;
use crate::circles;
use crate::detection::{DetectOptions, Detection};
use crate::error::DetectError;
use crate::fiducial;
use crate::refine;

/// Searches an image for the board.
///
/// `None` means that the board is not in the image, or not beyond doubt: a doubtful grid is not returned. A board that
/// looks the same after a turn is labelled as upright as the image allows. A chessboard of which exactly one of the two
/// numbers, columns and rows, is odd is labelled so that the square before its first corner is dark.
///
/// # Errors
/// [`DetectError`] when the image is inconsistent, when the board is too small, impossible or of an unknown dictionary,
/// and for [`Detector::OpenCv`](crate::Detector::OpenCv) when OpenCV fails, lacks the module that the board needs, or is missing.
pub fn detect(image: &GrayImage, target: &Target, options: &DetectOptions) -> Result<Option<Detection>, DetectError> {
    check_image(image)?;
    check_target(target)?;
    match &target.pattern {
        Pattern::AsymmetricCircles { .. } | Pattern::SymmetricCircles { .. } => {
            let Some(mut detection) = circles::find(image, target) else { return Ok(None) };
            if options.refine {
                let sized = match target.circle_diameter_mm() {
                    Some(_) => Some(target.clone()),
                    None => refine::measure_circle_diameter(image, &detection, target)?
                        .map(|measured| target.with_circle_diameter_mm(measured.diameter_mm)),
                };
                if let Some(sized) = sized {
                    refine::sharpen_circles(image, &mut detection, &sized)?;
                }
            }
            Ok(Some(detection))
        }
        Pattern::Chessboard => chessboard::find(image, target, options),
        Pattern::Charuco { dictionary, .. } => fiducial::find_charuco(image, target, dictionary, options),
        Pattern::Aprilgrid { .. } => fiducial::find_aprilgrid(image, target, options),
        Pattern::Several { .. } => find_several(image, target, options),
    }
}

/// The markers of all boards that are in the image.
fn find_several(image: &GrayImage, target: &Target, options: &DetectOptions) -> Result<Option<Detection>, DetectError> {
    let mut all: Option<Detection> = None;
    for part in target.parts() {
        let part_options = DetectOptions { first_tag: part.first_tag, ..options.clone() };
        let Some(mut detection) = detect(image, part.board, &part_options)? else { continue };
        detection.markers.iter_mut().for_each(|marker| marker.index += part.markers.start);
        match &mut all {
            Some(all) => all.markers.extend(detection.markers),
            None => all = Some(detection),
        }
    }
    Ok(all)
}
