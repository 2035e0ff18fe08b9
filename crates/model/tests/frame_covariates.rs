//! The light of whole frames against sums over all pixels as the definitions have them.

use depthcal_model::frame_covariates::{BLOCK_PX, NEAR_PX, NEAR_REACH, NEAR_WEIGHTS, SPREAD_PX};
use depthcal_model::{FrameCovariates, Modulation, StrayLight};

const SIZE: [usize; 2] = [147, 101];
const LIGHT_MM_PER_S: f64 = 299_792_458e3;

/// A wall, a nearer object in front of it, and a pattern of amplitudes.
fn range_mm(u: usize, v: usize) -> f64 {
    let wall = 1900.0 + 3.0 * u as f64 - 2.0 * v as f64;
    if (40..90).contains(&u) && (30..80).contains(&v) { 700.0 + 0.8 * v as f64 } else { wall }
}

fn amplitudes() -> Vec<u16> {
    let amplitude = |i: usize| {
        let (u, v) = (i % SIZE[0], i / SIZE[0]);
        let checks = if (u / 9 + v / 7) % 2 == 0 { 300 } else { 2900 };
        (checks + (i * 7919) % 211) as u16
    };
    (0..SIZE[0] * SIZE[1]).map(amplitude).collect()
}

/// Σ w A exp(i 4π f r/c) / Σ w over all pixels.
fn scene(amplitude: &[u16], range_mm: &dyn Fn(usize, usize) -> f64, f_mhz: f64, [u, v]: [usize; 2]) -> [f64; 2] {
    let (mut sum, mut total) = ([0.0; 2], 0.0);
    for (i, a) in amplitude.iter().enumerate() {
        let (x, y) = (i % SIZE[0], i / SIZE[0]);
        let d2 = (x as f64 - u as f64).powi(2) + (y as f64 - v as f64).powi(2);
        let w = (-d2 / (2.0 * SPREAD_PX * SPREAD_PX)).exp();
        let phase = 4.0 * std::f64::consts::PI * f_mhz * 1e6 * range_mm(x, y) / LIGHT_MM_PER_S;
        total += w;
        sum[0] += w * f64::from(*a) * phase.cos();
        sum[1] += w * f64::from(*a) * phase.sin();
    }
    sum.map(|s| s / total)
}

fn mean_3x3(image: &dyn Fn(i64, i64) -> Option<f64>, [u, v]: [usize; 2]) -> f64 {
    let ring = (-1..=1).flat_map(|dv| (-1..=1).map(move |du| (u as i64 + du, v as i64 + dv)));
    let values: Vec<f64> = ring.filter_map(|(x, y)| image(x, y)).collect();
    values.iter().sum::<f64>() / values.len() as f64
}

fn at(amplitude: &[u16], x: i64, y: i64) -> Option<f64> {
    let inside = x >= 0 && y >= 0 && (x as usize) < SIZE[0] && (y as usize) < SIZE[1];
    inside.then(|| f64::from(amplitude[y as usize * SIZE[0] + x as usize]))
}

/// Pixels in the middle, at borders and in corners.
const PIXELS: [[usize; 2]; 7] = [[0, 0], [73, 50], [146, 100], [13, 100], [146, 3], [64, 48], [41, 31]];

fn close(light: StrayLight, expected: [[f64; 2]; 3], near: f64, tolerance: f64) -> bool {
    let length = |p: &[f64; 2]| p[0].hypot(p[1]);
    let scale = expected.iter().map(length).fold(0.0, f64::max);
    let parts = light.scene.iter().flatten().zip(expected.iter().flatten());
    parts.map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max) < tolerance * scale
        && (f64::from(light.near) - near).abs() < 1e-4 * near
}

#[test]
fn covariates_are_sums_over_all_pixels() {
    let amplitude = amplitudes();
    let image = |x, y| at(&amplitude, x, y);
    // The near light within the image's middle, where its window is whole: smoothed first, then averaged.
    let spread = |x: i64, y: i64| {
        let reach = 3;
        let taps = || (-reach..=reach).flat_map(|dv| (-reach..=reach).map(move |du| (du, dv)));
        let weight = |du: i64, dv: i64| (-((du * du + dv * dv) as f64) / (2.0 * NEAR_PX * NEAR_PX)).exp();
        let sum: Option<f64> = taps().map(|(du, dv)| Some(weight(du, dv) * image(x + du, y + dv)?)).sum();
        Some(sum? / taps().map(|(du, dv)| weight(du, dv)).sum::<f64>())
    };
    for modulation in [Modulation::default(), Modulation { mhz: [20.0, 0.0, 0.0] }] {
        let range = |i: usize| range_mm(i % SIZE[0], i / SIZE[0]) as f32;
        let covariates = FrameCovariates::new(modulation, SIZE, &amplitude, range).unwrap();
        for pixel in PIXELS {
            let local = mean_3x3(&image, pixel);
            let expected = modulation.mhz.map(|f| scene(&amplitude, &range_mm, f, pixel).map(|p| p / local));
            let light = covariates.at(&amplitude, pixel);
            let inside = (4..SIZE[0] - 4).contains(&pixel[0]) && (4..SIZE[1] - 4).contains(&pixel[1]);
            let near = if inside { mean_3x3(&spread, pixel) / local } else { f64::from(light.near) };
            assert!(close(light, expected, near, 2e-3), "{pixel:?}: {light:?}, expected {expected:?} and {near}");
        }
    }
}

#[test]
fn the_near_window_is_that_of_its_definition() {
    let gauss: Vec<f64> = (-3..=3).map(|i| (-f64::from(i * i) / (2.0 * NEAR_PX * NEAR_PX)).exp()).collect();
    let total: f64 = gauss.iter().sum();
    for (i, weight) in NEAR_WEIGHTS.iter().enumerate() {
        let shifted = |shift: usize| i.checked_sub(shift).and_then(|j| gauss.get(j)).copied().unwrap_or(0.0);
        let expected = (shifted(0) + shifted(1) + shifted(2)) / (3.0 * total);
        assert!((f64::from(*weight) - expected).abs() < 1e-7, "{i}: {weight} {expected}");
    }
    assert!((f64::from(NEAR_WEIGHTS.iter().sum::<f32>()) - 1.0).abs() < 1e-6);
    // An image without contrast is as bright around a pixel as at it, at its borders too.
    let flat = vec![1234; SIZE[0] * SIZE[1]];
    let covariates = FrameCovariates::new(Modulation::default(), SIZE, &flat, |_| 1000.0).unwrap();
    for pixel in PIXELS {
        assert!((covariates.at(&flat, pixel).near - 1.0).abs() < 1e-5, "{pixel:?}");
    }
    assert_eq!(NEAR_REACH, 4);
}

/// Pixels without a range: single ones, and a part of the frame with many blocks. They have that of the nearest pixels with one.
#[test]
fn invalid_pixels_have_the_range_of_their_neighbours() {
    let amplitude = amplitudes();
    // The right part of the frame at one distance, so that the nearest valid neighbours of all invalid pixels have it too.
    let wall = |u: usize, v: usize| if u < 60 { range_mm(u, v) } else { 1500.0 };
    let invalid = |u: usize, v: usize| u >= 100 || (u < 60 && (u * 31 + v * 17).is_multiple_of(23));
    for none in [0.0, f32::NAN, f32::INFINITY, -1.0] {
        let range = |i: usize| {
            let (u, v) = (i % SIZE[0], i / SIZE[0]);
            if invalid(u, v) { none } else { wall(u, v) as f32 }
        };
        let covariates = FrameCovariates::new(Modulation::default(), SIZE, &amplitude, range).unwrap();
        for pixel in PIXELS {
            let local = mean_3x3(&|x, y| at(&amplitude, x, y), pixel);
            let expected = Modulation::default().mhz.map(|f| scene(&amplitude, &wall, f, pixel).map(|p| p / local));
            let light = covariates.at(&amplitude, pixel);
            assert!(close(light, expected, f64::from(light.near), 0.02), "{none} {pixel:?}: {light:?}, {expected:?}");
        }
    }
}

/// A band without a range between two walls: its upper half is at the upper wall, its lower half at the lower one.
#[test]
fn invalid_pixels_between_two_walls_have_the_range_of_the_nearer_one() {
    let amplitude = amplitudes();
    // Four of seven rows of blocks.
    let wall = |_: usize, v: usize| if v < 3 * BLOCK_PX { 900.0 } else { 1500.0 };
    let band = BLOCK_PX..5 * BLOCK_PX;
    let range = |i: usize| if band.contains(&(i / SIZE[0])) { 0.0 } else { wall(0, i / SIZE[0]) as f32 };
    let covariates = FrameCovariates::new(Modulation::default(), SIZE, &amplitude, range).unwrap();
    for pixel in PIXELS {
        let local = mean_3x3(&|x, y| at(&amplitude, x, y), pixel);
        let expected = Modulation::default().mhz.map(|f| scene(&amplitude, &wall, f, pixel).map(|p| p / local));
        let light = covariates.at(&amplitude, pixel);
        assert!(close(light, expected, f64::from(light.near), 2e-3), "{pixel:?}: {light:?}, {expected:?}");
    }
}

#[test]
fn frames_without_anything_have_no_light() {
    let amplitude = amplitudes();
    let new = |amplitude: &[u16], range: f32| FrameCovariates::new(Modulation::default(), SIZE, amplitude, |_| range);
    assert!(new(&amplitude, 0.0).is_none(), "no depth");
    assert!(new(&amplitude[1..], 900.0).is_none(), "another size");
    assert!(new(&vec![0; amplitude.len()], 900.0).is_none(), "no light");
    assert!(FrameCovariates::new(Modulation::default(), [0, 0], &[], |_| 900.0).is_none(), "no pixels");
    // A pixel without any signal around it has no share of stray light.
    let mut dark = amplitude.clone();
    for v in 9..=13 {
        dark[v * SIZE[0] + 20..][..5].fill(0);
    }
    let covariates = new(&dark, 900.0).unwrap();
    assert!(!covariates.at(&dark, [22, 11]).is_known() && covariates.at(&dark, [30, 11]).is_known());
}
