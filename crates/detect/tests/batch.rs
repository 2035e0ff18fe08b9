//! Many frames, and images that hold no board.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::common::{self, Camera, Pose, Scene, Texture};
use depthcal_detect::{DetectError, DetectOptions, FrameError, RefineOptions, detect, detect_all, refine_circles};
use depthcal_io::GrayImage;
use depthcal_model::target::{Pattern, Target};

fn flat(width: usize, height: usize, value: u16, bits: u8) -> GrayImage {
    GrayImage { width, height, data: vec![value; width * height], bits }
}

fn kinds() -> Vec<Target> {
    let charuco = Pattern::Charuco { marker_mm: 15.0, dictionary: "DICT_4X4_50".into() };
    let tags = Pattern::Aprilgrid { marker_mm: 15.0 };
    vec![
        common::asymmetric(4, 11, 17.0, 11.0),
        common::symmetric(5, 4, 20.0, 10.0),
        common::chessboard(5, 4, 20.0),
        Target { pattern: charuco, columns: 5, rows: 4, spacing_mm: 20.0 },
        Target { pattern: tags, columns: 5, rows: 4, spacing_mm: 20.0 },
    ]
}

#[test]
fn results_come_in_order_and_errors_name_the_frame() {
    let target = common::asymmetric(4, 11, 17.0, 11.5);
    let camera = Camera::thesis();
    let pose = Pose::looking(&camera, target.point(22), [320.0, 240.0], 600.0, 0.3, 1.0, 0.5);
    let texture = Texture::new(target.clone(), 17.0);
    let board = Scene::new(camera, pose, &texture, 1).render();
    let frames: Vec<(String, _)> = (0..4)
        .map(|i| {
            let board = &board;
            let load = move || match i {
                0 => Ok(flat(64, 48, 100, 8)),
                2 => Err(std::io::Error::other("the disk is on fire")),
                3 => Ok(GrayImage { width: 10, height: 10, data: vec![0; 7], bits: 8 }),
                _ => Ok(board.clone()),
            };
            (format!("frame{i}"), load)
        })
        .collect();
    let seen = AtomicUsize::new(0);
    let results = detect_all(&frames, &target, &DetectOptions::default(), &|done, all| {
        assert!((1..=4).contains(&done) && all == 4);
        seen.fetch_add(1, Ordering::Relaxed);
    });
    assert_eq!(seen.load(Ordering::Relaxed), 4);
    assert!(matches!(results[0], Ok(None)));
    assert!(matches!(&results[1], Ok(Some(d)) if d.markers.len() == 44));
    assert_eq!(results[1].as_ref().ok(), Some(&detect(&board, &target, &DetectOptions::default()).expect("no error")));
    let message = |i: usize| results[i].as_ref().expect_err("an error").to_string();
    assert_eq!(message(2), "frame frame2: the disk is on fire");
    assert!(matches!(&results[3], Err(FrameError::Detect { frame, .. }) if frame == "frame3"));
    assert!(message(3).contains("10 x 10") && message(3).contains('7'));
}

#[test]
fn images_without_a_board_are_no_error() {
    for target in kinds() {
        for image in [flat(3, 2, 0, 8), flat(12, 9, 255, 8), flat(160, 120, 65_535, 16), flat(1, 300, 9, 16)] {
            let result = detect(&image, &target, &DetectOptions::default());
            assert!(
                matches!(result, Ok(None)),
                "{:?} in {} x {}: {result:?}",
                target.pattern,
                image.width,
                image.height
            );
        }
    }
}

#[test]
fn boards_that_cannot_be_are_refused_by_name() {
    let image = flat(64, 48, 100, 8);
    let refuse = |target: Target| detect(&image, &target, &DetectOptions::default()).expect_err("an error").to_string();
    assert!(refuse(common::asymmetric(4, 11, -17.0, 11.0)).contains("board.spacing_mm = -17"));
    assert!(refuse(common::asymmetric(4, 11, 17.0, f64::NAN)).contains("board.circle_diameter_mm"));
    assert!(refuse(common::symmetric(5, 4, 10.0, 10.0)).contains("must not touch"));
    assert!(refuse(common::chessboard(0, 0, 10.0)).contains("too small"));
    assert!(refuse(common::chessboard(2, 9, 10.0)).contains("3 x 3"));
    for target in kinds() {
        let none = Target { columns: 0, rows: 0, ..target };
        assert!(matches!(
            detect(&image, &none, &DetectOptions::default()),
            Err(DetectError::BoardTooSmall { columns: 0, rows: 0, .. })
        ));
    }
}

#[test]
fn refinement_of_the_wrong_board_is_refused() {
    let image = flat(64, 48, 100, 8);
    let marker = depthcal_detect::Marker { index: 99, pixel: [3.0, 3.0] };
    let polarity = depthcal_detect::Polarity::DarkOnBright;
    let detection = depthcal_detect::Detection { markers: vec![marker], polarity, charuco_layout: None };
    let options = RefineOptions::default();
    let beyond = refine_circles(&image, &detection, &common::asymmetric(4, 11, 17.0, 11.0), &|p| Some(p), &options);
    assert!(matches!(beyond, Err(DetectError::MarkerIndex { index: 99, len: 44 })));
    let empty = depthcal_detect::Detection { markers: Vec::new(), polarity, charuco_layout: None };
    let kind = refine_circles(&image, &empty, &common::chessboard(5, 4, 20.0), &|p| Some(p), &options);
    assert!(matches!(kind, Err(DetectError::WrongKind { .. })));
}

/// Datasets may be detected side by side: a process that changed the number of OpenCV's threads for each of them crashed.
#[test]
fn batches_run_side_by_side() {
    let target = common::chessboard(7, 5, 20.0);
    let camera = Camera::thesis();
    let pose = Pose::looking(&camera, target.point(17), [320.0, 240.0], 500.0, 0.3, 1.0, 0.0);
    let texture = Texture::new(target.clone(), 20.0);
    let board = Scene::new(camera, pose, &texture, 1).render();
    let frames: Vec<(String, _)> =
        (0..2).map(|i| (format!("frame{i}"), || Ok::<_, std::io::Error>(board.clone()))).collect();
    let expected = detect(&board, &target, &DetectOptions::default()).expect("no error").expect("the board");
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..20 {
                    for result in detect_all(&frames, &target, &DetectOptions::default(), &|_, _| {}) {
                        assert_eq!(result.expect("no error").as_ref(), Some(&expected));
                    }
                }
            });
        }
    });
}
