//! The corrector against the camera's own inverse in f64.

mod fast_paths;
mod fisheye;
mod random_cases;
mod stray_light;
mod surroundings;

use depthcal_io::{DepthImage, GrayImage};
use depthcal_model::{Block, Camera, Context, Register};

use crate::conventions::pixel;
use crate::{CorrectionSummary, Corrector, CorrectorError, FrameContext, Needs, PointsMut, Rays};

const WIDTH: usize = 160;
const HEIGHT: usize = 120;

/// A piece of the register with these parameters.
pub fn block(name: &str, theta: &[f64]) -> Block {
    let mut block = Register::builtin().block(name, None).unwrap();
    block.theta = theta.to_vec();
    block
}

/// The lens of the thesis' camera 1 on a small image, with further pieces.
fn camera(pieces: &[(&str, &[f64])]) -> Camera {
    let lens = block("brown_conrady", &[-0.1468, 0.0463, 0.0012, -0.0007, -0.0756]);
    let pieces = pieces.iter().map(|(name, theta)| block(name, theta));
    Camera::new(WIDTH, HEIGHT, [140.0, 139.0, 77.9, 60.2, 0.0], [lens].into_iter().chain(pieces).collect())
}

const PROJECTIVE: (&str, &[f64]) = ("projective", &[1.3406e-4, -3.52e-6, -6.99e-6, 1.00604654]);
const CYCLIC: (&str, &[f64]) = ("cyclic_depth", &[3.0, -2.0, 0.5, 1.0]);
const REGISTRATION: (&str, &[f64]) = ("depth_registration", &[1.7, -0.6]);

/// Depths from `near` to `far`, neighbours far from each other.
fn depths(near: f64, far: f64) -> impl Iterator<Item = f64> {
    (0..WIDTH * HEIGHT).map(move |i| near + (far - near) * (i as f64 * 0.618_033_988_749_895).fract())
}

fn image(data: Vec<u16>) -> DepthImage {
    DepthImage { width: WIDTH, height: HEIGHT, data }
}

fn blank() -> DepthImage {
    image(vec![7; WIDTH * HEIGHT])
}

/// Largest error of 16-bit results, steps: a half by rounding, and a thousandth by the errors of f32 before rounding.
const HALF_A_STEP: f64 = 0.501;

/// True depth of a measured one, mm, by the camera's own inverse.
fn reference(camera: &Camera, context: &FrameContext<'_>, index: usize, measured_mm: f64) -> f64 {
    let context = context.at(pixel(index, WIDTH), index);
    1.0 / camera.correct(&context, 1.0, 1.0 / measured_mm).unwrap().1
}

#[test]
fn agrees_with_the_camera() {
    let models: [&[(&str, &[f64])]; 5] = [
        &[],
        &[PROJECTIVE],
        &[PROJECTIVE, REGISTRATION],
        &[PROJECTIVE, CYCLIC],
        &[PROJECTIVE, CYCLIC, REGISTRATION, ("focus_breathing", &[1.5])],
    ];
    let context = FrameContext::default();
    for pieces in models {
        let camera = camera(pieces);
        let corrector = Corrector::new(&camera).unwrap();
        // Rays that depend on depth together with a depth model that oscillates: the only built-in case without tables.
        let moving = pieces.iter().any(|(name, _)| *name == "focus_breathing");
        assert_eq!(corrector.has_tables(), !moving, "{pieces:?}");
        let measured: Vec<f32> = depths(300.0, 4000.0).map(|z| z as f32).collect();
        let mut corrected = vec![0.0; measured.len()];
        let summary = corrector.correct_f32(&measured, &context, &mut corrected).unwrap();
        assert_eq!(summary, CorrectionSummary { corrected: measured.len(), ..CorrectionSummary::default() });
        for index in 0..measured.len() {
            let expected = reference(&camera, &context, index, f64::from(measured[index]));
            assert!((f64::from(corrected[index]) - expected).abs() < 0.01, "{pieces:?}: pixel {index}");
        }

        for unit in [1.0, 0.25] {
            let measured = image(depths(300.0 / unit, 4000.0 / unit).map(|z| z as u16).collect());
            let mut corrected = blank();
            corrector.correct_u16(&measured, unit, &context, &mut corrected).unwrap();
            for index in 0..measured.data.len() {
                let expected = reference(&camera, &context, index, f64::from(measured.data[index]) * unit) / unit;
                let error = f64::from(corrected.data[index]) - expected;
                assert!(error.abs() <= HALF_A_STEP, "{pieces:?}: pixel {index}: {error}");
            }
        }
    }
}

/// Changes of some 15 000 steps, whose f32 has steps of a thousandth: they are computed in f64.
#[test]
fn large_changes_are_rounded_as_precisely_as_small_ones() {
    for factor in (0..20).map(|i| 1.27 + 0.0017 * f64::from(i)) {
        let camera = camera(&[("projective", &[0.0, 0.0, 0.0, factor])]);
        let measured = image(depths(40_000.0, 48_000.0).map(|z| z as u16).collect());
        let mut corrected = blank();
        Corrector::new(&camera).unwrap().correct_u16(&measured, 1.0, &FrameContext::default(), &mut corrected).unwrap();
        for index in 0..measured.data.len() {
            let raw = f64::from(measured.data[index]);
            let error = f64::from(corrected.data[index]) - reference(&camera, &FrameContext::default(), index, raw);
            assert!(error.abs() <= HALF_A_STEP, "{factor}: {raw}: {error}");
        }
    }
}

#[test]
fn invalid_stays_invalid_and_results_saturate() {
    // z = z_m / 2 and z = 2 z_m.
    let halved = Corrector::new(&camera(&[("projective", &[0.0, 0.0, 0.0, 0.5])])).unwrap();
    let doubled = Corrector::new(&camera(&[("projective", &[0.0, 0.0, 0.0, 2.0])])).unwrap();
    let context = FrameContext::default();
    let mut measured = image(vec![1000; WIDTH * HEIGHT]);
    measured.data[..5].copy_from_slice(&[0, 1, 40_000, 65_534, 65_535]);
    let mut out = blank();
    let summary = doubled.correct_u16(&measured, 0.1, &context, &mut out).unwrap();
    assert_eq!(out.data[..6], [0, 2, 65_535, 65_535, 0, 2000]);
    let corrected = WIDTH * HEIGHT - 2;
    assert_eq!(summary, CorrectionSummary { corrected, saturated: 2, invalid: 2, not_correctable: 0 });
    let summary = halved.correct_u16(&measured, 5.0, &context, &mut out).unwrap();
    assert_eq!(out.data[..6], [0, 1, 20_000, 32_767, 0, 500]);
    assert_eq!(summary.saturated, 0);

    let mut measured = vec![1000.0f32; WIDTH * HEIGHT];
    measured[..5].copy_from_slice(&[0.0, -5.0, f32::NAN, f32::INFINITY, f32::MAX]);
    let mut out = vec![7.0f32; WIDTH * HEIGHT];
    let summary = doubled.correct_f32(&measured, &context, &mut out).unwrap();
    assert_eq!(out[..6], [0.0, 0.0, 0.0, 0.0, f32::MAX, 2000.0]);
    assert_eq!((summary.invalid, summary.saturated), (4, 1));
}

#[test]
fn what_has_no_inverse_becomes_invalid_and_is_counted() {
    // ρ_m = ρ + 1/2000: no true depth is measured as more than 2000 mm.
    let offset = ("projective", &[0.0, 0.0, 5e-4, 1.0][..]);
    let context = FrameContext::default();
    let mut measured = image(vec![1000; WIDTH * HEIGHT]);
    measured.data[..3].copy_from_slice(&[2000, 2500, 0]);
    for pieces in [vec![offset], vec![offset, CYCLIC]] {
        let mut out = blank();
        let corrector = Corrector::new(&camera(&pieces)).unwrap();
        let summary = corrector.correct_u16(&measured, 1.0, &context, &mut out).unwrap();
        assert_eq!(out.data[..3], [0; 3]);
        assert_eq!((summary.not_correctable, summary.invalid), (2, 1), "{pieces:?}");
    }
    // A lens whose image folds before the corners, and a model that turns depth around.
    let folding = block("brown_conrady", &[-0.6, 0.0, 0.0, 0.0, 0.0]);
    let corrector =
        Corrector::new(&Camera::new(WIDTH, HEIGHT, [119.2, 119.2, 79.5, 59.5, 0.0], vec![folding])).unwrap();
    let mut out = blank();
    let summary = corrector.correct_u16(&measured, 1.0, &context, &mut out).unwrap();
    assert!(summary.not_correctable > 100 && summary.corrected > WIDTH * HEIGHT / 2, "{summary:?}");
    assert_eq!(out.data[WIDTH * HEIGHT - 1], 0);
    let corrector = Corrector::new(&camera(&[("projective", &[0.0, 0.0, 5e-3, -1.0])])).unwrap();
    assert_eq!(corrector.correct_u16(&measured, 1.0, &context, &mut out).unwrap().corrected, 0);
}

#[test]
fn effects_of_time_temperature_and_amplitude_are_taken_from_the_frame() {
    let camera = camera(&[
        PROJECTIVE,
        ("temporal_drift", &[1e-2, 1e-6]),
        ("temperature_drift", &[1e-3, 1e-7]),
        ("reflectivity_bias", &[4.0, 1.0, 0.0]),
    ]);
    let corrector = Corrector::new(&camera).unwrap();
    assert_eq!(corrector.needs(), Needs { time: true, temperature: true, amplitude: true, ..Needs::default() });
    let data = (0..WIDTH * HEIGHT).map(|i| 100 + (i % 3000) as u16).collect();
    let amplitude = GrayImage { width: WIDTH, height: HEIGHT, data, bits: 16 };
    let known = FrameContext {
        time_s: 250.0,
        temperature_c: 41.0,
        amplitude: Some((&amplitude).into()),
        ..FrameContext::default()
    };
    let unknown = FrameContext::default();
    let of_model = Context { time_s: 250.0, temperature_c: 41.0, ..Context::default() };
    let measured: Vec<f32> = depths(300.0, 4000.0).map(|z| z as f32).collect();
    let mut results = [vec![0.0; measured.len()], vec![0.0; measured.len()]];
    for ((context, frame), out) in [(known, of_model), (unknown, Context::default())].into_iter().zip(&mut results) {
        corrector.correct_f32(&measured, &context, out).unwrap();
        for index in (0..measured.len()).step_by(7) {
            let signal = context.amplitude.map_or(f64::NAN, |image| f64::from(image.data[index]));
            let context = Context { pixel: pixel(index, WIDTH), amplitude: signal, ..frame };
            let expected = 1.0 / camera.correct(&context, 1.0, 1.0 / f64::from(measured[index])).unwrap().1;
            assert!((f64::from(out[index]) - expected).abs() < 0.01);
        }
    }
    let difference = results[0].iter().zip(&results[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(difference > 20.0, "{difference}");
}

#[test]
fn the_angle_of_incidence_comes_from_the_neighbours() {
    // A plane tilted by 60°, seen with a bias of 8 mm (1 / cos θ − 1).
    let camera = camera(&[PROJECTIVE, ("incidence_bias", &[8.0])]);
    let corrector = Corrector::new(&camera).unwrap();
    assert!(corrector.needs().incidence);
    let (sin, cos) = 60f64.to_radians().sin_cos();
    let mut truth = Vec::new();
    let mut measured = Vec::new();
    for index in 0..WIDTH * HEIGHT {
        let context = Context { pixel: pixel(index, WIDTH), ..Context::default() };
        let [x, y] = camera.ray(context.pixel, 1e-3).unwrap();
        let rho = (sin * x + cos) / (1000.0 * cos);
        let cosine = (sin * x + cos) / (1.0 + x * x + y * y).sqrt();
        let seen = rho > 1.0 / 3000.0 && cosine > 0.3;
        truth.push(1.0 / rho);
        let rho = camera.measured_inverse_depth(&context, [x, y], cosine, rho);
        measured.push(if seen { (1.0 / rho) as f32 } else { 0.0 });
    }
    let mut out = vec![0.0; measured.len()];
    corrector.correct_f32(&measured, &FrameContext::default(), &mut out).unwrap();
    // Correction that takes the angle to be a right one.
    let straight = |i: usize| reference(&camera, &FrameContext::default(), i, f64::from(measured[i]));
    let valid = || (0..truth.len()).filter(|i| measured[*i] > 0.0);
    let before = valid().map(|i| (straight(i) - truth[i]).abs()).fold(0.0, f64::max);
    let after = valid().map(|i| (f64::from(out[i]) - truth[i]).abs()).fold(0.0, f64::max);
    assert!(before > 15.0 && after < 0.5, "{before} {after}");
    // The surface at a pixel without neighbours is unknown, and taken to be seen at a right angle.
    let lone = HEIGHT / 2 * WIDTH + WIDTH / 2;
    let mut alone = vec![0.0; measured.len()];
    alone[lone] = 1000.0;
    corrector.correct_f32(&alone, &FrameContext::default(), &mut out).unwrap();
    let expected = reference(&camera, &FrameContext::default(), lone, 1000.0);
    assert!((f64::from(out[lone]) - expected).abs() < 1e-3);
}

#[test]
fn points_lie_on_the_true_rays() {
    for pieces in [vec![PROJECTIVE, REGISTRATION], vec![PROJECTIVE, ("focus_breathing", &[20.0][..])]] {
        let camera = camera(&pieces);
        let corrector = Corrector::new(&camera).unwrap();
        let mut corrected = image(depths(300.0, 4000.0).map(|z| (2.0 * z) as u16).collect());
        corrected.data[5] = 0;
        let points = corrector.points(&corrected, 0.5).unwrap();
        assert_eq!(points.len(), WIDTH * HEIGHT);
        assert!(points[5].iter().all(|c| c.is_nan()));
        for (index, point) in points.iter().enumerate().filter(|(i, _)| *i != 5) {
            let [x, y, z] = point.map(f64::from);
            assert_eq!(z, f64::from(corrected.data[index]) * 0.5);
            let seen = camera.project(&nalgebra::Vector3::new(x, y, z)).unwrap();
            let context = Context { pixel: pixel(index, WIDTH), ..Context::default() };
            let expected = camera.image_pixel(&context);
            assert!((seen[0] - expected[0]).hypot(seen[1] - expected[1]) < 1e-4);
        }
        let millimetres: Vec<f32> = corrected.data.iter().map(|z| f32::from(*z) * 0.5).collect();
        let mut again = vec![[0.0; 3]; points.len()];
        corrector.points_f32_into(&millimetres, PointsMut::Interleaved(again.as_flattened_mut())).unwrap();
        assert!(again.iter().zip(&points).all(|(a, b)| a.map(f32::to_bits) == b.map(f32::to_bits)));
    }
}

#[test]
fn wrong_sizes_units_and_cameras_are_refused() {
    let corrector = Corrector::new(&camera(&[PROJECTIVE])).unwrap();
    let context = FrameContext::default();
    let small = DepthImage { width: 4, height: 3, data: vec![1000; 12] };
    let torn = DepthImage { data: vec![1000; 12], ..blank() };
    let error = corrector.correct_u16(&small, 1.0, &context, &mut blank()).unwrap_err();
    assert_eq!(error, CorrectorError::Size { what: "the depth image", found: (4, 3), expected: (WIDTH, HEIGHT) });
    assert!(error.to_string().contains("4×3") && error.to_string().contains("160×120"));
    assert!(matches!(
        corrector.correct_u16(&blank(), 1.0, &context, &mut small.clone()),
        Err(CorrectorError::Size { .. })
    ));
    assert!(matches!(
        corrector.correct_u16(&torn, 1.0, &context, &mut blank()),
        Err(CorrectorError::Length { found: 12, .. })
    ));
    assert!(matches!(corrector.correct_f32(&[1.0], &context, &mut [0.0]), Err(CorrectorError::Length { .. })));
    assert!(matches!(corrector.points(&small, 1.0), Err(CorrectorError::Size { .. })));
    for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut out = blank();
        let result = corrector.correct_u16(&blank(), unit, &context, &mut out);
        assert!(matches!(result, Err(CorrectorError::Unit { .. })));
        assert_eq!(out, blank());
    }
    let amplitude = GrayImage { width: 2, height: 2, data: vec![0; 4], bits: 8 };
    let context = FrameContext { amplitude: Some((&amplitude).into()), ..context };
    let error = corrector.correct_u16(&blank(), 1.0, &context, &mut blank()).unwrap_err();
    assert!(matches!(error, CorrectorError::Size { what: "the amplitude image", .. }));

    let empty = Camera::new(0, 480, [500.0, 500.0, 0.0, 0.0, 0.0], Vec::new());
    assert_eq!(Corrector::new(&empty).unwrap_err(), CorrectorError::Empty { width: 0, height: 480 });
    let broken = Camera::new(4, 3, [f64::NAN; 5], Vec::new());
    assert!(matches!(Corrector::new(&broken), Err(CorrectorError::NoRay { .. })));
}

/// Every kind of stage, and stacks of them, against the camera's own inverse in f64.
#[test]
fn every_model_has_tables_that_agree_with_the_camera() {
    let register = Register::builtin();
    let field = |name: &str, size: f64| {
        let mut block = register.block(name, None).unwrap();
        for (i, value) in block.theta.iter_mut().enumerate() {
            *value += size * (0.9 * i as f64).sin();
        }
        block
    };
    let wide_alpha = |mut block: Block| {
        // The last parameter is the decay itself.
        *block.theta.last_mut().unwrap() = 350.0;
        block
    };
    let mut polynomial = register.block("polynomial_map", None).unwrap();
    for (i, value) in polynomial.theta.iter_mut().enumerate() {
        *value = [3.0, 4e-3, 2e-6][i % 3] * (1.3 * i as f64).sin();
    }
    let projective = block(PROJECTIVE.0, PROJECTIVE.1);
    let models: Vec<Vec<Block>> = vec![
        vec![field("bspline", 5e-6)],
        vec![field("free_map", 5e-6), projective.clone()],
        vec![field("multiplier", 0.01)],
        vec![field("multiplier@bins=1", 0.01)],
        vec![projective.clone(), field("multiplier@bins=5", 0.01)],
        vec![wide_alpha(field("disparity_decay", 5e-6))],
        vec![polynomial],
        vec![block("range_offset", &[7.0]), block("radial_range", &[0.05]), projective.clone()],
        vec![block("projector_distortion", &[1e-5, -1e-5, 2e-5, 1e-5])],
        vec![projective.clone(), block("disparity_ripple", &[1e-6, -5e-7])],
        vec![block("quadratic_depth", &[5e-6, 1e-10]), projective.clone(), field("bspline", 5e-6)],
        vec![block("focus_breathing", &[3.0]), projective],
    ];
    for blocks in models {
        let names: Vec<&str> = blocks.iter().map(Block::name).collect();
        let lens = block("brown_conrady", &[-0.1468, 0.0463, 0.0012, -0.0007, -0.0756]);
        let pieces = [lens].into_iter().chain(blocks.iter().cloned()).collect();
        let camera = Camera::new(WIDTH, HEIGHT, [140.0, 139.0, 77.9, 60.2, 0.0], pieces);
        let corrector = Corrector::new(&camera).unwrap();
        assert!(corrector.has_tables(), "{names:?}");
        let context = FrameContext::default();
        let measured: Vec<f32> = depths(400.0, 3500.0).map(|z| z as f32).collect();
        let mut out = measured.clone();
        corrector.correct_f32_in_place(&mut out, &context).unwrap();
        for index in (0..measured.len()).step_by(3) {
            let expected = reference(&camera, &context, index, f64::from(measured[index]));
            let error = f64::from(out[index]) - expected;
            assert!(error.abs() < 0.01, "{names:?}: pixel {index}, {} mm: {error}", measured[index]);
        }
        let mut steps = image(depths(400.0, 3500.0).map(|z| z as u16).collect());
        let before = steps.clone();
        corrector.correct_u16_buffer_in_place(&mut steps.data, 1.0, &context).unwrap();
        let breathes = names.contains(&"focus_breathing");
        for index in (0..measured.len()).step_by(3) {
            let expected = reference(&camera, &context, index, f64::from(before.data[index]));
            let error = f64::from(steps.data[index]) - expected;
            assert!(error.abs() <= if breathes { 0.51 } else { HALF_A_STEP }, "{names:?}: pixel {index}: {error}");
        }
    }
}

#[test]
fn rays_of_all_pixels_agree_with_the_camera() {
    for pieces in [vec![], vec![REGISTRATION], vec![("thin_prism", &[1e-3, 0.0, -1e-3, 0.0][..])]] {
        let camera = camera(&pieces);
        let rays = Rays::new(&camera);
        let n = WIDTH * HEIGHT;
        let (mut x, mut y, mut x32, mut y32) = (vec![0.0; n], vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        rays.double([&mut x, &mut y]).unwrap();
        rays.single([&mut x32, &mut y32]).unwrap();
        assert!(rays.single([&mut x32[1..], &mut y32.clone()]).is_err());
        for i in 0..n {
            let context = Context { pixel: pixel(i, WIDTH), ..Context::default() };
            let [u, v] = camera.image_pixel(&context);
            let seen = |x: f64, y: f64| camera.project(&[x, y, 1.0].into()).unwrap();
            let miss = |[a, b]: [f64; 2]| (a - u).hypot(b - v);
            assert!(miss(seen(x[i], y[i])) < 1e-9, "pixel {i}: {}", miss(seen(x[i], y[i])));
            assert!(miss(seen(f64::from(x32[i]), f64::from(y32[i]))) < 1e-3);
        }
    }
}

#[test]
fn pixels_beyond_the_lens_have_no_ray() {
    // Wide enough for the lens of `camera` to fold before the corners.
    let lens = block("brown_conrady", &[-0.1468, 0.0463, 0.0012, -0.0007, -0.0756]);
    let wide = Camera::new(WIDTH, HEIGHT, [105.0, 105.0, 78.2, 60.6, 0.0], vec![lens]);
    let n = WIDTH * HEIGHT;
    let (mut x, mut y, mut x32, mut y32) = (vec![0.0; n], vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    Rays::new(&wide).double([&mut x, &mut y]).unwrap();
    Rays::new(&wide).single([&mut x32, &mut y32]).unwrap();
    let expected: Vec<_> = (0..n).map(|i| wide.ray(pixel(i, WIDTH), 1e-3).ok()).collect();
    assert!(expected.iter().filter(|ray| ray.is_none()).count() > 20);
    for i in 0..n {
        let Some([ex, ey]) = expected[i] else {
            assert!(x[i].is_nan() && y[i].is_nan() && x32[i].is_nan() && y32[i].is_nan(), "pixel {i}");
            continue;
        };
        assert!((x[i] - ex).hypot(y[i] - ey) < 1e-11, "pixel {i}");
        assert!((f64::from(x32[i]) - ex).hypot(f64::from(y32[i]) - ey) < 1e-5, "pixel {i}");
    }
}

#[test]
fn all_outputs_agree_and_do_not_depend_on_the_threads() {
    let corrector = Corrector::new(&camera(&[PROJECTIVE])).unwrap();
    let context = FrameContext::default();
    let mut measured = image(depths(300.0, 4000.0).map(|z| z as u16).collect());
    measured.data[77] = 0;
    let of_threads = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let n = WIDTH * HEIGHT;
            let (mut depth, mut steps) = (vec![0.0f32; n], blank());
            corrector.correct_u16_to_f32(&measured, 1.0, &context, &mut depth).unwrap();
            corrector.correct_u16(&measured, 1.0, &context, &mut steps).unwrap();
            let mut points = vec![0.0f32; 3 * n];
            corrector.correct_to_points(&measured, 1.0, &context, PointsMut::Interleaved(&mut points)).unwrap();
            let (mut x, mut y, mut z) = (vec![0.0f32; n], vec![0.0f32; n], vec![0.0f32; n]);
            let planes = PointsMut::Planes([&mut x, &mut y, &mut z]);
            corrector.correct_to_points(&measured, 1.0, &context, planes).unwrap();
            for i in 0..n {
                let point = &points[3 * i..3 * i + 3];
                // Planes are computed by another loop, whose quotients may differ in the last digit.
                let alike = |(a, b): (&f32, f32)| (a - b).abs() <= 4e-7 * b.abs() || (a.is_nan() && b.is_nan());
                assert!(point.iter().zip([x[i], y[i], z[i]]).all(alike));
                if i == 77 {
                    assert!(point.iter().all(|c| c.is_nan()) && steps.data[i] == 0 && depth[i] == 0.0);
                    continue;
                }
                assert!((point[2] - depth[i]).abs() < 0.002 && (depth[i] - f32::from(steps.data[i])).abs() < 0.502);
            }
            (depth, steps, points.into_iter().map(f32::to_bits).collect::<Vec<u32>>())
        })
    });
    assert!(of_threads[0] == of_threads[1]);
}

#[test]
fn points_do_not_depend_on_where_they_are_written_and_pixels_without_a_ray_have_none() {
    // The image of this lens folds before the corners. The width is not a multiple of the length of any block.
    let (width, height) = (163, 121);
    let pieces = vec![block("brown_conrady", &[-0.6, 0.0, 0.0, 0.0, 0.0]), block(PROJECTIVE.0, PROJECTIVE.1)];
    let corrector = Corrector::new(&Camera::new(width, height, [119.2, 119.2, 80.5, 59.5, 0.0], pieces)).unwrap();
    let n = width * height;
    let data = (0..n).map(|i| if i % 13 == 4 { 0 } else { 400 + (i * 37 % 3000) as u16 }).collect();
    let measured = DepthImage { width, height, data };
    let context = FrameContext::default();
    let mut steps = measured.clone();
    let expected = corrector.correct_u16(&measured, 1.0, &context, &mut steps).unwrap();
    assert!(expected.not_correctable > 100 && expected.corrected > n / 2, "{expected:?}");
    let mut buffer = vec![0.0f32; 3 * n + 40];
    let mut first: Option<[Vec<u32>; 2]> = None;
    for offset in 0..20 {
        let place = &mut buffer[offset..offset + 3 * n];
        let summary =
            corrector.correct_to_points(&measured, 1.0, &context, PointsMut::Interleaved(&mut *place)).unwrap();
        assert_eq!(summary, CorrectionSummary { saturated: 0, ..expected });
        for (point, depth) in place.chunks_exact(3).zip(&steps.data) {
            if *depth == 0 {
                assert!(point.iter().all(|c| c.is_nan()));
            } else {
                assert!((point[2] - f32::from(*depth)).abs() < 0.502);
            }
        }
        let corrected: Vec<u32> = place.iter().map(|c| c.to_bits()).collect();
        corrector.points_into(&measured, 1.0, PointsMut::Interleaved(&mut *place)).unwrap();
        let straight: Vec<u32> = place.iter().map(|c| c.to_bits()).collect();
        let first = first.get_or_insert_with(|| [corrected.clone(), straight.clone()]);
        assert!(*first == [corrected, straight], "offset {offset}");
    }
}

/// Buffers give the same results as images, at every alignment, and nothing is written outside of them.
#[test]
fn buffers_are_corrected_as_images() {
    let context = FrameContext::default();
    for pieces in [&[PROJECTIVE][..], &[PROJECTIVE, CYCLIC]] {
        let corrector = Corrector::new(&camera(pieces)).unwrap();
        let measured = image(depths(0.0, 5000.0).map(|z| z as u16).collect());
        let mut expected = blank();
        let summary = corrector.correct_u16(&measured, 1.0, &context, &mut expected).unwrap();
        for shift in [0, 1, 5, 31] {
            let from: Vec<u16> = std::iter::repeat_n(9, shift).chain(measured.data.iter().copied()).collect();
            let mut to = vec![7; from.len()];
            let counts = corrector.correct_u16_buffer(&from[shift..], 1.0, &context, &mut to[shift..]).unwrap();
            assert_eq!((&to[shift..], counts), (&expected.data[..], summary), "{shift}");
            assert!(to[..shift].iter().all(|v| *v == 7));
        }
        let short = corrector.correct_u16_buffer(&measured.data[1..], 1.0, &context, &mut expected.data);
        assert!(matches!(short, Err(CorrectorError::Length { .. })), "{short:?}");
    }
}
