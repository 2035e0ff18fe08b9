//! The crate without its feature `opencv`.
#![cfg(not(feature = "opencv"))]

mod common;

use common::{Camera, Pose, Scene, Texture};
use depthcal_detect::{DetectError, DetectOptions, detect, detect_all};
use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};

#[test]
fn circle_grids_are_found() {
    let target = common::asymmetric(4, 11, 17.0, 11.5);
    let camera = Camera::thesis();
    let pose = Pose::looking(&camera, target.point(22), [320.0, 240.0], 600.0, 0.3, 1.0, 0.5);
    let texture = Texture::new(target.clone(), 17.0);
    let scene = Scene::new(camera, pose, &texture, 1);
    let image = scene.render();
    let frames = [("0001".to_owned(), || Ok::<_, std::io::Error>(image.clone()))];
    let found = detect_all(&frames, &target, &DetectOptions::default(), &|_, _| {}).remove(0).expect("no error");
    let markers = found.expect("a board").markers;
    assert_eq!(markers.len(), 44);
    for marker in markers {
        let truth = scene.truth(target.point(marker.index));
        assert!((marker.pixel[0] - truth[0]).hypot(marker.pixel[1] - truth[1]) < 0.2);
    }
}

#[test]
fn boards_that_need_opencv_name_the_feature() {
    let image = GrayImage { width: 64, height: 48, data: vec![100; 64 * 48], bits: 8 };
    let board = |pattern| Target { pattern, columns: 5, rows: 4, spacing_mm: 20.0 };
    let charuco = Pattern::Charuco { marker_mm: 15.0, dictionary: "DICT_4X4_50".into() };
    for (target, kind) in [
        (common::chessboard(5, 4, 20.0), "chessboard"),
        (board(charuco), "charuco"),
        (board(Pattern::Aprilgrid { marker_mm: 15.0 }), "aprilgrid"),
    ] {
        let error = detect(&image, &target, &DetectOptions::default()).expect_err("an error");
        assert!(matches!(error, DetectError::MissingFeature { feature: "opencv", .. }), "{error}");
        assert!(error.to_string().contains(kind) && error.to_string().contains("`opencv`"), "{error}");
    }
}
