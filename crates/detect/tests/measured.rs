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

#[cfg(not(fiducials = "contrib"))]
#[test]
fn charuco_boards_that_opencv_finds() {
    common::skipped("this OpenCV has no contrib module aruco, with whose ChArUco boards tests/measured.rs compares");
}

/// Boards that fill much of the image, in part outside it, many of them blurred by motion.
#[cfg(fiducials = "contrib")]
#[test]
fn charuco_boards_that_opencv_finds() {
    use opencv::aruco;
    use opencv::core::no_array;
    use opencv::prelude::*;

    let dictionary = aruco::get_predefined_dictionary_i32(16).expect("a dictionary");
    let pattern = depthcal_model::Pattern::Charuco { marker_mm: 10.4375, dictionary: "DICT_ARUCO_ORIGINAL".into() };
    let target = Target { pattern, columns: 10, rows: 8, spacing_mm: 20.875 };
    // The board begins with a white square, as OpenCV's boards of eight rows did before 4.6. Those of 4.6 begin with a
    // black one: a board with one more column on the left has the same squares, when its tags get the same numbers.
    let mut board = aruco::CharucoBoard::create(11, 8, 20.875, 10.4375, &dictionary).expect("a board");
    let mut next = 0;
    let numbers =
        (0..8).flat_map(|row| (0..11).filter(move |column| column % 2 != row % 2)).map(|column| match column {
            0 => 1000,
            _ => {
                next += 1;
                next - 1
            }
        });
    board.set_ids(numbers.collect());
    // The number of corners that OpenCV interpolates between markers, with corners beside one marker or two.
    let by_opencv = |image: &GrayImage| {
        let bytes: Vec<u8> = image.data.iter().map(|&v| v.min(255) as u8).collect();
        let mat = Mat::new_rows_cols_with_data(image.height as i32, image.width as i32, &bytes).expect("an image");
        let mut best = 0;
        for refinement in [0, 1] {
            let mut parameters = aruco::DetectorParameters::create().expect("parameters");
            parameters.set_corner_refinement_method(refinement);
            let (mut tags, mut ids) = (Vector::<Vector<Point2f>>::new(), Vector::<i32>::new());
            aruco::detect_markers(&mat, &dictionary, &mut tags, &mut ids, &parameters, &mut no_array())
                .expect("a search");
            for least in [1, 2].into_iter().filter(|_| !ids.is_empty()) {
                let (mut corners, mut numbers) = (Mat::default(), Mat::default());
                let (camera, lens) = (no_array(), no_array());
                let count = aruco::interpolate_corners_charuco(
                    &tags,
                    &ids,
                    &mat,
                    &board,
                    &mut corners,
                    &mut numbers,
                    &camera,
                    &lens,
                    least,
                )
                .expect("corners");
                // Without the corners of the column that the board does not have, and without those in the outermost
                // pixels, where nothing shows that they are right.
                let inside = |p: &Point2f| {
                    (3.0..mat.cols() as f32 - 4.0).contains(&p.x) && (3.0..mat.rows() as f32 - 4.0).contains(&p.y)
                };
                let real = (0..count)
                    .filter(|&i| *numbers.at::<i32>(i).expect("a number") % 10 != 0)
                    .filter(|&i| inside(corners.at::<Point2f>(i).expect("a corner")))
                    .count();
                best = best.max(real);
            }
        }
        best
    };
    for (dataset, least) in [
        ("truedepth/ipad4/calib", 39),
        ("truedepth/ipad4/check", 5),
        ("truedepth/iphone11pro/calib", 50),
        ("truedepth/iphone11pro/check", 5),
    ] {
        let Some(frames) = images(dataset, "image") else { return };
        let loaders: Vec<_> =
            frames.iter().map(|(name, image)| (name.clone(), || Ok::<_, std::io::Error>(image.clone()))).collect();
        let clock = std::time::Instant::now();
        let found = detect_all(&loaders, &target, &DetectOptions::default(), &|_, _| {});
        let each = clock.elapsed() / frames.len() as u32;
        let counts: Vec<usize> =
            found.iter().map(|f| f.as_ref().expect("no error").as_ref().map_or(0, |d| d.markers.len())).collect();
        let theirs: Vec<usize> = frames.iter().map(|(_, image)| by_opencv(image)).collect();
        for ((name, _), (ours, theirs)) in frames.iter().zip(counts.iter().zip(&theirs)) {
            println!("  {name}: {ours} corners, {theirs} by OpenCV");
        }
        let of = |counts: &[usize]| (counts.iter().filter(|c| **c >= 12).count(), counts.iter().sum::<usize>());
        println!(
            "{dataset}: frames with 12 corners, corners {:?}, by OpenCV {:?}, {each:?} per frame",
            of(&counts),
            of(&theirs)
        );
        for ((name, _), (ours, theirs)) in frames.iter().zip(counts.iter().zip(&theirs)) {
            assert!(*theirs < 12 || ours >= theirs, "{name}: {ours} corners, but {theirs} by OpenCV");
        }
        let frames_found = counts.iter().filter(|c| **c >= 12).count();
        assert!(frames_found >= least, "{dataset}: {frames_found} of {} frames", frames.len());
    }
}
