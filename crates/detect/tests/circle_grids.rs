//! Circle grids: the share of boards found, and the accuracy of their dots.

use crate::common::{self, Camera, Pose, Scene, Texture};
use depthcal_detect::{DetectOptions, Detection, Polarity, detect};
use depthcal_io::GrayImage;
use depthcal_model::target::Target;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// A random pose with every dot inside the image and at least `min_px` wide (longest axis).
fn random_pose(camera: &Camera, target: &Target, min_px: f64, rng: &mut ChaCha8Rng) -> Pose {
    let diameter = target.circle_diameter_mm().expect("dots");
    loop {
        let z = rng.random_range(300.0..1500.0);
        let tilt = rng.random_range(0.0..50f64.to_radians());
        let turn = std::f64::consts::TAU;
        let pixel = [rng.random_range(0.0..camera.width as f64), rng.random_range(0.0..camera.height as f64)];
        let middle = target.point(target.len() / 2);
        let pose =
            Pose::looking(camera, middle, pixel, z, tilt, rng.random_range(0.0..turn), rng.random_range(0.0..turn));
        let inside = target.points().iter().all(|p| {
            let x = pose.apply(*p);
            let [u, v] = camera.project(x);
            let r = 0.5 * diameter * camera.f / x.z;
            x.z > 100.0
                && 2.0 * r >= min_px
                && u > r
                && v > r
                && u < camera.width as f64 - 1.0 - r
                && v < camera.height as f64 - 1.0 - r
        });
        if inside {
            return pose;
        }
    }
}

/// Distances of the found markers from the truth, px; from the labelling turned by half where `symmetric` is set and
/// the board was found so.
fn errors(scene: &Scene, target: &Target, detection: &Detection, symmetric: bool) -> Vec<f64> {
    let distances = |turned: bool| -> Vec<f64> {
        detection
            .markers
            .iter()
            .map(|m| {
                let index = if turned { target.len() - 1 - m.index } else { m.index };
                let t = scene.truth(target.point(index));
                (m.pixel[0] - t[0]).hypot(m.pixel[1] - t[1])
            })
            .collect()
    };
    let plain = distances(false);
    if symmetric && plain[0] > 5.0 { distances(true) } else { plain }
}

struct Outcome {
    found: bool,
    errors: Vec<f64>,
    dots_px: f64,
}

fn run(target: &Target, inverted: bool, symmetric: bool, count: usize, bits: u8) -> Vec<Outcome> {
    let camera = Camera::thesis();
    (0..count as u64)
        .into_par_iter()
        .map(|seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
            let pose = random_pose(&camera, target, 5.0, &mut rng);
            let texture = Texture::new(target.clone(), rng.random_range(0.75..1.5) * target.spacing_mm);
            let texture = if inverted { texture.inverted() } else { texture };
            let mut scene = Scene::new(camera, pose, &texture, seed);
            scene.rays = 4;
            if bits == 16 {
                scene.bits = 16;
                scene.white = 6000.0;
            }
            let mut image = scene.render();
            if bits == 16 {
                add_reflex(&mut image, &mut rng);
            }
            let detection = detect(&image, target, &DetectOptions::default()).expect("no error");
            let z = pose.apply(target.point(target.len() / 2)).z;
            let dots_px = target.circle_diameter_mm().expect("dots") * camera.f / z;
            match detection {
                Some(detection) => {
                    let expected = if inverted { Polarity::BrightOnDark } else { Polarity::DarkOnBright };
                    assert_eq!(detection.polarity, expected);
                    Outcome { found: true, errors: errors(&scene, target, &detection, symmetric), dots_px }
                }
                None => {
                    let [u, v] = scene.truth(target.point(target.len() / 2));
                    println!("not found: seed {seed}, dots {dots_px:.1} px at ({u:.0}, {v:.0})");
                    Outcome { found: false, errors: Vec::new(), dots_px }
                }
            }
        })
        .collect()
}

/// A lamp in the corner, far brighter than the board.
fn add_reflex(image: &mut GrayImage, rng: &mut ChaCha8Rng) {
    let (x0, y0) = if rng.random_bool(0.5) { (0, 0) } else { (image.width - 24, image.height - 24) };
    for y in y0..y0 + 24 {
        for x in x0..x0 + 24 {
            image.data[y * image.width + x] = 60_000;
        }
    }
}

fn check(name: &str, outcomes: &[Outcome]) {
    let boards = outcomes.iter().filter(|o| o.found).count();
    let right: Vec<&Outcome> = outcomes.iter().filter(|o| o.found).collect();
    let wrong = right.iter().filter(|o| o.errors.iter().any(|e| *e > 2.0)).count();
    // Per coordinate, all markers alike.
    let rms = common::rms(right.iter().flat_map(|o| o.errors.iter().copied())) / 2f64.sqrt();
    let worst = right.iter().flat_map(|o| o.errors.iter().copied()).fold(0.0, f64::max);
    let smallest = outcomes.iter().map(|o| o.dots_px).fold(f64::INFINITY, f64::min);
    println!(
        "{name}: {boards} of {} found, {wrong} wrong, rms {rms:.4} px, worst {worst:.3} px, smallest dots {smallest:.1} px",
        outcomes.len()
    );
    assert_eq!(wrong, 0, "{name}: wrong grids");
    assert!(boards as f64 >= 0.95 * outcomes.len() as f64, "{name}: {boards} of {} found", outcomes.len());
    assert!(rms < 0.05, "{name}: {rms} px rms");
}

#[test]
fn asymmetric_dark_dots() {
    check("asymmetric", &run(&common::asymmetric(4, 11, 17.0, 11.5), false, false, common::frames(24), 8));
}

#[test]
fn asymmetric_bright_dots() {
    check("asymmetric, bright", &run(&common::asymmetric(4, 11, 17.0, 11.5), true, false, common::frames(12), 8));
}

#[test]
fn symmetric_dots() {
    check("symmetric", &run(&common::symmetric(7, 6, 24.0, 12.0), false, true, common::frames(12), 8));
}

#[test]
fn infrared_amplitudes_with_a_lamp() {
    check("16 bits", &run(&common::asymmetric(4, 11, 17.0, 11.5), false, false, common::frames(12), 16));
}

#[test]
fn clutter_alone_is_no_board() {
    let target = common::asymmetric(4, 11, 17.0, 11.5);
    let camera = Camera::thesis();
    let pose = Pose::looking(&camera, [0.0, 0.0], [-4000.0, 0.0], 400.0, 0.0, 0.0, 0.0);
    let texture = Texture::new(target.clone(), 1.0);
    for seed in 0..4 {
        let mut scene = Scene::new(camera, pose, &texture, seed);
        scene.rays = 1;
        let image = scene.render();
        let (low, high) = image.data.iter().fold((u16::MAX, 0), |(l, h), &v| (l.min(v), h.max(v)));
        assert!(high - low > 100, "seed {seed}: there is no clutter, only grey values from {low} to {high}");
        assert_eq!(detect(&image, &target, &DetectOptions::default()).expect("no error"), None);
    }
}

#[test]
fn a_larger_board_than_declared_is_not_labelled_at_random() {
    let printed = common::asymmetric(4, 11, 17.0, 11.5);
    let declared = common::asymmetric(4, 9, 17.0, 11.5);
    let camera = Camera::thesis();
    let pose = Pose::looking(&camera, [60.0, 85.0], [320.0, 240.0], 500.0, 0.3, 1.0, 0.5);
    let texture = Texture::new(printed.clone(), 20.0);
    let image = Scene::new(camera, pose, &texture, 3).render();
    let detection = detect(&image, &printed, &DetectOptions::default()).expect("no error").expect("the printed board");
    assert_eq!(detection.markers.len(), printed.len());
    assert_eq!(detect(&image, &declared, &DetectOptions::default()).expect("no error"), None);
}

#[test]
fn the_diameter_of_dots_is_measured() {
    use depthcal_detect::measure_circle_diameter;
    let camera = Camera::thesis();
    for (printed, truth) in [
        (common::asymmetric(4, 11, 17.0, 11.5), 11.5),
        (common::asymmetric(4, 11, 17.0, 6.0), 6.0),
        (common::symmetric(7, 6, 24.0, 18.0), 18.0),
        (common::symmetric(7, 6, 24.0, 9.0), 9.0),
    ] {
        let texture = Texture::new(printed.clone(), 20.0);
        for (z, tilt) in [(350.0, 0.0), (450.0, 0.6)] {
            let middle = printed.point(printed.len() / 2);
            let pose = Pose::looking(&camera, middle, [320.0, 240.0], z, tilt, 0.8, 0.3);
            let scene = Scene::new(camera, pose, &texture, 7);
            let image = scene.render();
            // Not declared, right, and wrong by a fifth.
            for declared in [0.0, truth, 1.2 * truth, 0.8 * truth] {
                let target = printed.with_circle_diameter_mm(declared);
                let detection = detect(&image, &target, &DetectOptions::default()).expect("no error").expect("a board");
                let measured = measure_circle_diameter(&image, &detection, &target).expect("no error").expect("dots");
                let error = measured.diameter_mm / truth - 1.0;
                println!("{truth} mm, declared {declared}: {:.3} ± {:.3} mm", measured.diameter_mm, measured.std_mm);
                assert!(error.abs() < 0.02, "{truth} mm, declared {declared}: {measured:?}");
                assert!(measured.std_mm < 0.02 * truth && measured.dots > printed.len() / 2);
                let rms = common::rms(detection.markers.iter().map(|m| {
                    let t = scene.truth(printed.point(m.index));
                    (m.pixel[0] - t[0]).hypot(m.pixel[1] - t[1]) / 2f64.sqrt()
                }));
                assert!(rms < 0.06, "{truth} mm, declared {declared}: centres are off by {rms} px rms");
            }
        }
    }
}
