//! ChArUco boards and AprilGrids, drawn by OpenCV's contrib module `aruco` and rendered by the tests.

#![cfg(feature = "opencv")]

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
    use rayon::prelude::*;

    use super::*;
    use crate::common::{self, Camera, Pose, Scene, Texture};

    /// Pixels per mm of a drawn board.
    const SCALE: f64 = 8.0;

    fn charuco(columns: usize, rows: usize) -> Target {
        let pattern = Pattern::Charuco { marker_mm: 22.5, dictionary: "DICT_5X5_100".into() };
        Target { pattern, columns, rows, spacing_mm: 30.0 }
    }

    fn charuco_texture(target: &Target) -> Texture {
        let Pattern::Charuco { marker_mm, .. } = target.pattern else { panic!("no tags") };
        let dictionary = aruco::get_predefined_dictionary_i32(5).expect("a dictionary");
        let (columns, rows) = (target.columns as i32, target.rows as i32);
        let board = aruco::CharucoBoard::create(columns, rows, 30.0, marker_mm as f32, &dictionary).expect("a board");
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
        let (mut boards, mut errors) = (0, Vec::new());
        for (i, &z) in distances.iter().enumerate() {
            let tilt = (i % 4) as f64 * 0.22;
            let pose = Pose::looking(&camera, middle, [330.0, 235.0], z, tilt, i as f64, 0.7 * i as f64);
            let image = Scene::new(camera, pose, texture, i as u64).render();
            let Some(detection) = detect(&image, target, &DetectOptions::default()).expect("no error") else {
                continue;
            };
            boards += 1;
            for m in &detection.markers {
                let t = Scene::new(camera, pose, texture, 0).truth(target.point(m.index));
                errors.push((m.pixel[0] - t[0]).hypot(m.pixel[1] - t[1]));
            }
        }
        let part = errors.len() as f64 / (boards * target.len()).max(1) as f64;
        let worst = errors.iter().copied().fold(0.0, f64::max);
        (boards, part, common::rms(errors) / 2f64.sqrt(), worst)
    }

    #[test]
    fn charuco_crossings() {
        for (columns, rows) in [(8, 6), (7, 5)] {
            let target = charuco(columns, rows);
            let texture = charuco_texture(&target);
            let distances = [400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0, 750.0];
            let (boards, part, rms, worst) = run(&target, &texture, &distances);
            println!(
                "charuco {columns} x {rows}: {boards} of 8 found, {part:.2} of crossings, rms {rms:.4}, worst {worst:.3}"
            );
            assert!(boards == 8 && part > 0.85 && rms < 0.05);
        }
    }

    #[test]
    fn aprilgrid_corners() {
        let target = aprilgrid();
        let texture = aprilgrid_texture(&target);
        let distances = [350.0, 400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0];
        let (boards, part, rms, worst) = run(&target, &texture, &distances);
        println!("aprilgrid: {boards} of 8 found, {part:.2} of the corners, rms {rms:.4}, worst {worst:.3}");
        assert!(boards == 8 && part > 0.85 && rms < 0.12);
    }

    /// Detection of a board that is seen in part.
    struct Part {
        found: usize,
        visible: usize,
        /// The largest error of a corner, px.
        worst: f64,
    }

    /// The largest error, px, that the scene explains. The drawn board is a raster: edges lie up to half a texel from
    /// where they belong, on both axes. Blur carries a tag's grey into the fit of the crossing beside it, which is
    /// accepted as long as the blur is narrow against the distance between them: a tenth of the blur. Noise alone
    /// displaces a corner by some hundredths of a pixel.
    fn explained_px(z: f64, blur: f64) -> f64 {
        let texel_px = Camera::thesis().f / z / SCALE;
        0.5f64.sqrt() * texel_px + 0.1 * blur
    }

    /// Boards that fill more than the image, at several places of it, with motion or defocus.
    fn run_partial(target: &Target, texture: &Texture, z: f64, blur: f64) -> Vec<Part> {
        // The thesis' lens is not invertible in the corners of the image.
        let camera = Camera { lens: [-0.05, 0.0, 0.0, 0.0, 0.0], ..Camera::thesis() };
        let corners = [[0.0, 0.0], [0.5, 0.1], [0.9, 0.9], [0.1, 0.8], [0.5, 0.5]];
        let extent = target.points().into_iter().fold([0.0f64; 2], |e, p| [e[0].max(p[0]), e[1].max(p[1])]);
        let view = |(i, [x, y]): (usize, [f64; 2])| {
            let middle = [x * extent[0], y * extent[1]];
            let tilt = 0.15 * (i % 3) as f64;
            let pose = Pose::looking(&camera, middle, [320.0, 240.0], z, tilt, i as f64, 1.3 * i as f64);
            let mut scene = Scene::new(camera, pose, texture, i as u64);
            scene.blur = blur;
            let image = scene.render();
            // Corners whose blurred edges the border cuts off are left out, and not expected.
            let border = 6.0 + 2.0 * blur;
            let inside = |[u, v]: [f64; 2]| {
                let size = [camera.width, camera.height].map(|n| n as f64 - 1.0 - border);
                (border..size[0]).contains(&u) && (border..size[1]).contains(&v)
            };
            let ahead = |p: [f64; 2]| {
                let p = pose.apply(p);
                p.z > 0.0 && (p.x / p.z).hypot(p.y / p.z) < 1.2
            };
            let detection = detect(&image, target, &DetectOptions::default()).expect("no error");
            let markers = detection.map(|d| d.markers).unwrap_or_default();
            let (mut visible, mut worst, mut text) = (0, 0.0f64, String::new());
            for (index, p) in target.points().into_iter().enumerate() {
                let truth = scene.truth(p);
                let marker = markers.iter().find(|m| m.index == index);
                if ahead(p) && inside(truth) {
                    visible += 1;
                    if marker.is_none() {
                        text += &format!("\n    corner {index} at ({:.0}, {:.0}) is missing", truth[0], truth[1]);
                    }
                }
                if let Some(m) = marker {
                    let error = (m.pixel[0] - truth[0]).hypot(m.pixel[1] - truth[1]);
                    worst = worst.max(error);
                    if error > 0.1 {
                        text += &format!(
                            "\n    corner {index} at ({:.0}, {:.0}) is off by {error:.3} px",
                            truth[0], truth[1]
                        );
                    }
                }
            }
            println!("z {z}, blur {blur}, view {i}: {} of {visible} visible, worst {worst:.3} px{text}", markers.len());
            Part { found: markers.len(), visible, worst }
        };
        corners.into_par_iter().enumerate().map(view).collect()
    }

    #[test]
    fn a_charuco_board_that_is_seen_in_part_is_found_as_far_as_it_is_seen() {
        let target = charuco(12, 9);
        let texture = charuco_texture(&target);
        // At 180 mm a square is 80 px wide: across the neighbours of a corner the lens departs from a homography by
        // more than a pixel, and right corners at the edge of what is seen are left out as strays.
        for (z, blur, tenths) in [(180.0, 0.7, 8), (250.0, 0.7, 9), (250.0, 2.0, 9)] {
            for Part { found, visible, worst } in run_partial(&target, &texture, z, blur) {
                assert!(10 * found >= tenths * visible, "{found} of {visible} at {z} mm, blur {blur} px");
                assert!(worst < explained_px(z, blur), "a corner is off by {worst} px at {z} mm, blur {blur} px");
            }
        }
    }

    #[test]
    fn a_charuco_board_without_legible_tags_is_found_by_its_crossings() {
        let pattern = Pattern::Charuco { marker_mm: 15.0, dictionary: "DICT_5X5_100".into() };
        let target = Target { pattern, ..charuco(10, 7) };
        let texture = charuco_texture(&target);
        // A bit of a tag is 2.1 mm, three and a half pixels: as wide as the blur.
        let (z, blur) = (300.0, 3.5);
        for Part { found, visible, worst } in run_partial(&target, &texture, z, blur) {
            assert!(10 * found >= 9 * visible, "{found} of {visible}");
            assert!(worst < explained_px(z, blur), "a corner is off by {worst} px");
        }
    }

    #[test]
    fn an_aprilgrid_that_is_seen_in_part_is_found_as_far_as_it_is_seen() {
        let target = aprilgrid();
        let texture = aprilgrid_texture(&target);
        for (z, blur) in [(130.0, 0.7), (180.0, 0.7), (180.0, 1.5)] {
            for Part { found, visible, worst } in run_partial(&target, &texture, z, blur) {
                assert!(10 * found >= 9 * visible, "{found} of {visible} at {z} mm, blur {blur} px");
                assert!(worst < explained_px(z, blur), "a corner is off by {worst} px at {z} mm, blur {blur} px");
            }
        }
    }

    #[test]
    fn an_occluded_corner_is_left_out_and_clutter_gives_none() {
        let target = charuco(8, 6);
        let texture = charuco_texture(&target);
        let camera = Camera::thesis();
        let pose = Pose::looking(&camera, target.point(17), [320.0, 240.0], 350.0, 0.2, 0.4, 0.3);
        let scene = Scene::new(camera, pose, &texture, 5);
        let mut image = scene.render();
        let hidden = 17;
        let [u, v] = scene.truth(target.point(hidden));
        for y in 0..image.height {
            for x in 0..image.width {
                if (x as f64 - u).hypot(y as f64 - v) < 14.0 {
                    image.data[y * image.width + x] = 120;
                }
            }
        }
        let detection = detect(&image, &target, &DetectOptions::default()).expect("no error").expect("a board");
        assert!(detection.markers.iter().all(|m| m.index != hidden));
        assert_eq!(detection.markers.len(), target.len() - 1);
        // The same image, searched for a board with other tags.
        let other = Pattern::Charuco { marker_mm: 22.5, dictionary: "DICT_4X4_100".into() };
        let other = Target { pattern: other, ..target.clone() };
        assert_eq!(detect(&image, &other, &DetectOptions::default()).expect("no error"), None);
    }
}
