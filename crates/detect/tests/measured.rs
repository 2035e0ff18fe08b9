//! Measured captures: the number of boards found, and the reprojection error of OpenCV's own calibration on their
//! corners.

mod common;

use common::measured::images;
use depthcal_detect::{DetectOptions, Detection, detect_all};
use depthcal_io::GrayImage;
use depthcal_model::target::Target;
use opencv::calib3d;
use opencv::core::{Mat, Point2f, Point3f, Size, TermCriteria, Vector};

/// Root mean square reprojection error of OpenCV's calibration with the five-parameter lens, per point, not per axis.
fn opencv_rms(target: &Target, image: &GrayImage, detections: &[Detection]) -> f64 {
    let mut objects = Vector::<Vector<Point3f>>::new();
    let mut points = Vector::<Vector<Point2f>>::new();
    for detection in detections {
        let board = detection.markers.iter().map(|m| target.point(m.index));
        objects.push(board.map(|p| Point3f::new(p[0] as f32, p[1] as f32, 0.0)).collect());
        points.push(detection.markers.iter().map(|m| Point2f::new(m.pixel[0] as f32, m.pixel[1] as f32)).collect());
    }
    let (mut matrix, mut lens) = (Mat::default(), Mat::default());
    let (mut rotations, mut translations) = (Vector::<Mat>::new(), Vector::<Mat>::new());
    calib3d::calibrate_camera(
        &objects,
        &points,
        Size::new(image.width as i32, image.height as i32),
        &mut matrix,
        &mut lens,
        &mut rotations,
        &mut translations,
        0,
        TermCriteria::new(3, 100, 1e-12).expect("criteria"),
    )
    .expect("a calibration")
}

fn found(frames: &[(String, GrayImage)], target: &Target, options: &DetectOptions) -> Vec<Detection> {
    let loaders: Vec<_> =
        frames.iter().map(|(name, image)| (name.clone(), || Ok::<_, std::io::Error>(image.clone()))).collect();
    let results = detect_all(&loaders, target, options, &|_, _| {});
    for (result, (name, _)) in results.iter().zip(frames) {
        if !matches!(result, Ok(Some(_))) {
            println!("  no board in {name}");
        }
    }
    results.into_iter().filter_map(|r| r.expect("no error")).collect()
}

/// Number of boards found, and the reprojection error (px) with OpenCV's corners and with fitted ones; `None` where the
/// dataset is absent.
fn measure(dataset: &str, folder: &str, target: &Target) -> Option<(usize, f64, f64)> {
    let frames = images(dataset, folder)?;
    let image = &frames[0].1;
    let raw = found(&frames, target, &DetectOptions { refine: false, ..Default::default() });
    let clock = std::time::Instant::now();
    let fitted = found(&frames, target, &DetectOptions::default());
    let each = clock.elapsed() / frames.len() as u32;
    let (before, after) = (opencv_rms(target, image, &raw), opencv_rms(target, image, &fitted));
    let markers: usize = fitted.iter().map(|d| d.markers.len()).sum();
    println!(
        "{dataset}: {} of {} found, {markers} of {} corners, reprojection {before:.4} px by OpenCV's corners, \
         {after:.4} px by fitted ones, {each:?} per frame",
        fitted.len(),
        frames.len(),
        target.len() * frames.len()
    );
    Some((fitted.len(), before, after))
}

#[test]
fn grey_chessboard() {
    let Some((found, before, after)) = measure("chessboard", "image", &common::chessboard(9, 6, 25.0)) else { return };
    assert_eq!(found, 13);
    assert!(after < before && after < 0.17, "{after} px");
}

#[test]
fn infrared_chessboard() {
    let Some((found, before, after)) = measure("kinect2", "ir", &common::chessboard(5, 7, 30.0)) else { return };
    assert_eq!(found, 51);
    assert!(after < before && after < 0.04, "{after} px");
}
