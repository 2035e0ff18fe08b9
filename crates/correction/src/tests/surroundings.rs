//! Effects of the infrared amplitude around a pixel, against sums over the window as its definition has them.

use depthcal_model::hook::{Depth, DepthState};
use depthcal_model::{Parameter, Piece, SURROUND_PX, Scalar};

use super::*;

/// Depends on the amplitude around the pixel alone, not on that of the pixel itself.
#[derive(Debug)]
struct BrightSurroundings;

impl Piece<Depth, 1> for BrightSurroundings {
    const NAME: &'static str = "bright_surroundings";
    const SUMMARY: &'static str = "bright surroundings pull";
    const EQUATION: &'static str = "z + m ln Ā";
    const SOURCE: &'static str = "a test";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("m", "mm", 0.0, 1.0)];

    fn map<T: Scalar>(&self, s: DepthState<T>, [m]: [T; 1], c: &Context) -> T {
        if c.surround > 0.0 { s.rho / (m * c.surround.ln() * s.rho + 1.0) } else { s.rho }
    }
}

/// Squares from dark to bright, some pixels without signal.
fn amplitudes() -> GrayImage {
    let of_pixel = |i: usize| match i % 101 {
        7 => 0,
        _ => [90, 260, 800, 2400][(i % WIDTH / 11 + i / WIDTH / 9) % 4] + (i * 37 % 60) as u16,
    };
    GrayImage { width: WIDTH, height: HEIGHT, data: (0..WIDTH * HEIGHT).map(of_pixel).collect(), bits: 16 }
}

/// The context of a pixel by the definition: a Gaussian cut off at two standard deviations and at the border.
fn by_definition(image: &GrayImage, index: usize) -> Context {
    let (u, v) = ((index % WIDTH) as f64, (index / WIDTH) as f64);
    let (mut total, mut sum, mut moment) = (0.0, 0.0, [0.0; 2]);
    for (i, amplitude) in image.data.iter().enumerate() {
        let (du, dv) = ((i % WIDTH) as f64 - u, (i / WIDTH) as f64 - v);
        if du.abs().max(dv.abs()) <= 2.0 * SURROUND_PX {
            let weight = (-(du * du + dv * dv) / (2.0 * SURROUND_PX * SURROUND_PX)).exp();
            let weighted = weight * f64::from(*amplitude);
            (total, sum) = (total + weight, sum + weighted);
            moment = [moment[0] + weighted * du, moment[1] + weighted * dv];
        }
    }
    Context {
        pixel: pixel(index, WIDTH),
        amplitude: f64::from(image.data[index]),
        surround: sum / total,
        slope: moment.map(|m| m / (sum * SURROUND_PX * SURROUND_PX)),
        ..Context::default()
    }
}

#[test]
fn the_amplitude_around_pixels_is_taken_from_the_image() {
    let mut register = Register::builtin();
    register.add(|_| BrightSurroundings);
    let mut alone = register.block("bright_surroundings", None).unwrap();
    alone.theta = vec![3.0];
    let amplitude = amplitudes();
    let known = FrameContext { amplitude: Some((&amplitude).into()), ..FrameContext::default() };
    let measured: Vec<f32> = depths(300.0, 4000.0).map(|z| z as f32).collect();
    for mixing in [block("signal_mixing", &[4.0, -0.9, 25.0, -14.0]), alone] {
        let name = mixing.name().to_owned();
        let bare = camera(&[PROJECTIVE]);
        let pieces = bare.blocks().iter().filter(|block| block.piece().is_some()).cloned().chain([mixing]);
        let camera = Camera::new(WIDTH, HEIGHT, bare.pinhole(), pieces.collect());
        let corrector = Corrector::new(&camera).unwrap();
        assert_eq!(corrector.needs(), Needs { amplitude: true, surroundings: true, ..Needs::default() }, "{name}");
        let mut out = vec![0.0; measured.len()];
        corrector.correct_f32(&measured, &known, &mut out).unwrap();
        let mut without = vec![0.0; measured.len()];
        corrector.correct_f32(&measured, &FrameContext::default(), &mut without).unwrap();
        let mut largest = 0.0_f64;
        for index in (0..measured.len()).step_by(53).chain([0, WIDTH - 1, WIDTH * HEIGHT - 1]) {
            let true_mm =
                |context: &Context| 1.0 / camera.correct(context, 1.0, 1.0 / f64::from(measured[index])).unwrap().1;
            let expected = true_mm(&by_definition(&amplitude, index));
            assert!(
                (f64::from(out[index]) - expected).abs() < 0.01,
                "{name}, pixel {index}: {} {expected}",
                out[index]
            );
            let unknown = true_mm(&Context { pixel: pixel(index, WIDTH), ..Context::default() });
            assert!((f64::from(without[index]) - unknown).abs() < 0.01, "{name}, pixel {index}");
            largest = largest.max((expected - unknown).abs());
        }
        assert!(largest > 5.0, "{name}: the effect is {largest} mm at most");
    }
}
