//! Jacobians of the whole chain against central differences, for every piece and random states.

use depthcal_model::chain::{Chain, DepthQuery, POSE, Workspace};
use depthcal_model::{Block, Camera, Context, Register, StrayLight, register::Options};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Board poses as a calibration has them: 0.4 to 1.2 m away, tilted up to some 40°.
fn random_pose(rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    let axis = Vector3::new(rng.random_range(-0.6..0.6), rng.random_range(-0.6..0.6), rng.random_range(-0.3..0.3));
    let z = rng.random_range(400.0..1200.0);
    let t = Translation3::new(rng.random_range(-0.2..0.1) * z, rng.random_range(-0.2..0.1) * z, z);
    Isometry3::from_parts(t, UnitQuaternion::from_scaled_axis(axis))
}

/// A camera with the named pieces, every parameter moved off its nominal value by a typical amount.
fn random_camera(rng: &mut ChaCha8Rng, names: &[&str]) -> Camera {
    let register = Register::builtin();
    let pinhole = [476.9, 475.1, 312.9, 242.5, 0.4];
    let blocks = names.iter().map(|name| Block::new(register.piece(name, &Options::new()).unwrap())).collect();
    let camera = Camera::new(640, 480, pinhole, blocks);
    let mut theta = Vec::new();
    for block in camera.blocks() {
        for (p, value) in block.parameters().iter().zip(&block.theta) {
            let off = if block.piece().is_some() { p.scale * rng.random_range(-1.0..1.0) } else { 0.0 };
            theta.push(value + off);
        }
    }
    camera.with_theta(&theta)
}

fn retract(pose: &Isometry3<f64>, i: usize, h: f64) -> Isometry3<f64> {
    let mut d = [0.0; POSE];
    d[i] = h;
    let rotation = pose.rotation * UnitQuaternion::from_scaled_axis(Vector3::new(d[0], d[1], d[2]));
    Isometry3::from_parts(Translation3::from(pose.translation.vector + Vector3::new(d[3], d[4], d[5])), rotation)
}

/// Every Jacobian column of both observation kinds against differences.
fn check(rng: &mut ChaCha8Rng, names: &[&str]) {
    let camera = random_camera(rng, names);
    let (chain, theta, pose) = (camera.chain(), camera.theta(), random_pose(rng));
    let points: Vec<[f64; 2]> = (0..5).map(|_| [rng.random_range(0.0..150.0), rng.random_range(0.0..150.0)]).collect();
    let mut work = Workspace::default();
    let mut image = |theta: &[f64], pose: &Isometry3<f64>, jacobian: Option<&mut [f64]>| {
        let mut pixels = vec![[0.0; 2]; points.len()];
        chain.image(&mut work, theta, pose, &points, &mut pixels, jacobian).unwrap();
        pixels.into_iter().flatten().collect::<Vec<f64>>()
    };
    let columns = POSE + chain.image_parameter_count();
    let mut jacobian = vec![0.0; 2 * points.len() * columns];
    let pixels = image(&theta, &pose, Some(&mut jacobian));
    let steps = steps(&chain);
    compare(names, &jacobian, columns, &theta, &pose, &steps, &mut |t, p| image(t, p, None), 1e-6);

    // Depth pixels near those points, not on the pixel grid; the seeds are off by some mm as they are in an adjustment.
    let queries: Vec<DepthQuery> = points
        .iter()
        .zip(pixels.chunks_exact(2))
        .map(|(w, p)| DepthQuery {
            board_seed: [w[0] + rng.random_range(-3.0..3.0), w[1] + rng.random_range(-3.0..3.0)],
            context: Context {
                pixel: [p[0] + rng.random_range(-2.0..2.0), p[1] + rng.random_range(-2.0..2.0)],
                amplitude: rng.random_range(100.0..5000.0),
                time_s: rng.random_range(0.0..600.0),
                temperature_c: rng.random_range(20.0..45.0),
                surround: rng.random_range(100.0..5000.0),
                slope: [rng.random_range(-0.1..0.1), rng.random_range(-0.1..0.1)],
                stray: StrayLight {
                    scene: std::array::from_fn(|_| [rng.random_range(-5.0..5.0), rng.random_range(-5.0..5.0)]),
                    near: rng.random_range(0.5..2.0),
                },
                ..Context::default()
            },
        })
        .collect();
    let mut work = Workspace::default();
    let mut depth = |theta: &[f64], pose: &Isometry3<f64>, jacobian: Option<&mut [f64]>| {
        let (mut rho, mut board) = (vec![0.0; queries.len()], vec![[0.0; 2]; queries.len()]);
        chain.depth(&mut work, theta, pose, &queries, &mut rho, &mut board, jacobian).unwrap();
        rho
    };
    let columns = POSE + chain.parameter_count();
    let mut jacobian = vec![0.0; queries.len() * columns];
    depth(&theta, &pose, Some(&mut jacobian));
    compare(names, &jacobian, columns, &theta, &pose, &steps, &mut |t, p| depth(t, p, None), 1e-5);
}

/// A difference step per column: small against the scale on which the piece is curved, large against rounding.
fn steps(chain: &Chain) -> Vec<f64> {
    let mut steps = vec![1e-5, 1e-5, 1e-5, 1e-2, 1e-2, 1e-2];
    let mut theta = vec![1e-2; chain.parameter_count()];
    for (piece, offset) in chain.pieces() {
        for (i, p) in piece.parameters().iter().enumerate() {
            theta[offset + i] = 3e-3 * p.scale;
        }
    }
    steps.extend(theta);
    steps
}

/// Predictions for parameters and a pose.
type Predict<'a> = dyn FnMut(&[f64], &Isometry3<f64>) -> Vec<f64> + 'a;

#[allow(clippy::too_many_arguments)]
fn compare(
    names: &[&str],
    jacobian: &[f64],
    columns: usize,
    theta: &[f64],
    pose: &Isometry3<f64>,
    steps: &[f64],
    f: &mut Predict<'_>,
    tolerance: f64,
) {
    for c in 0..columns {
        let h = steps[c];
        let mut at_step = |sign: f64| match c.checked_sub(POSE) {
            None => f(theta, &retract(pose, c, sign * h)),
            Some(i) => {
                let mut moved = theta.to_vec();
                moved[i] += sign * h;
                f(&moved, pose)
            }
        };
        // Central differences at h and h / 2, extrapolated (Richardson): the error is of fourth order in h.
        let (plus, minus, plus_half, minus_half) = (at_step(1.0), at_step(-1.0), at_step(0.5), at_step(-0.5));
        let size = (0..plus.len()).map(|r| jacobian[r * columns + c].abs()).fold(0.0, f64::max);
        let value = plus.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        for r in 0..plus.len() {
            let (whole, half) = ((plus[r] - minus[r]) / (2.0 * h), (plus_half[r] - minus_half[r]) / h);
            let difference = (4.0 * half - whole) / 3.0;
            // Truncation relative to the column's size, and rounding of the two values over the step.
            let allowed = tolerance * size + 1e-11 * value / h;
            let error = (jacobian[r * columns + c] - difference).abs();
            assert!(
                error <= allowed,
                "{names:?}: row {r}, column {c}: {} against {difference} by differences",
                jacobian[r * columns + c]
            );
        }
    }
}

#[test]
fn every_piece_alone_with_lens_and_projective() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let register = Register::builtin();
    for name in register.names() {
        for _ in 0..10 {
            check(&mut rng, &["brown_conrady", "projective", name]);
        }
    }
}

#[test]
fn all_pieces_together() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let register = Register::builtin();
    let names: Vec<&str> = register.names().collect();
    for _ in 0..20 {
        check(&mut rng, &names);
    }
}

/// At identity (no rotation, nominal parameters) many derivatives of careless code vanish.
#[test]
fn derivatives_at_identity_and_nominal_values() {
    let register = Register::builtin();
    let blocks: Vec<Block> =
        register.names().map(|n| Block::new(register.piece(n, &Options::new()).unwrap())).collect();
    let camera = Camera::new(640, 480, [500.0, 500.0, 320.0, 240.0, 0.0], blocks);
    let (chain, theta) = (camera.chain(), camera.theta());
    let pose = Isometry3::translation(-40.0, -60.0, 700.0);
    let points = [[10.0, 20.0], [80.0, 130.0]];
    let mut work = Workspace::default();
    let mut image = |theta: &[f64], pose: &Isometry3<f64>, jacobian: Option<&mut [f64]>| {
        let mut pixels = vec![[0.0; 2]; points.len()];
        chain.image(&mut work, theta, pose, &points, &mut pixels, jacobian).unwrap();
        pixels.into_iter().flatten().collect::<Vec<f64>>()
    };
    let columns = POSE + chain.image_parameter_count();
    let mut jacobian = vec![0.0; 4 * columns];
    image(&theta, &pose, Some(&mut jacobian));
    compare(&["identity"], &jacobian, columns, &theta, &pose, &steps(&chain), &mut |t, p| image(t, p, None), 1e-6);
    assert!((0..3).all(|c| (0..4).any(|r| jacobian[r * columns + c].abs() > 1.0)), "rotation columns vanish");
}

/// Light of a scene some times as bright as the pixel.
const STRAY: StrayLight = StrayLight { scene: [[2.5, 0.9], [-1.3, 1.8], [0.4, -1.9]], near: 1.2 };

#[test]
fn nominal_pieces_do_nothing() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let register = Register::builtin();
    let pinhole = [500.0, 505.0, 320.0, 240.0, 0.0];
    let bare = Camera::new(640, 480, pinhole, Vec::new());
    // Without parameters a fisheye lens is the equidistant projection, not a pinhole.
    for name in register.names().filter(|name| *name != "kannala_brandt") {
        let camera = bare.with_block(Block::new(register.piece(name, &Options::new()).unwrap()));
        for _ in 0..20 {
            let pose = random_pose(&mut rng);
            let x = pose * nalgebra::Point3::new(rng.random_range(0.0..100.0), rng.random_range(0.0..100.0), 0.0);
            let (a, b) = (bare.project(&x.coords).unwrap(), camera.project(&x.coords).unwrap());
            assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 1e-10, "{name} moves pixels");
            let (amplitude, surround, slope) = (500.0, 800.0, [0.05, -0.03]);
            let context = Context {
                pixel: a,
                amplitude,
                surround,
                slope,
                stray: STRAY,
                time_s: 100.0,
                temperature_c: 40.0,
                ..Context::default()
            };
            let rho = 1.0 / x.z;
            let m = camera.measured_inverse_depth(&context, [x.x * rho, x.y * rho], 0.8, rho);
            assert!((m / rho - 1.0).abs() < 1e-14, "{name} changes depth");
        }
    }
}

/// Least share of random rays that a lens must have an image for, so that the round trip is tested.
const LEAST_TESTED: f64 = 0.9;

#[test]
fn projection_and_correction_are_inverted() {
    const SAMPLES: usize = 50;
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let register = Register::builtin();
    for name in register.names() {
        // An offset of the depth image acts between pixel and ray, so the round trip is over depth pixels.
        let camera = random_camera(&mut rng, &["brown_conrady", "projective", name]);
        let mut tested = 0;
        for _ in 0..SAMPLES {
            let z = rng.random_range(300.0..1500.0);
            let (x, y) = (rng.random_range(-0.6..0.6), rng.random_range(-0.45..0.45));
            let Some(pixel) = camera.project(&Vector3::new(x * z, y * z, z)) else { continue };
            let ray = camera.ray(pixel, 1.0 / z).unwrap();
            assert!((ray[0] - x).hypot(ray[1] - y) < 1e-10, "{name}: ray");
            let (amplitude, surround, slope) = (700.0, 1100.0, [0.05, -0.03]);
            let mut context = Context {
                pixel,
                amplitude,
                surround,
                slope,
                stray: STRAY,
                time_s: 50.0,
                temperature_c: 30.0,
                ..Context::default()
            };
            let shift = camera.image_pixel(&context);
            context.pixel = [2.0 * pixel[0] - shift[0], 2.0 * pixel[1] - shift[1]];
            let cos = rng.random_range(0.6..1.0);
            let measured = camera.measured_inverse_depth(&context, [x, y], cos, 1.0 / z);
            let (_, rho) = camera.correct(&context, cos, measured).unwrap();
            assert!((1.0 / rho - z).abs() < 1e-9, "{name}: {} mm against {z} mm", 1.0 / rho);
            tested += 1;
        }
        let share = f64::from(tested) / SAMPLES as f64;
        assert!(share >= LEAST_TESTED, "{name}: only {tested} of {SAMPLES} rays have an image");
    }
}
