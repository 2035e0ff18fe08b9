//! Point observations against the equations of the measurement, which are written out here a second time.

use depthcal_simulate::{CameraTruth, Defects, Effect, Kind, Noise, PointOptions, Pose, Simulation};

fn exact() -> PointOptions {
    PointOptions { sigma_px: 0.0, ..PointOptions::default() }
}

fn clean(camera: CameraTruth) -> Simulation {
    Simulation::new(camera, Kind::General(1), &[], 3).noise(Noise::none())
}

/// K and Brown–Conrady.
fn project(camera: &CameraTruth, [x, y, z]: [f64; 3]) -> [f64; 2] {
    let (x, y) = (x / z, y / z);
    let [k1, k2, p1, p2, k3] = camera.lens;
    let r2 = x * x + y * y;
    let radial = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3);
    let xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    let yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    [camera.focal_px[0] * xd + camera.centre_px[0], camera.focal_px[1] * yd + camera.centre_px[1]]
}

/// Depth of the board on a ray.
fn plane_depth(pose: &Pose, [x, y]: [f64; 2]) -> f64 {
    let normal = [0, 1, 2].map(|i| pose.rotation[i][2]);
    let offset: f64 = (0..3).map(|i| normal[i] * pose.translation[i]).sum();
    offset / (normal[0] * x + normal[1] * y + normal[2])
}

#[test]
fn markers_lie_where_the_published_camera_projects_them() {
    for number in 1..=4 {
        let camera = CameraTruth::published(number).unwrap();
        let points = clean(camera).observe_points(&exact()).unwrap();
        assert_eq!((points.frames.len(), points.truth.frames.len()), (27, 27));
        for (frame, truth) in points.frames.iter().zip(&points.truth.frames) {
            assert_eq!(frame.markers.len(), 44);
            for marker in &frame.markers {
                let (i, j) = ((marker.index / 4) as f64, (marker.index % 4) as f64);
                let p = truth.pose.apply([(2.0 * j + i % 2.0) * 17.0, i * 17.0, 0.0]);
                let pixel = project(&camera, p);
                assert!((pixel[0] - marker.pixel[0]).hypot(pixel[1] - marker.pixel[1]) < 1e-9);
                let [dx, dy, dz, dw] = camera.depth;
                let rho = dx * p[0] / p[2] + dy * p[1] / p[2] + dz + dw / p[2];
                assert!((1.0 / rho - marker.z_mm.unwrap()).abs() < 1e-6);
            }
        }
    }
}

#[test]
fn depth_samples_lie_on_the_projectively_distorted_plane() {
    let camera = CameraTruth { lens: [0.0; 5], ..CameraTruth::published(2).unwrap() };
    let points = clean(camera).observe_points(&exact()).unwrap();
    assert_eq!((points.frames.len(), points.truth.frames.len()), (27, 27));
    for (frame, truth) in points.frames.iter().zip(&points.truth.frames) {
        assert!(frame.depths.len() > 100, "{}", frame.depths.len());
        for sample in &frame.depths {
            let x = (sample.pixel[0] - camera.centre_px[0]) / camera.focal_px[0];
            let y = (sample.pixel[1] - camera.centre_px[1]) / camera.focal_px[1];
            let [dx, dy, dz, dw] = camera.depth;
            let rho = dx * x + dy * y + dz + dw / plane_depth(&truth.pose, [x, y]);
            assert!((1.0 / rho - sample.z_mm).abs() < 1e-6);
            assert!(sample.amplitude > 0.0 && sample.amplitude <= 1.0);
        }
    }
}

#[test]
fn noise_has_the_declared_standard_deviations() {
    let camera = CameraTruth::published(1).unwrap();
    let simulation = Simulation::new(camera, Kind::General(1), &[], 11);
    let options = PointOptions { sigma_px: 0.1, ..PointOptions::default() };
    for noise in [Noise::default(), Noise { tail_dof: Some(5.0), ..Noise::default() }] {
        let noisy = simulation.clone().noise(noise).observe_points(&options).unwrap();
        let quiet = simulation.clone().noise(Noise::none()).observe_points(&exact()).unwrap();
        let (mut pixels, mut depths) = (Vec::new(), Vec::new());
        for (a, b) in noisy.frames.iter().zip(&quiet.frames) {
            for (a, b) in a.markers.iter().zip(&b.markers) {
                pixels.push((a.pixel[0] - b.pixel[0]) / a.sigma_px);
                pixels.push((a.pixel[1] - b.pixel[1]) / a.sigma_px);
            }
            for (a, b) in a.depths.iter().zip(&b.depths) {
                assert_eq!(a.pixel, b.pixel);
                depths.push((1.0 / a.z_mm - 1.0 / b.z_mm) / a.sigma_rho);
            }
        }
        for values in [pixels, depths] {
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
            assert!(mean.abs() < 4.0 / n.sqrt(), "{mean}");
            assert!((variance - 1.0).abs() < if noise.tail_dof.is_some() { 0.3 } else { 0.08 }, "{variance}");
        }
    }
}

#[test]
fn the_seed_decides_and_effects_leave_poses_and_noise_alone() {
    let camera = CameraTruth::published(1).unwrap();
    let observe = |effects: &[Effect], seed| {
        Simulation::new(camera, Kind::Plywood1, effects, seed).observe_points(&PointOptions::default()).unwrap()
    };
    let plain = observe(&[], 5);
    assert_eq!(plain, observe(&[], 5));
    assert_ne!(plain.truth.frames, observe(&[], 6).truth.frames);
    let offset = observe(&[Effect::new("range_offset", 4.0).unwrap()], 5);
    assert_eq!(plain.truth.frames, offset.truth.frames);
    for (a, b) in plain.frames.iter().zip(&offset.frames) {
        assert_eq!(a.markers[0].pixel, b.markers[0].pixel);
        let change = b.depths[0].z_mm - a.depths[0].z_mm;
        assert!((2.0..5.0).contains(&change), "{change}");
    }
}

#[test]
fn defects_hit_the_frames_that_the_truth_names() {
    let camera = CameraTruth::published(1).unwrap();
    let defects = Defects {
        bad_frames: 2,
        duplicated_frames: 1,
        swapped_depth_pairs: 1,
        depth_unit_factor: 1.1,
        ..Default::default()
    };
    let plain = clean(camera);
    let good = plain.observe_points(&exact()).unwrap();
    let points = plain.defects(defects).observe_points(&exact()).unwrap();
    let hit = &points.truth.defective;
    assert_eq!((hit.bad.len(), hit.duplicated.len(), hit.swapped.len()), (2, 1, 1));
    let [original, copy] = hit.duplicated[0];
    assert_eq!(points.frames[original].markers, points.frames[copy].markers);
    assert_eq!(points.frames[original].depths, points.frames[copy].depths);
    for &bad in &hit.bad {
        assert_eq!(points.frames[bad].markers[0].pixel, good.frames[bad].markers[0].pixel);
        assert_ne!(points.truth.frames[bad].pose, points.truth.frames[bad].depth_pose);
    }
    let untouched = (0..27).find(|i| !hit.bad.contains(i) && *i != copy && !hit.swapped[0].contains(i)).unwrap();
    let ratio = points.frames[untouched].depths[0].z_mm / good.frames[untouched].depths[0].z_mm;
    assert!((ratio - 1.1).abs() < 1e-12);
}
