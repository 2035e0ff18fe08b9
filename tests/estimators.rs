//! The estimators of D on exact and on noisy markers.

use depthcal::calibration::estimators::{EstimatorError, MarkerPoint, irls, linear, nonlinear};
use nalgebra::{Vector3, Vector4};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// Markers all over the working volume, measured through D with noise of σ_ρ (1/mm).
fn points(d: &Vector4<f64>, sigma: f64, n: usize, seed: u64) -> Vec<MarkerPoint> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, sigma).unwrap();
    (0..n)
        .map(|_| {
            let z = rng.random_range(300.0..1200.0);
            let ray: [f64; 2] = [rng.random_range(-0.6..0.6), rng.random_range(-0.45..0.45)];
            let rho = d.dot(&Vector4::new(ray[0], ray[1], 1.0, 1.0 / z));
            MarkerPoint {
                point_in_camera: Vector3::new(ray[0] * z, ray[1] * z, z),
                ray,
                inverse_depth: rho + noise.sample(&mut rng),
            }
        })
        .collect()
}

fn camera_2() -> Vector4<f64> {
    Vector4::new(1.7984e-4, 1.908e-5, -3.684e-5, 1.0393758)
}

/// Sum of squared distances of thesis eq. 4.18, written out independently.
fn cost(points: &[MarkerPoint], d: &Vector4<f64>) -> f64 {
    let distance = |p: &MarkerPoint| {
        let rho = (p.inverse_depth - d[0] * p.ray[0] - d[1] * p.ray[1] - d[2]) / d[3];
        (Vector3::new(p.ray[0], p.ray[1], 1.0) / rho - p.point_in_camera).norm_squared()
    };
    points.iter().map(distance).sum()
}

#[test]
fn exact_markers_give_every_subset_of_d_exactly() {
    for mask in 0..16_u32 {
        let free: [bool; 4] = std::array::from_fn(|i| mask >> i & 1 == 1);
        let nominal = Vector4::new(0.0, 0.0, 0.0, 1.0);
        let truth = Vector4::from_fn(|i, _| if free[i] { camera_2()[i] } else { nominal[i] });
        let points = points(&truth, 0.0, 200, 7);
        for estimate in [linear(&points, free), irls(&points, free), nonlinear(&points, free)] {
            let estimate = estimate.unwrap();
            for i in 0..4 {
                // d is of the order of 1e-5; 1e-12 of it is rounding.
                assert!(
                    (estimate[i] - truth[i]).abs() < 1e-12 + 1e-10 * truth[i].abs(),
                    "{free:?}: {estimate} for {truth}"
                );
            }
        }
    }
}

#[test]
fn the_nonlinear_estimate_is_a_minimum_of_the_distances() {
    let points = points(&camera_2(), 2e-6, 500, 8);
    let d = nonlinear(&points, [true; 4]).unwrap();
    let best = cost(&points, &d);
    assert!(best < cost(&points, &linear(&points, [true; 4]).unwrap()));
    for (i, h) in [1e-7, 1e-7, 1e-7, 1e-4].into_iter().enumerate() {
        for sign in [-1.0, 1.0] {
            let mut moved = d;
            moved[i] += sign * h;
            assert!(cost(&points, &moved) > best, "parameter {i}");
        }
    }
}

#[test]
fn reweighting_resists_outliers() {
    let mut points = points(&camera_2(), 1e-6, 300, 9);
    for p in points.iter_mut().step_by(15) {
        p.inverse_depth *= 1.2;
    }
    // Error of the correction in mm over the volume, not of single parameters, which trade off.
    let error = |d: &Vector4<f64>| {
        let error_at = |x: f64, z: f64| {
            let rho = camera_2().dot(&Vector4::new(x, 0.1, 1.0, 1.0 / z));
            (1.0 / ((rho - d[0] * x - d[1] * 0.1 - d[2]) / d[3]) - z).abs()
        };
        [-0.5, 0.0, 0.5].into_iter().flat_map(|x| [400.0, 800.0, 1200.0].map(|z| error_at(x, z))).fold(0.0, f64::max)
    };
    let (plain, robust) = (linear(&points, [true; 4]).unwrap(), irls(&points, [true; 4]).unwrap());
    assert!(error(&robust) < 0.1 * error(&plain), "{} mm against {} mm", error(&robust), error(&plain));
    assert!(error(&robust) < 3.0, "{} mm", error(&robust));
}

#[test]
fn markers_in_one_plane_parallel_to_the_image_are_refused() {
    let flat: Vec<MarkerPoint> = points(&camera_2(), 0.0, 100, 10)
        .into_iter()
        .map(|p| {
            let point_in_camera = Vector3::new(p.ray[0], p.ray[1], 1.0) * 800.0;
            let rho = camera_2().dot(&Vector4::new(p.ray[0], p.ray[1], 1.0, 1.0 / 800.0));
            MarkerPoint { point_in_camera, ray: p.ray, inverse_depth: rho }
        })
        .collect();
    let error = linear(&flat, [true; 4]).unwrap_err();
    assert!(matches!(&error, EstimatorError::Degenerate { free } if free == "dx, dy, dz, dw"));
    assert!(error.to_string().contains("several distances"), "{error}");
    assert!(linear(&flat, [true, true, false, true]).is_ok(), "without dz the plane suffices");
    assert!(matches!(linear(&flat[..2], [true; 4]), Err(EstimatorError::TooFewPoints { found: 2, needed: 4 })));
}
