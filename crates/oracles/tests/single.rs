//! The fit of images of one camera against OpenCV's calibrateCamera, on measured images of a chessboard (`DEPTHCAL_DATA`).

use depthcal_calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal_calibration::load::{LoadOptions, LoadedCamera, load};
use opencv::core::{Mat, Point2f, Point3f, Size, TermCriteria, Vector};

/// OpenCV's reprojection rms on the same markers with the same model (five lens parameters).
fn opencv_rms(loaded: &LoadedCamera) -> f64 {
    let (mut objects, mut images) = (Vector::<Vector<Point3f>>::new(), Vector::<Vector<Point2f>>::new());
    for frame in &loaded.capture.frames {
        let board = frame.markers.iter().map(|m| loaded.capture.target.point(m.index));
        objects.push(board.map(|p| Point3f::new(p[0] as f32, p[1] as f32, 0.0)).collect());
        images.push(frame.markers.iter().map(|m| Point2f::new(m.pixel[0] as f32, m.pixel[1] as f32)).collect());
    }
    let (mut k, mut lens) = (Mat::default(), Mat::default());
    let (mut rotations, mut translations) = (Vector::<Mat>::new(), Vector::<Mat>::new());
    let size = Size::new(loaded.capture.width as i32, loaded.capture.height as i32);
    let criteria = TermCriteria::new(3, 200, 1e-14).unwrap();
    opencv::calib3d::calibrate_camera(
        &objects,
        &images,
        size,
        &mut k,
        &mut lens,
        &mut rotations,
        &mut translations,
        0,
        criteria,
    )
    .unwrap()
}

#[test]
fn chessboard_is_found_and_fits_as_well_as_opencv() {
    let Some(path) = crate::measured::measured("chessboard/dataset.toml") else { return };
    let options = LoadOptions { cache: None, ..LoadOptions::default() };
    let loaded = load(path.parent().unwrap(), &options).unwrap().into_only_camera().unwrap();
    assert_eq!(loaded.capture.frames.len(), 13);
    let options = CameraOptions { model: "none".parse().unwrap(), ..CameraOptions::default() };
    let result = calibrate_camera(&loaded.capture, &options).unwrap();
    let oracle = opencv_rms(&loaded);
    println!("chessboard: {:.4} px rms, OpenCV {oracle:.4} px on the same corners", result.reprojection_rms_px);
    assert!(
        (result.reprojection_rms_px / oracle - 1.0).abs() < 0.01,
        "{} against {oracle}",
        result.reprojection_rms_px
    );
    assert!(result.reprojection_rms_px < 0.26);
}
