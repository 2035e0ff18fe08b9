//! Measured captures: what is found is compared, frame by frame, with what OpenCV finds with its default settings.

#![cfg(feature = "opencv")]

use crate::common;
use crate::common::measured::{Capture, bytes, capture};
use depthcal_detect::{DetectOptions, Detection, detect_all};
use depthcal_io::GrayImage;
use depthcal_model::target::Target;
use opencv::calib3d;
use opencv::core::{Mat, Point2f, Point3f, Size, TermCriteria, Vector};

/// Root mean square reprojection error of OpenCV's calibration with the five-parameter lens, per point, not per axis.
fn opencv_rms<'a>(target: &Target, image: &GrayImage, detections: impl Iterator<Item = &'a Detection>) -> f64 {
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

/// The board in every frame, in order.
fn found(capture: &Capture, options: &DetectOptions) -> Vec<Option<Detection>> {
    let frames = capture.frames.iter();
    let loaders: Vec<_> =
        frames.map(|(name, image)| (name.clone(), || Ok::<_, std::io::Error>(image.clone()))).collect();
    let results = detect_all(&loaders, &capture.target, options, &|_, _| {});
    results.into_iter().map(|r| r.expect("no error")).collect()
}

/// Whether OpenCV finds the chessboard, as its own examples do.
fn by_opencv(image: &GrayImage, target: &Target) -> bool {
    let bytes = bytes(image);
    let mat = Mat::new_rows_cols_with_data(image.height as i32, image.width as i32, &bytes).expect("an image");
    let size = Size::new(target.columns as i32, target.rows as i32);
    let flags = calib3d::CALIB_CB_ADAPTIVE_THRESH | calib3d::CALIB_CB_NORMALIZE_IMAGE;
    calib3d::find_chessboard_corners(&mat, size, &mut Vector::<Point2f>::new(), flags).expect("a search")
}

/// Every board that OpenCV finds is found, and OpenCV's own calibration fits the corners better when they are refined.
fn chessboards(dataset: &str) {
    let Some(capture) = capture(dataset) else { return };
    let Capture { target, frames } = &capture;
    let (raw, fitted) = (
        found(&capture, &DetectOptions { refine: false, ..DetectOptions::default() }),
        found(&capture, &DetectOptions::default()),
    );
    let theirs: Vec<bool> = frames.iter().map(|(_, image)| by_opencv(image, target)).collect();
    let rms = |detections: &[Option<Detection>]| opencv_rms(target, &frames[0].1, detections.iter().flatten());
    let (before, after) = (rms(&raw), rms(&fitted));
    println!(
        "{dataset}: {} of {} found, {} by OpenCV, reprojection {before:.4} px by OpenCV's corners, {after:.4} px by \
         fitted ones",
        fitted.iter().flatten().count(),
        frames.len(),
        theirs.iter().filter(|t| **t).count(),
    );
    for (((name, _), ours), theirs) in frames.iter().zip(&fitted).zip(theirs) {
        assert!(ours.is_some() || !theirs, "{dataset}: OpenCV finds the board in {name}");
    }
    assert!(after < before, "{dataset}: {after} px, {before} px before");
}

#[test]
fn grey_chessboard() {
    chessboards("chessboard");
}

#[test]
fn infrared_chessboard() {
    chessboards("kinect2");
}

#[cfg(not(fiducials = "contrib"))]
#[test]
fn charuco_boards_that_opencv_finds() {
    common::skipped("this OpenCV has no contrib module aruco, with whose ChArUco boards tests/measured.rs compares");
}

/// Boards that fill much of the image, in part outside it, many of them blurred by motion: every frame in which OpenCV
/// finds 12 corners or more is found, with at least as many corners.
#[cfg(fiducials = "contrib")]
#[test]
fn charuco_boards_that_opencv_finds() {
    const ENOUGH: usize = 12;
    for dataset in
        ["truedepth/ipad4/calib", "truedepth/ipad4/check", "truedepth/iphone11pro/calib", "truedepth/iphone11pro/check"]
    {
        let Some(capture) = capture(dataset) else { return };
        let detections = found(&capture, &DetectOptions::default());
        let ours: Vec<usize> = detections.iter().map(|d| d.as_ref().map_or(0, |d| d.markers.len())).collect();
        let images = capture.frames.iter();
        let theirs: Vec<usize> =
            images.map(|(_, image)| common::opencv_charuco::corners(image, &capture.target)).collect();
        let summary =
            |counts: &[usize]| (counts.iter().filter(|c| **c >= ENOUGH).count(), counts.iter().sum::<usize>());
        println!("{dataset}: (frames, corners) {:?}, by OpenCV {:?}", summary(&ours), summary(&theirs));
        let mut missed = Vec::new();
        for (((name, _), ours), theirs) in capture.frames.iter().zip(&ours).zip(&theirs) {
            println!("  {name}: {ours} corners, {theirs} by OpenCV");
            if *theirs >= ENOUGH && ours < theirs {
                missed.push(format!("{name}: {ours} corners, {theirs} by OpenCV"));
            }
        }
        assert!(missed.is_empty(), "{dataset}: {missed:#?}");
    }
}
