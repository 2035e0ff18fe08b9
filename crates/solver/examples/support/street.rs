//! Synthetic problems of bundle adjustment in the text format of Bundle Adjustment in the Large.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::Write;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Standard deviation of observations, px.
pub const SIGMA: f64 = 0.5;
/// Points per camera.
const POINTS: usize = 60;
/// Distance from one camera to the next, m, and of the walls from the path.
const STEP: f64 = 1.0;
const WALLS: [f64; 2] = [6.0, 12.0];
/// f in px, k₁, k₂, and half of the image's width in px.
const LENS: [f64; 3] = [800.0, -0.05, 0.01];
const HALF: f64 = 500.0;

/// A problem of `count` cameras that go around a block once and look at walls on the outer side, with 60 points a camera and
/// 0.5 px of noise; the same in every run. Consecutive cameras see much in common, and the last ones what the first ones see.
/// Start values are off by some 0.02 rad, 0.2 m and 1 % of the focal length.
pub fn generate(count: usize) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(count as u64);
    let radius = STEP * count as f64 / TAU;
    let place = |turn: f64, outward: f64, up: f64| {
        let (s, c) = (turn * TAU).sin_cos();
        Vector3::new((radius + outward) * c, (radius + outward) * s, up)
    };
    let cameras: Vec<Isometry3<f64>> = (0..count)
        .map(|i| {
            let turn = i as f64 / count as f64;
            let centre = place(turn, 0.3 * normal(&mut rng), 0.2 * normal(&mut rng));
            // The camera looks along −z with y up: outwards, and somewhat to one side.
            let aside = 0.3 * normal(&mut rng);
            let world_from_camera = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn * TAU - FRAC_PI_2 + aside)
                * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
            Isometry3::from_parts(Translation3::from(centre), world_from_camera).inverse()
        })
        .collect();
    let mut observations = Vec::new();
    let mut points = Vec::new();
    while points.len() < POINTS * count {
        let turn = rng.random::<f64>();
        let point = place(turn, rng.random_range(WALLS[0]..WALLS[1]), rng.random_range(-3.0..3.0));
        let seen: Vec<(usize, [f64; 2])> =
            cameras.iter().enumerate().filter_map(|(i, camera)| Some((i, project(camera, &point)?))).collect();
        // A point that few cameras see may have no depth.
        if seen.len() >= 3 {
            for (camera, [u, v]) in seen {
                let noisy = [u + SIGMA * normal(&mut rng), v + SIGMA * normal(&mut rng)];
                observations.push((camera, points.len(), noisy));
            }
            points.push(point);
        }
    }
    write(&cameras, &points, &observations, &mut rng)
}

/// The pixel of a point, from the centre of the image; `None` if it is outside, behind, or far away.
fn project(camera: &Isometry3<f64>, point: &Vector3<f64>) -> Option<[f64; 2]> {
    let x = camera * Point3::from(*point);
    if !(-15.0..-2.0).contains(&x.z) {
        return None;
    }
    let (u, v) = (-x.x / x.z, -x.y / x.z);
    let r2 = u * u + v * v;
    let scale = LENS[0] * (1.0 + r2 * (LENS[1] + LENS[2] * r2));
    (u.abs().max(v.abs()) * LENS[0] < HALF).then_some([scale * u, scale * v])
}

/// A sum of uniform numbers: nearly normal, without tails.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

fn write(
    cameras: &[Isometry3<f64>],
    points: &[Vector3<f64>],
    observations: &[(usize, usize, [f64; 2])],
    rng: &mut ChaCha8Rng,
) -> String {
    let mut text = format!("{} {} {}\n", cameras.len(), points.len(), observations.len());
    for (camera, point, [u, v]) in observations {
        // Writing to a string does not fail.
        writeln!(text, "{camera} {point} {u} {v}").unwrap_or_default();
    }
    let mut numbers = Vec::new();
    for camera in cameras {
        let off = |rng: &mut ChaCha8Rng, size: f64| Vector3::from_fn(|_, _| size * normal(rng));
        // Turned about its own centre, which may be far from the origin.
        let centre = camera.inverse().translation.vector + off(rng, 0.2);
        let rotation = UnitQuaternion::from_scaled_axis(off(rng, 0.02)) * camera.rotation;
        let translation = -(rotation * centre);
        numbers.extend(rotation.scaled_axis().iter().chain(translation.iter()));
        numbers.extend([LENS[0] * (1.0 + 0.01 * normal(rng)), 0.0, 0.0]);
    }
    for point in points {
        numbers.extend(point.iter().map(|x| x + 0.1 * normal(rng)));
    }
    numbers.iter().for_each(|x| writeln!(text, "{x}").unwrap_or_default());
    text
}
