//! OpenCV's circle grids with its default settings, to compare with.

use depthcal_detect::{Detection, Marker, Polarity};
use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};
use opencv::core::{Mat, Point2f, Ptr, Size, Vector};
use opencv::{calib3d, features2d};

/// The dots in OpenCV's order, which for the boards of the tests is ours or its half turn.
///
/// # Panics
/// When OpenCV fails.
pub fn find(image: &GrayImage, target: &Target) -> Option<Detection> {
    let bytes = super::common::measured::bytes(image);
    let mat = Mat::new_rows_cols_with_data(image.height as i32, image.width as i32, &bytes).expect("an image");
    let size = Size::new(target.columns as i32, target.rows as i32);
    let flags = match target.pattern {
        Pattern::AsymmetricCircles { .. } => calib3d::CALIB_CB_ASYMMETRIC_GRID,
        _ => calib3d::CALIB_CB_SYMMETRIC_GRID,
    };
    let parameters = features2d::SimpleBlobDetector_Params::default().expect("parameters");
    let blobs: Ptr<features2d::SimpleBlobDetector> =
        features2d::SimpleBlobDetector::create(parameters).expect("a detector");
    let blobs: Ptr<features2d::Feature2D> = blobs.into();
    let mut centers = Vector::<Point2f>::new();
    let is_found = calib3d::find_circles_grid(&mat, size, &mut centers, flags, Some(&blobs)).expect("a search");
    let markers = centers.iter().enumerate();
    let markers = markers.map(|(index, p)| Marker { index, pixel: [f64::from(p.x), f64::from(p.y)] }).collect();
    is_found.then_some(Detection { markers, polarity: Polarity::DarkOnBright, charuco_layout: None })
}
