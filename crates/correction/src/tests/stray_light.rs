//! Stray light: whole frames against the model's own sums and the camera's own inverse in f64.

use depthcal_model::{FrameCovariates, Modulation, PieceSpec};

use super::*;

/// A camera with the effect, before the projective model and after another effect of the amplitude.
fn camera_of(spec: &str, theta: [f64; 2]) -> Camera {
    let register = Register::builtin();
    let mut stray = register.make(&spec.parse::<PieceSpec>().unwrap(), None).unwrap();
    stray.theta = theta.to_vec();
    let bias = block("reflectivity_bias", &[2.0, 0.3, 0.0]);
    let bare = camera(&[PROJECTIVE]);
    let lens = bare.block("brown_conrady").unwrap().clone();
    let pinhole = [140.0, 139.0, 77.9, 60.2, 0.0];
    Camera::new(WIDTH, HEIGHT, pinhole, vec![lens, bias, stray, block(PROJECTIVE.0, PROJECTIVE.1)])
}

/// Squares from dark to bright.
fn amplitudes() -> GrayImage {
    let of_pixel = |i: usize| [90, 260, 800, 2400][(i % WIDTH / 11 + i / WIDTH / 9) % 4] + (i * 37 % 60) as u16;
    GrayImage { width: WIDTH, height: HEIGHT, data: (0..WIDTH * HEIGHT).map(of_pixel).collect(), bits: 16 }
}

/// Slanted surfaces, steps between them, and pixels without depth.
fn measured() -> DepthImage {
    let of_pixel = |i: usize| match (i % WIDTH, i / WIDTH) {
        (u, v) if (u * 13 + v * 7).is_multiple_of(29) => [0, 65_535][u % 2],
        (u, v) if (30..90).contains(&u) && (20..100).contains(&v) => 700 + (2 * u + v) as u16,
        (u, v) => 1900 + (3 * v) as u16 - u as u16,
    };
    image((0..WIDTH * HEIGHT).map(of_pixel).collect())
}

/// True depth by the model, mm; `None` of an invalid pixel.
fn expected(camera: &Camera, modulation: Modulation, depth: &DepthImage, amplitude: &GrayImage) -> Vec<Option<f64>> {
    let slant = |i: usize| {
        let [x, y] = camera.ray(pixel(i, WIDTH), 1e-3).unwrap();
        (1.0 + x * x + y * y).sqrt()
    };
    let range = |i: usize| match depth.data[i] {
        raw if DepthImage::is_measurement(raw) => (f64::from(raw) * slant(i)) as f32,
        _ => 0.0,
    };
    let covariates = FrameCovariates::new(modulation, [WIDTH, HEIGHT], &amplitude.data, range).unwrap();
    let of_pixel = |(i, raw): (usize, &u16)| {
        let stray = covariates.at(&amplitude.data, [i % WIDTH, i / WIDTH]);
        let amplitude = f64::from(amplitude.data[i]);
        let context = Context { pixel: pixel(i, WIDTH), amplitude, stray, ..Context::default() };
        DepthImage::is_measurement(*raw).then(|| 1.0 / camera.correct(&context, 1.0, 1.0 / f64::from(*raw)).unwrap().1)
    };
    depth.data.iter().enumerate().map(of_pixel).collect()
}

#[test]
fn frames_are_corrected_as_the_model_has_it() {
    let (amplitude, depth) = (amplitudes(), measured());
    let context = FrameContext { amplitude: Some((&amplitude).into()), ..FrameContext::default() };
    // The usual size; one at which dark pixels err by a decimetre; one frequency; the near light alone.
    let cases = [
        ("stray_light", [0.006, 0.057]),
        ("stray_light", [0.06, 0.05]),
        ("stray_light@f1_mhz=20", [0.01, -0.03]),
        ("stray_light", [0.0, 0.06]),
    ];
    for (spec, theta) in cases {
        let camera = camera_of(spec, theta);
        let modulation = Modulation::of(&camera.block("stray_light").unwrap().piece().unwrap().options());
        let corrector = Corrector::new(&camera).unwrap();
        assert!(corrector.has_tables(), "{spec}");
        assert_eq!(corrector.needs(), Needs { amplitude: true, stray_light: true, ..Needs::default() });
        let expected = expected(&camera, modulation, &depth, &amplitude);
        let mut steps = blank();
        corrector.correct_u16(&depth, 1.0, &context, &mut steps).unwrap();
        let mut millimetres = vec![0.0; WIDTH * HEIGHT];
        corrector.correct_u16_to_f32(&depth, 1.0, &context, &mut millimetres).unwrap();
        let mut largest = 0.0_f64;
        for (i, expected) in expected.iter().enumerate() {
            let Some(expected) = expected else {
                assert_eq!((steps.data[i], millimetres[i]), (0, 0.0));
                continue;
            };
            largest = largest.max((expected - f64::from(depth.data[i])).abs());
            let error = (f64::from(millimetres[i]) - expected).abs();
            assert!(error < 0.01, "{spec} {theta:?}, pixel {i}: {} instead of {expected}", millimetres[i]);
            assert!((f64::from(steps.data[i]) - expected).abs() <= 0.51, "{spec} {theta:?}, pixel {i}");
        }
        assert!(largest > 4.0, "{spec}: {largest}");
        // In place, from mm and as points the same.
        let mut in_place = depth.clone();
        corrector.correct_u16_buffer_in_place(&mut in_place.data, 1.0, &context).unwrap();
        assert_eq!(in_place, steps);
        let mut from_mm: Vec<f32> = depth.data.iter().map(|d| f32::from(*d)).collect();
        from_mm.iter_mut().filter(|d| **d == 65_535.0).for_each(|d| *d = 0.0);
        corrector.correct_f32_in_place(&mut from_mm, &context).unwrap();
        assert!(from_mm.iter().zip(&millimetres).all(|(a, b)| (a - b).abs() < 1e-3));
        let mut points = vec![0.0; 3 * WIDTH * HEIGHT];
        corrector.correct_to_points(&depth, 1.0, &context, PointsMut::Interleaved(&mut points)).unwrap();
        let z = points.iter().skip(2).step_by(3);
        assert!(z.zip(&millimetres).all(|(z, mm)| if *mm > 0.0 { (z - mm).abs() < 1e-3 } else { z.is_nan() }));
    }
}

/// Results have the same bits on any number of threads.
#[test]
fn threads_make_no_difference() {
    let (amplitude, depth) = (amplitudes(), measured());
    let context = FrameContext { amplitude: Some((&amplitude).into()), ..FrameContext::default() };
    let corrector = Corrector::new(&camera_of("stray_light", [0.006, 0.057])).unwrap();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut out = vec![0.0; WIDTH * HEIGHT];
        pool.install(|| corrector.correct_u16_to_f32(&depth, 1.0, &context, &mut out)).unwrap();
        out
    };
    assert!(on(1).iter().zip(on(3)).all(|(a, b)| a.to_bits() == b.to_bits()));
}

/// Without an infrared image nothing is known of the light; a frame without depth has none.
#[test]
fn frames_without_light_are_corrected_for_everything_else() {
    let with = camera_of("stray_light", [0.006, 0.057]);
    let without = with.filtered(|block| block.name() != "stray_light");
    let [with, without] = [with, without].map(|camera| Corrector::new(&camera).unwrap());
    let depth = measured();
    let [mut a, mut b] = [blank(), blank()];
    let context = FrameContext::default();
    assert_eq!(with.correct_u16(&depth, 1.0, &context, &mut a), without.correct_u16(&depth, 1.0, &context, &mut b));
    assert_eq!(a, b);
    let (amplitude, none) = (amplitudes(), image(vec![0; WIDTH * HEIGHT]));
    let context = FrameContext { amplitude: Some((&amplitude).into()), ..context };
    let summary = with.correct_u16(&none, 1.0, &context, &mut a).unwrap();
    assert_eq!((summary.corrected, summary.invalid), (0, WIDTH * HEIGHT));
}
