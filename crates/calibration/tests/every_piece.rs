//! Properties of every registered piece, so that a new one is covered without a test of its own: it survives saving and loading,
//! and folds of depth are found. Derivatives and inverse: `crates/model/tests/jacobians.rs`.

use depthcal_calibration::camera_record::{camera_from_record, piece_records};
use depthcal_io::CameraRecord;
use depthcal_model::hook::HookKind;
use depthcal_model::register::Options;
use depthcal_model::{Block, Camera, Context, Register, StrayLight};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const RANGE_MM: [f64; 2] = [400.0, 1600.0];

/// A camera with a lens, D and the named piece, whose parameters are off their nominal values by `size` typical amounts.
fn camera(name: &str, size: f64, rng: &mut ChaCha8Rng) -> Camera {
    let register = Register::builtin();
    let names = ["brown_conrady", "projective", name];
    let needed = names.iter().enumerate().filter(|(i, n)| !names[..*i].contains(n)).map(|(_, n)| *n);
    let mut block = |name: &str| {
        let mut block = Block::new(register.piece(name, &Options::new()).unwrap());
        block.free.iter_mut().for_each(|free| *free = rng.random_bool(0.5));
        block
    };
    let blocks = needed.map(&mut block).collect();
    let camera = Camera::new(640, 480, [476.9, 475.1, 312.9, 242.5, 0.4], blocks);
    let mut theta = camera.theta();
    for (block, range) in camera.blocks_with_ranges().filter(|(block, _)| block.piece().is_some()) {
        let size = if block.name() == name { size } else { 1.0 };
        for (value, p) in theta[range].iter_mut().zip(block.parameters().iter()) {
            *value += size * p.scale * rng.random_range(-1.0..1.0);
        }
    }
    camera.with_theta(&theta)
}

fn context(rng: &mut ChaCha8Rng) -> Context {
    Context {
        pixel: [rng.random_range(40.0..600.0), rng.random_range(40.0..440.0)],
        amplitude: rng.random_range(100.0..5000.0),
        surround: rng.random_range(100.0..5000.0),
        slope: [0.05, -0.03],
        stray: StrayLight { scene: [[2.5, 0.9], [-1.3, 1.8], [0.4, -1.9]], near: 1.2 },
        time_s: rng.random_range(0.0..600.0),
        temperature_c: rng.random_range(20.0..45.0),
        ..Context::default()
    }
}

#[test]
fn pieces_survive_saving_and_loading() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let register = Register::builtin();
    for name in register.names() {
        let camera = camera(name, 1.0, &mut rng);
        let std_devs: Vec<Option<f64>> = camera.theta().iter().map(|_| None).collect();
        let record = CameraRecord::unnamed([640, 480], piece_records(&camera, &std_devs));
        let text = serde_json::to_string(&record).unwrap();
        let read: CameraRecord = serde_json::from_str(&text).unwrap();
        assert_eq!(read, record, "{name}");
        let read = camera_from_record(&read, &register).unwrap();
        assert_eq!(read.theta(), camera.theta(), "{name}");
        let free = |camera: &Camera| camera.blocks().iter().flat_map(|block| block.free.clone()).collect::<Vec<bool>>();
        assert_eq!(free(&read), free(&camera), "{name}");
        for _ in 0..20 {
            let (context, z) = (context(&mut rng), rng.random_range(RANGE_MM[0]..RANGE_MM[1]));
            let point = Vector3::new(0.2 * z, -0.1 * z, z);
            assert_eq!(read.project(&point), camera.project(&point), "{name}");
            let depth = |camera: &Camera| camera.measured_inverse_depth(&context, [0.2, -0.1], 0.9, 1.0 / z).to_bits();
            assert_eq!(depth(&read), depth(&camera), "{name}");
        }
    }
}

/// Folds against the values of the model alone, on a grid thirty times as fine.
#[test]
fn folds_of_depth_are_found() {
    const STEPS: usize = 60;
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let register = Register::builtin();
    let (mut folded, mut sound) = (0, 0);
    for name in register.names() {
        if register.piece(name, &Options::new()).unwrap().hook() != HookKind::Depth {
            continue;
        }
        for trial in 0..60 {
            let camera = camera(name, [1.0, 10.0, 100.0, 1000.0][trial % 4], &mut rng);
            let context = context(&mut rng);
            let check = camera.check_depth_folds(&context, RANGE_MM, STEPS);
            let rho =
                |i: usize| 1.0 / RANGE_MM[0] + (1.0 / RANGE_MM[1] - 1.0 / RANGE_MM[0]) * i as f64 / (30 * STEPS) as f64;
            let measured: Option<Vec<f64>> = (0..=30 * STEPS)
                .map(|i| {
                    let ray = camera.ray(camera.image_pixel(&context), rho(i)).ok()?;
                    Some(camera.measured_inverse_depth(&context, ray, 1.0, rho(i)))
                })
                .collect();
            let Some(measured) = measured else { continue };
            let falls = |step: usize| measured.windows(step + 1).all(|w| w[step] < w[0] && w[step] > 0.0);
            // A fold narrower than a step of the check may be missed; one as wide as two may not.
            if !falls(60) {
                assert!(check.is_err(), "{name}, {:?}: a fold is not found", camera.theta());
                folded += 1;
            } else if falls(1) {
                assert!(check.is_ok(), "{name}, {:?}: {check:?}", camera.theta());
                sound += 1;
            }
        }
    }
    assert!(folded > 100 && sound > 100, "{folded} with folds, {sound} without");
}
