//! Chessboards: the share of boards found, the order and the accuracy of their corners.

#![cfg(feature = "opencv")]

use crate::common::{self, Camera, Pose, Scene, Texture};
use depthcal_detect::{DetectOptions, detect};
use depthcal_model::target::Target;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// A random pose with the whole board, its outer squares too, in the image and squares at least `min_px` wide.
fn random_pose(camera: &Camera, target: &Target, min_px: f64, rng: &mut ChaCha8Rng) -> Pose {
    let s = target.spacing_mm;
    let (c, r) = (target.columns as f64, target.rows as f64);
    loop {
        let z = rng.random_range(300.0..1500.0);
        let tilt = rng.random_range(0.0..50f64.to_radians());
        let turn = std::f64::consts::TAU;
        let pixel = [rng.random_range(0.0..camera.width as f64), rng.random_range(0.0..camera.height as f64)];
        let middle = target.point(target.len() / 2);
        let pose =
            Pose::looking(camera, middle, pixel, z, tilt, rng.random_range(0.0..turn), rng.random_range(0.0..turn));
        let inside = [[-s, -s], [c * s, -s], [c * s, r * s], [-s, r * s]].iter().all(|p| {
            let x = pose.apply(*p);
            let [u, v] = camera.project(x);
            x.z > 100.0
                && s * camera.f / x.z >= min_px
                && u > 2.0
                && v > 2.0
                && u < camera.width as f64 - 3.0
                && v < camera.height as f64 - 3.0
        });
        if inside {
            return pose;
        }
    }
}

/// Found frames, rms per coordinate (px), and frames whose order is not the printed one (or its half turn, where
/// the board looks the same after it).
fn run(target: &Target, min_px: f64, count: usize, refine: bool) -> (usize, f64, usize) {
    let camera = Camera::thesis();
    let options = DetectOptions { refine, ..DetectOptions::default() };
    let symmetric = (target.columns + target.rows).is_multiple_of(2);
    let outcomes: Vec<Option<(Vec<f64>, bool)>> = (0..count as u64)
        .into_par_iter()
        .map(|seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(5000 + seed);
            let pose = random_pose(&camera, target, min_px, &mut rng);
            let texture = Texture::new(target.clone(), 10.0);
            let mut scene = Scene::new(camera, pose, &texture, seed);
            scene.rays = 4;
            let image = scene.render();
            let Some(detection) = detect(&image, target, &options).expect("no error") else {
                println!("not found: seed {seed}");
                return None;
            };
            // The labellings that a turn of the board allows, the printed one first.
            let n = target.columns;
            let quarter = |i: usize| (i % n) * n + n - 1 - i / n;
            let half = |i: usize| target.len() - 1 - i;
            let mut orders: Vec<Vec<usize>> = vec![(0..target.len()).collect(), (0..target.len()).map(half).collect()];
            if target.columns == target.rows {
                orders.push((0..target.len()).map(quarter).collect());
                orders.push((0..target.len()).map(|i| half(quarter(i))).collect());
            }
            let distances = |order: &Vec<usize>| -> Vec<f64> {
                detection
                    .markers
                    .iter()
                    .map(|m| {
                        let t = scene.truth(target.point(order[m.index]));
                        (m.pixel[0] - t[0]).hypot(m.pixel[1] - t[1])
                    })
                    .collect()
            };
            let all: Vec<Vec<f64>> = orders.iter().map(distances).collect();
            let best = (0..all.len()).min_by(|&a, &b| all[a][0].total_cmp(&all[b][0])).expect("an order");
            Some((all[best].clone(), best == 0 || symmetric))
        })
        .collect();
    let boards = outcomes.iter().flatten().count();
    let wrong = outcomes.iter().flatten().filter(|o| !o.1).count();
    let rms = common::rms(outcomes.iter().flatten().flat_map(|o| o.0.iter().copied())) / 2f64.sqrt();
    (boards, rms, wrong)
}

#[test]
fn boards_are_found_and_their_order_is_the_printed_one() {
    for target in [common::chessboard(9, 6, 25.0), common::chessboard(7, 5, 30.0), common::chessboard(6, 6, 25.0)] {
        let count = common::frames(12);
        let (columns, rows) = (target.columns, target.rows);
        let (boards, raw, _) = run(&target, 10.0, count, false);
        println!("chessboard {columns} x {rows}: {boards} of {count} found, unrefined rms {raw:.4} px");
        let (boards, rms, wrong) = run(&target, 10.0, count, true);
        println!("chessboard {columns} x {rows}: {boards} of {count} found, rms {rms:.4} px, {wrong} in another order");
        // One may be missed even of a few.
        assert!((boards + 1) as f64 >= 0.97 * count as f64);
        assert!(rms < 0.03 && rms < raw, "{rms} px against {raw} px of OpenCV");
        assert_eq!(wrong, 0);
    }
}
