//! ChArUco boards and AprilGrids, drawn by OpenCV's contrib module `aruco` and rendered by the tests.

mod common;

use depthcal_detect::{DetectError, DetectOptions, detect};
use depthcal_model::target::{Pattern, Target};

#[test]
fn a_dictionary_that_is_unknown_or_too_small_is_named() {
    let image = depthcal_io::GrayImage { width: 64, height: 64, data: vec![0; 64 * 64], bits: 8 };
    let with = |dictionary: &str, columns: usize| Target {
        pattern: Pattern::Charuco { marker_mm: 10.0, dictionary: dictionary.into() },
        columns,
        rows: 20,
        spacing_mm: 20.0,
    };
    let unknown = detect(&image, &with("DICT_5X5_42", 5), &DetectOptions::default());
    assert!(matches!(unknown, Err(DetectError::UnknownDictionary { name }) if name == "DICT_5X5_42"));
    let small = detect(&image, &with("DICT_5X5_50", 9), &DetectOptions::default());
    assert!(matches!(small, Err(DetectError::DictionaryTooSmall { need: 90, got: 50, .. })));
}

#[cfg(not(fiducials = "contrib"))]
#[test]
fn drawn_boards_need_contrib() {
    common::skipped(
        "this OpenCV has no contrib module aruco, with which tests/fiducials.rs draws ChArUco boards and AprilGrids",
    );
}

#[cfg(fiducials = "contrib")]
mod drawn {
    use opencv::aruco;
    use opencv::core::{Mat, MatTraitConst, MatTraitConstManual, Size};
    use opencv::prelude::*;

    use super::common::{self, Camera, Pose, Scene, Texture};
    use super::*;

    /// Pixels per mm of a drawn board.
    const SCALE: f64 = 8.0;

    fn charuco(columns: usize, rows: usize) -> Target {
        let pattern = Pattern::Charuco { marker_mm: 22.5, dictionary: "DICT_5X5_100".into() };
        Target { pattern, columns, rows, spacing_mm: 30.0 }
    }

    fn charuco_texture(target: &Target) -> Texture {
        let dictionary = aruco::get_predefined_dictionary_i32(5).expect("a dictionary");
        let (columns, rows) = (target.columns as i32, target.rows as i32);
        let board = aruco::CharucoBoard::create(columns, rows, 30.0, 22.5, &dictionary).expect("a board");
        let mut board = board;
        let side = (30.0 * SCALE) as i32;
        let mut drawn = Mat::default();
        board.draw(Size::new(columns * side, rows * side), &mut drawn, 0, 1).expect("a drawing");
        let width = drawn.cols() as usize;
        let data = drawn.data_typed::<u8>().expect("8 bits").to_vec();
        let mut texture = Texture::new(target.clone(), 0.0);
        texture.raster = Some((data, width, SCALE, [0.0, 0.0]));
        texture
    }

    fn aprilgrid() -> Target {
        Target { pattern: Pattern::Aprilgrid { marker_mm: 24.0 }, columns: 6, rows: 5, spacing_mm: 32.0 }
    }

    fn aprilgrid_texture(target: &Target) -> Texture {
        let dictionary = aruco::get_predefined_dictionary_i32(20).expect("a dictionary");
        let margin = 8.0;
        let px = |mm: f64| (mm * SCALE).round() as usize;
        let size = [target.columns, target.rows].map(|n| px((n - 1) as f64 * 32.0 + 24.0 + 2.0 * margin));
        let mut data = vec![255u8; size[0] * size[1]];
        let side = px(24.0);
        for id in 0..target.columns * target.rows {
            let mut tag = Mat::default();
            aruco::draw_marker(&dictionary, id as i32, side as i32, &mut tag, 1).expect("a tag");
            let tag = tag.data_typed::<u8>().expect("8 bits");
            let (x0, y0) =
                (px((id % target.columns) as f64 * 32.0 + margin), px((id / target.columns) as f64 * 32.0 + margin));
            for y in 0..side {
                let row = (y0 + y) * size[0] + x0;
                data[row..row + side].copy_from_slice(&tag[y * side..(y + 1) * side]);
            }
        }
        let mut texture = Texture::new(target.clone(), 0.0);
        texture.raster = Some((data, size[0], SCALE, [-margin, -margin]));
        texture
    }

    /// Number of frames found, share of their markers found, rms error per coordinate and largest error, px.
    fn run(target: &Target, texture: &Texture, distances: &[f64]) -> (usize, f64, f64, f64) {
        let camera = Camera::thesis();
        let middle = target.point(target.len() / 2);
        let (mut found, mut errors) = (0, Vec::new());
        for (i, &z) in distances.iter().enumerate() {
            let tilt = (i % 4) as f64 * 0.22;
            let pose = Pose::looking(&camera, middle, [330.0, 235.0], z, tilt, i as f64, 0.7 * i as f64);
            let image = Scene::new(camera, pose, texture, i as u64).render();
            let Some(detection) = detect(&image, target, &DetectOptions::default()).expect("no error") else {
                continue;
            };
            found += 1;
            for m in &detection.markers {
                let t = Scene::new(camera, pose, texture, 0).truth(target.point(m.index));
                errors.push((m.pixel[0] - t[0]).hypot(m.pixel[1] - t[1]));
            }
        }
        let part = errors.len() as f64 / (found * target.len()).max(1) as f64;
        let worst = errors.iter().copied().fold(0.0, f64::max);
        (found, part, common::rms(errors) / 2f64.sqrt(), worst)
    }

    #[test]
    fn charuco_crossings() {
        for (columns, rows) in [(8, 6), (7, 5)] {
            let target = charuco(columns, rows);
            let texture = charuco_texture(&target);
            let distances = [400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0, 750.0];
            let (found, part, rms, worst) = run(&target, &texture, &distances);
            println!(
                "charuco {columns} x {rows}: {found} of 8 found, {part:.2} of crossings, rms {rms:.4}, worst {worst:.3}"
            );
            assert!(found == 8 && part > 0.85 && rms < 0.05);
        }
    }

    #[test]
    fn aprilgrid_corners() {
        let target = aprilgrid();
        let texture = aprilgrid_texture(&target);
        let distances = [350.0, 400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0];
        let (found, part, rms, worst) = run(&target, &texture, &distances);
        println!("aprilgrid: {found} of 8 found, {part:.2} of the corners, rms {rms:.4}, worst {worst:.3}");
        assert!(found == 8 && part > 0.85 && rms < 0.12);
    }
}
