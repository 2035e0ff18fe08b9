//! Properties of the results that hold for every camera and every frame, checked on random cases (with a fixed seed).

use depthcal_io::DepthImage;
use depthcal_model::{Block, Camera, Register};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

use crate::conventions::pixel;
use crate::prepared::PreparedCamera;
use crate::tests::block;
use crate::{CorrectionSummary, Corrector, FrameContext, PointsMut};

/// Two chunks, and not a multiple of the length of any block.
const WIDTH: usize = 67;
const HEIGHT: usize = 23;

/// A map whose values go up and down by `size`.
fn map(name: &str, size: f64, phase: f64) -> Block {
    let mut block = Register::builtin().block(name, None).unwrap();
    block.theta.iter_mut().enumerate().for_each(|(i, value)| *value += size * (0.9 * i as f64 + phase).sin());
    block
}

/// Depth pieces: each kind of table of a Möbius map, and a multiplier map with bins over depth.
fn pieces() -> impl Strategy<Value = Vec<Block>> {
    let projective =
        [-3e-4..3e-4, -1e-4..1e-4, -1e-5..1e-5, 0.8..1.25f64].prop_map(|theta| block("projective", &theta));
    let of_size =
        |name: &'static str, most: f64| (0.0..most, 0.0..6.0f64).prop_map(move |(size, phase)| map(name, size, phase));
    prop_oneof![
        projective.clone().prop_map(|p| vec![p]),
        of_size("multiplier@bins=1", 0.1).prop_map(|m| vec![m]),
        of_size("bspline", 2e-5).prop_map(|b| vec![b]),
        (projective.clone(), of_size("multiplier@bins=1", 0.1)).prop_map(|(p, m)| vec![p, m]),
        (projective.clone(), -30.0..30.0f64).prop_map(|(p, c)| vec![block("range_offset", &[c]), p]),
        of_size("multiplier", 0.1).prop_map(|m| vec![m]),
        (projective, of_size("multiplier@bins=5", 0.05)).prop_map(|(p, m)| vec![p, m]),
    ]
}

fn runner() -> TestRunner {
    let seed = TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]);
    TestRunner::new_with_rng(Config { cases: 60, failure_persistence: None, ..Config::default() }, seed)
}

#[test]
fn sixteen_bits_are_the_exact_inverse_rounded() {
    let frames = (pieces(), prop_oneof![Just(1.0), 0.1..1.0f64, 1.0..5.0f64], 0u64..1 << 40, 0..3u32);
    let worst = std::cell::Cell::new(0.0f64);
    let outcome = runner().run(&frames, |(pieces, unit_mm, seed, range)| {
        let lens = block("brown_conrady", &[-0.1468, 0.0463, 0.0012, -0.0007, -0.0756]);
        let pieces = [lens].into_iter().chain(pieces).collect();
        let camera = Camera::new(WIDTH, HEIGHT, [58.0, 58.0, 32.9, 11.2, 0.0], pieces);
        let corrector = Corrector::new(&camera).unwrap();
        let prepared = PreparedCamera::new(&camera).unwrap();
        // The working range; the whole range of the type, with poles; very few steps.
        let [least, most] = [[200.0 / unit_mm, 4000.0 / unit_mm], [0.0, 66_000.0], [0.0, 30.0]][range as usize];
        let of_pixel = |i: u64| {
            let fraction = ((i + seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f64 / (1u64 << 24) as f64;
            if i % 13 == 4 { 0 } else { (least + (most - least) * fraction) as u16 }
        };
        let data: Vec<u16> = (0..(WIDTH * HEIGHT) as u64).map(of_pixel).collect();
        let measured = DepthImage { width: WIDTH, height: HEIGHT, data };
        let mut out = DepthImage { width: WIDTH, height: HEIGHT, data: vec![7; WIDTH * HEIGHT] };
        let context = FrameContext::default();
        let summary = corrector.correct_u16(&measured, unit_mm, &context, &mut out).unwrap();
        let mut expected = CorrectionSummary::default();
        for (i, (raw, corrected)) in measured.data.iter().zip(&out.data).enumerate() {
            if !DepthImage::is_measurement(*raw) {
                prop_assert_eq!(*corrected, 0);
                expected.invalid += 1;
                continue;
            }
            let of_pixel = context.at(pixel(i, WIDTH), i);
            let Some(depth_mm) = prepared.invert(&of_pixel, i, f64::from(*raw) * unit_mm, 1.0) else {
                if *corrected == 0 {
                    expected.not_correctable += 1;
                    continue;
                }
                // Nearer than an offset, the camera's iteration fails. The result must then map back to the measured
                // depth.
                let ray = prepared.rays[i];
                let back = camera.measured_inverse_depth(&of_pixel, ray, 1.0, 1.0 / (f64::from(*corrected) * unit_mm));
                let miss = 1.0 / back / unit_mm - f64::from(*raw);
                prop_assert!(miss.abs() < 2.0, "pixel {}: {} steps become {}", i, raw, corrected);
                expected.corrected += 1;
                continue;
            };
            expected.corrected += 1;
            let steps = depth_mm / unit_mm;
            expected.saturated += usize::from(!(0.5..65535.5).contains(&steps));
            let error = (f64::from(*corrected) - steps.clamp(1.0, 65535.0)).abs();
            prop_assert!(error <= 0.501, "pixel {}: {} steps become {}, not {}", i, raw, corrected, steps);
            worst.set(worst.get().max(error));
        }
        prop_assert_eq!((summary.invalid, summary.corrected), (expected.invalid, expected.corrected));
        prop_assert_eq!(summary.not_correctable, expected.not_correctable);
        // A result within rounding of a limit may or may not count as beyond it.
        prop_assert!(summary.saturated.abs_diff(expected.saturated) <= 1);
        let mut in_place = measured;
        prop_assert_eq!(corrector.correct_u16_buffer_in_place(&mut in_place.data, unit_mm, &context).unwrap(), summary);
        prop_assert_eq!(in_place, out);
        Ok(())
    });
    outcome.unwrap();
    println!("largest deviation {:.5} steps", worst.get());
}

#[test]
fn points_are_corrected_depth_times_ray() {
    let frames = (pieces(), 0u64..1 << 40);
    let outcome = runner().run(&frames, |(pieces, seed)| {
        let lens = block("brown_conrady", &[-0.1468, 0.0463, 0.0012, -0.0007, -0.0756]);
        let pieces = [lens].into_iter().chain(pieces).collect();
        let camera = Camera::new(WIDTH, HEIGHT, [58.0, 58.0, 32.9, 11.2, 0.0], pieces);
        let corrector = Corrector::new(&camera).unwrap();
        let prepared = PreparedCamera::new(&camera).unwrap();
        let n = WIDTH * HEIGHT;
        let of_pixel = |i: u64| if i % 11 == 2 { 0 } else { 300 + ((i + seed).wrapping_mul(40_503) % 3000) as u16 };
        let measured = DepthImage { width: WIDTH, height: HEIGHT, data: (0..n as u64).map(of_pixel).collect() };
        let context = FrameContext::default();
        let (mut depth, mut points) = (vec![0.0f32; n], vec![0.0f32; 3 * n]);
        corrector.correct_u16_to_f32(&measured, 1.0, &context, &mut depth).unwrap();
        let out = PointsMut::Interleaved(&mut points);
        let summary = corrector.correct_to_points(&measured, 1.0, &context, out).unwrap();
        prop_assert_eq!(summary.invalid, measured.data.iter().filter(|raw| **raw == 0).count());
        let uncorrected = corrector.points(&measured, 1.0).unwrap();
        for i in 0..n {
            let [x, y, z] = [0, 1, 2].map(|k| points[3 * i + k]);
            let ray = prepared.rays[i].map(|k| k as f32);
            prop_assert_eq!(z.is_nan(), depth[i] == 0.0 || ray[0].is_nan());
            if !z.is_nan() {
                // r comes from a table for depth, from the rays for points; the two differ by rounding.
                prop_assert!((z - depth[i]).abs() < 0.005 && x == ray[0] * z && y == ray[1] * z);
            }
            let [x, y, z] = uncorrected[i];
            prop_assert_eq!(z.is_nan(), measured.data[i] == 0 || ray[0].is_nan());
            prop_assert!(z.is_nan() || (z == f32::from(measured.data[i]) && x == ray[0] * z && y == ray[1] * z));
        }
        Ok(())
    });
    outcome.unwrap();
}

/// Cameras write 0 or 65535 where they measure nothing: both become 0, or no point, wherever they are, and change nothing else.
#[test]
fn what_is_no_measurement_becomes_nothing_and_changes_nothing_else() {
    let frames = (pieces(), prop_oneof![Just(1.0), 0.1..1.0f64, 1.0..5.0f64], 0u64..1 << 40, 2u64..40, 2u64..40);
    let outcome = runner().run(&frames, |(pieces, unit_mm, seed, zeros, greatest)| {
        let lens = block("brown_conrady", &[-0.1468, 0.0463, 0.0012, -0.0007, -0.0756]);
        let pieces = [lens].into_iter().chain(pieces).collect();
        let corrector = Corrector::new(&Camera::new(WIDTH, HEIGHT, [58.0, 58.0, 32.9, 11.2, 0.0], pieces)).unwrap();
        let n = WIDTH * HEIGHT;
        let random = |i: u64| (i + seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33;
        let image = |data: Vec<u16>| DepthImage { width: WIDTH, height: HEIGHT, data };
        let whole: Vec<u16> = (0..n as u64).map(|i| ((200 + random(i) % 3800) as f64 / unit_mm) as u16).collect();
        let whole = image(whole.into_iter().map(|raw| raw.clamp(1, u16::MAX - 1)).collect());
        let with_holes = whole.data.iter().zip(0u64..).map(|(raw, i)| match random(i + 7) {
            r if r % zeros == 0 => 0,
            r if r % greatest == 1 => u16::MAX,
            _ => *raw,
        });
        let holes = image(with_holes.collect());
        let is_hole = |i: usize| !DepthImage::is_measurement(holes.data[i]);
        let invalid = (0..n).filter(|i| is_hole(*i)).count();
        let context = FrameContext::default();

        let (mut expected, mut out) = (image(vec![7; n]), image(vec![7; n]));
        corrector.correct_u16(&whole, unit_mm, &context, &mut expected).unwrap();
        let summary = corrector.correct_u16(&holes, unit_mm, &context, &mut out).unwrap();
        prop_assert_eq!(summary.invalid, invalid);
        prop_assert_eq!(summary.corrected + summary.invalid + summary.not_correctable, n);
        for i in 0..n {
            // A chunk is corrected in f32 or in f64, by its largest depth, which may lie in a hole: the same to 0.501 steps.
            let (with_holes, without) = (out.data[i], expected.data[i]);
            let same = with_holes.abs_diff(without) <= 1 && (with_holes == 0) == (without == 0);
            let as_expected = if is_hole(i) { with_holes == 0 } else { same };
            prop_assert!(as_expected, "pixel {}: {}, not {}", i, with_holes, without);
        }
        let mut in_place = holes.clone();
        prop_assert_eq!(corrector.correct_u16_buffer_in_place(&mut in_place.data, unit_mm, &context).unwrap(), summary);
        prop_assert_eq!(&in_place, &out);

        let (mut expected, mut out) = (vec![7.0f32; n], vec![7.0f32; n]);
        corrector.correct_u16_to_f32(&whole, unit_mm, &context, &mut expected).unwrap();
        let summary = corrector.correct_u16_to_f32(&holes, unit_mm, &context, &mut out).unwrap();
        prop_assert_eq!(summary.invalid, invalid);
        let as_expected = |i: usize| out[i] == if is_hole(i) { 0.0 } else { expected[i] };
        prop_assert!((0..n).all(as_expected));

        let (mut expected, mut out) = (vec![7.0f32; 3 * n], vec![7.0f32; 3 * n]);
        corrector.correct_to_points(&whole, unit_mm, &context, PointsMut::Interleaved(&mut expected)).unwrap();
        let points = PointsMut::Interleaved(&mut out);
        prop_assert_eq!(corrector.correct_to_points(&holes, unit_mm, &context, points).unwrap().invalid, invalid);
        let uncorrected = [&whole, &holes].map(|depth| corrector.points(depth, unit_mm).unwrap());
        for i in 0..n {
            let pairs = [
                [&expected[3 * i..3 * i + 3], &out[3 * i..3 * i + 3]],
                [&uncorrected[0][i][..], &uncorrected[1][i][..]],
            ];
            for [without, with_holes] in pairs {
                let same = |(a, b): (&f32, &f32)| (a - b).abs() <= 0.005 || (a.is_nan() && b.is_nan());
                let none = with_holes.iter().all(|c| c.is_nan());
                let as_expected = if is_hole(i) { none } else { with_holes.iter().zip(without).all(same) };
                prop_assert!(as_expected, "pixel {}: {:?}, not {:?}", i, with_holes, without);
            }
        }
        Ok(())
    });
    outcome.unwrap();
}
