//! The bias of circle centres under perspective: there before refinement, gone after it.

use crate::common::{self, Camera, Pose, Scene, Texture};
use depthcal_detect::{DetectOptions, RefineOptions, detect, refine_circles};

/// Mean displacement over all dots, px, in which noise averages out.
fn mean_error(scene: &Scene, target: &depthcal_model::target::Target, measured: &[(usize, [f64; 2])]) -> [f64; 2] {
    let n = measured.len() as f64;
    measured.iter().fold([0.0, 0.0], |s, (index, p)| {
        let t = scene.truth(target.point(*index));
        [s[0] + (p[0] - t[0]) / n, s[1] + (p[1] - t[1]) / n]
    })
}

#[test]
fn large_tilted_dots_are_biased_before_refinement_and_not_after() {
    let target = common::asymmetric(4, 7, 22.0, 22.0);
    let camera = Camera::thesis();
    let texture = Texture::new(target.clone(), 22.0);
    for (tilt, axis) in [(0.0f64, 0.0), (25.0, 1.0), (45.0, 0.0), (45.0, 1.57), (45.0, 2.5)] {
        let middle = target.point(target.len() / 2);
        let pose = Pose::looking(&camera, middle, [300.0, 250.0], 260.0, tilt.to_radians(), axis, 0.3);
        let mut scene = Scene::new(camera, pose, &texture, 11);
        // Only the geometry is looked at here: no noise, no uneven light, no clutter.
        scene.noise = 0.0;
        scene.light = [0.0, 0.0];
        scene.clutter = false;
        scene.white = 50_000.0;
        scene.bits = 16;
        scene.rays = 12;
        let image = scene.render();
        let raw = detect(&image, &target, &DetectOptions { refine: false, ..Default::default() })
            .expect("no error")
            .expect("a board");
        let mapping = |p: [f64; 2]| Some(scene.truth(p));
        let refined = refine_circles(&image, &raw, &target, &mapping, &RefineOptions::default()).expect("dots");
        assert_eq!(refined.len(), target.len());
        let sharp = detect(&image, &target, &DetectOptions::default()).expect("no error").expect("a board");
        let list = |d: &depthcal_detect::Detection| d.markers.iter().map(|m| (m.index, m.pixel)).collect::<Vec<_>>();
        let before = mean_error(&scene, &target, &list(&raw));
        let first = mean_error(&scene, &target, &list(&sharp));
        let points: Vec<_> = refined.iter().map(|r| (r.index, r.pixel)).collect();
        let after = mean_error(&scene, &target, &points);
        let worst = points
            .iter()
            .map(|(i, p)| {
                let t = scene.truth(target.point(*i));
                (p[0] - t[0]).hypot(p[1] - t[1])
            })
            .fold(0.0, f64::max);
        println!(
            "tilt {tilt}°: centre of gravity {:.4} px, first mapping {:.4} px, camera {:.4} px, worst dot {worst:.4} px",
            before[0].hypot(before[1]),
            first[0].hypot(first[1]),
            after[0].hypot(after[1])
        );
        assert!(after[0].hypot(after[1]) < 0.01 && first[0].hypot(first[1]) < 0.02);
        if tilt > 40.0 {
            assert!(before[0].hypot(before[1]) > 0.05, "the test shows no bias to remove");
        }
    }
}

#[test]
fn the_reported_standard_deviation_is_that_of_the_centres() {
    let target = common::asymmetric(4, 11, 17.0, 11.5);
    let camera = Camera::thesis();
    let texture = Texture::new(target.clone(), 17.0);
    for z in [400.0, 900.0] {
        let pose = Pose::looking(&camera, target.point(22), [320.0, 240.0], z, 0.5, 0.7, 0.4);
        let (mut normalised, mut stds) = (Vec::new(), Vec::new());
        for seed in 0..6 {
            let mut scene = Scene::new(camera, pose, &texture, seed);
            scene.clutter = false;
            let image = scene.render();
            let detection = detect(&image, &target, &DetectOptions::default()).expect("no error").expect("a board");
            let mapping = |p: [f64; 2]| Some(scene.truth(p));
            for r in refine_circles(&image, &detection, &target, &mapping, &RefineOptions::default()).expect("dots") {
                let t = scene.truth(target.point(r.index));
                normalised.extend([(r.pixel[0] - t[0]) / r.std_px, (r.pixel[1] - t[1]) / r.std_px]);
                stds.push(r.std_px);
            }
        }
        let ratio = common::rms(normalised);
        println!("z = {z} mm: std {:.4} px, actual over reported {ratio:.2}", common::rms(stds));
        assert!((0.8..1.3).contains(&ratio));
    }
}

#[test]
fn saturated_paper_and_the_border_do_no_harm() {
    let target = common::asymmetric(4, 11, 17.0, 11.5);
    let camera = Camera::thesis();
    let texture = Texture::new(target.clone(), 17.0);
    let pose = Pose::looking(&camera, target.point(22), [320.0, 240.0], 500.0, 0.6, 0.2, 1.4);
    let mut scene = Scene::new(camera, pose, &texture, 2);
    // Paper at 0.9 of 330 grey values is beyond 255, dots are not.
    scene.white = 330.0;
    let image = scene.render();
    let detection = detect(&image, &target, &DetectOptions::default()).expect("no error").expect("a board");
    let errors = detection.markers.iter().map(|m| {
        let t = scene.truth(target.point(m.index));
        (m.pixel[0] - t[0]).hypot(m.pixel[1] - t[1]) / 2f64.sqrt()
    });
    let rms = common::rms(errors);
    println!("saturated: rms {rms:.4} px");
    assert!(rms < 0.03);
    // A mapping that leaves the image or is undefined: nothing is refined, nothing fails.
    let none = refine_circles(&image, &detection, &target, &|_| None, &RefineOptions::default()).expect("no error");
    assert!(none.is_empty());
}
