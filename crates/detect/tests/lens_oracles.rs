//! The lens pieces against OpenCV's projections: `projectPoints` with 4, 5, 8, 12 and 14 coefficients and
//! `fisheye::projectPoints`, ten thousand random points each.

#![cfg(feature = "opencv")]

use depthcal_model::{Block, Camera, Register};
use nalgebra::Vector3;
use opencv::core::{Mat, Point2d, Point3d, Vec3d, Vector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const POINTS: usize = 10_000;
/// Rounding of coordinates of up to a thousand pixels, of some dozen operations each.
const TOLERANCE_PX: f64 = 1e-9;
const PINHOLE: [f64; 5] = [476.9, 475.1, 312.9, 242.5, 0.0];

fn camera(pieces: &[(&str, &[f64])]) -> Camera {
    let block = |(name, theta): &(&str, &[f64])| {
        let mut block: Block = Register::builtin().block(name, None).unwrap();
        block.theta[..theta.len()].copy_from_slice(theta);
        block
    };
    Camera::new(640, 480, PINHOLE, pieces.iter().map(block).collect())
}

fn matrix() -> Mat {
    let [fx, fy, cx, cy, _] = PINHOLE;
    Mat::from_slice_2d(&[[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]).unwrap()
}

/// Random points within `degrees` of the axis, 0.1 to 5 m away.
fn points(rng: &mut ChaCha8Rng, degrees: f64) -> Vec<Point3d> {
    let point = |_| {
        let (angle, azimuth) =
            (rng.random_range(0.0..degrees).to_radians(), rng.random_range(0.0..std::f64::consts::TAU));
        let z = rng.random_range(100.0..5000.0);
        Point3d::new(z * angle.tan() * azimuth.cos(), z * angle.tan() * azimuth.sin(), z)
    };
    (0..POINTS).map(point).collect()
}

fn compare(camera: &Camera, points: &[Point3d], theirs: &Vector<Point2d>, what: &str) {
    assert_eq!(theirs.len(), POINTS);
    let mut compared = 0;
    for (point, pixel) in points.iter().zip(theirs.iter()) {
        // Beyond its fold the lens has no image here; OpenCV gives one.
        let Some([u, v]) = camera.project(&Vector3::new(point.x, point.y, point.z)) else { continue };
        let error = (u - pixel.x).hypot(v - pixel.y);
        assert!(error <= TOLERANCE_PX, "{what}: {error:e} px at {point:?}");
        compared += 1;
    }
    assert!(compared > POINTS * 9 / 10, "{what}: only {compared} points within the lens");
}

#[test]
fn opencvs_distortion_with_all_numbers_of_coefficients() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let scales = [0.1, 0.05, 5e-3, 5e-3, 0.02, 0.1, 0.05, 0.02, 3e-3, 1e-3, 3e-3, 1e-3, 0.03, 0.03];
    for count in [4, 5, 8, 12, 14] {
        let k: Vec<f64> = scales[..count].iter().map(|s| s * rng.random_range(-1.0..1.0)).collect();
        let points = points(&mut rng, 40.0);
        let mut theirs = Vector::<Point2d>::new();
        let (object, distortion) = (Vector::<Point3d>::from_slice(&points), Mat::from_slice(&k).unwrap());
        let zero = Vec3d::default();
        opencv::calib3d::project_points_def(&object, &zero, &zero, &matrix(), &distortion, &mut theirs).unwrap();
        let name = if count <= 5 { "brown_conrady" } else { "opencv_lens" };
        compare(&camera(&[(name, &k)]), &points, &theirs, &format!("{count} coefficients"));
        // The same as the effects that `diagnose` adds.
        if count > 5 {
            let mut padded = k.clone();
            padded.resize(14, 0.0);
            let pieces = [
                ("brown_conrady", &padded[..5]),
                ("thin_prism", &padded[8..12]),
                ("tilted_sensor", &padded[12..]),
                ("rational_distortion", &padded[5..8]),
            ];
            compare(&camera(&pieces), &points, &theirs, &format!("{count} coefficients as effects"));
        }
    }
}

#[test]
fn opencvs_fisheye() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    for _ in 0..3 {
        let k: Vec<f64> = [0.05, 0.02, 0.005, 0.001].iter().map(|s| s * rng.random_range(-1.0..1.0)).collect();
        let points = points(&mut rng, 80.0);
        let mut theirs = Vector::<Point2d>::new();
        let (object, distortion) = (Vector::<Point3d>::from_slice(&points), Mat::from_slice(&k).unwrap());
        let zero = Vec3d::default();
        opencv::calib3d::fisheye_project_points_vec_def(&object, &mut theirs, &zero, &zero, &matrix(), &distortion)
            .unwrap();
        compare(&camera(&[("kannala_brandt", &k)]), &points, &theirs, "fisheye");
    }
}

/// The division model against its definition: the distorted radius r_d gives back the undistorted one, r_d / (1 + λ r_d²).
#[test]
fn the_division_model_is_its_definition() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    for lambda in [-0.4, -0.05, 0.1] {
        let camera = camera(&[("division", &[lambda])]);
        for point in points(&mut rng, if lambda > 0.0 { 55.0 } else { 80.0 }) {
            let [u, v] = camera.project(&Vector3::new(point.x, point.y, point.z)).unwrap();
            let (x, y) = ((u - PINHOLE[2]) / PINHOLE[0], (v - PINHOLE[3]) / PINHOLE[1]);
            let scale = 1.0 + lambda * (x * x + y * y);
            let error = (x / scale - point.x / point.z).hypot(y / scale - point.y / point.z);
            assert!(
                error < 1e-11 * (1.0 + (point.x / point.z).hypot(point.y / point.z).powi(2)),
                "{lambda}: {error:e}"
            );
        }
    }
}
