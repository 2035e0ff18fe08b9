//! Fields in both directions: what is measured is corrected exactly, and folds are refused.

use std::sync::Arc;

use depthcal_model::depth::PolynomialMap;
use depthcal_model::field::{Domain, Field, Grid};
use depthcal_model::register::Options;
use depthcal_model::{Block, Camera, CameraError, Context, Register};
use nalgebra::Vector3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const MODELS: [&str; 5] = ["free_map", "bspline", "multiplier", "disparity_decay", "polynomial_map"];

/// D and a field whose nodes are moved by `size` typical deviations, smoothly over the image: phases vary the pattern.
fn camera(name: &str, size: f64, phases: [f64; 3]) -> Camera {
    let register = Register::builtin();
    let mut d = register.block("projective", None).unwrap();
    d.theta = vec![1.3e-4, -3.5e-6, -7e-6, 1.006];
    let mut block = register.block(name, None).unwrap();
    let piece = block.piece().unwrap().clone();
    let layout = piece.field().unwrap();
    for (i, parameter) in piece.parameters().iter().enumerate() {
        let node = i / layout.per_node();
        let (c, r) = (node % layout.grid.columns, node / layout.grid.columns);
        let wave = (phases[0] + 0.8 * c as f64).sin() * (phases[1] + 0.9 * r as f64).cos()
            + 0.5 * (phases[2] + (i % layout.per_node()) as f64).sin();
        block.theta[i] = parameter.nominal + size * parameter.scale * wave;
    }
    let mut lens = register.block("brown_conrady", None).unwrap();
    lens.theta = vec![-0.1468, 0.0463, 0.0012, -0.0007, -0.0756];
    Camera::new(640, 480, [476.9, 476.9, 312.97, 242.49, 0.0], vec![lens, block, d])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    /// The working range: 0.3 to 2 m, all of the image. Fields of the size that they have on real cameras and a few times
    /// beyond.
    #[test]
    fn round_trips_are_exact(
        model in 0..MODELS.len(),
        size in 0.0..2.0_f64,
        phases in [0.0..6.0_f64, 0.0..6.0, 0.0..6.0],
        u in 0.0..639.0_f64,
        v in 0.0..479.0_f64,
        z in 300.0..2000.0_f64,
    ) {
        let camera = camera(MODELS[model], size, phases);
        let pixel = [u, v];
        let ray = match camera.ray(pixel, 1.0 / z) {
            Ok(ray) => ray,
            // This lens turns back just short of the right corners.
            Err(CameraError::OutsideLens { .. }) => {
                prop_assert!((u - 312.97).hypot(v - 242.49) > 0.82 * 476.9);
                return Ok(());
            }
            Err(other) => return Err(TestCaseError::fail(other.to_string())),
        };
        let context = Context { pixel, ..Context::default() };
        let measured = camera.measured_inverse_depth(&context, ray, 1.0, 1.0 / z);
        prop_assume!(measured > 0.0);
        // A few of these fields do fold; then the fold is what has to be found.
        if camera.check_depth_folds(&context, [200.0, 3000.0], 400).is_ok() {
            let (again, rho) = camera.correct(&context, 1.0, measured).unwrap();
            prop_assert!((again[0] - ray[0]).hypot(again[1] - ray[1]) < 1e-12);
            prop_assert!((1.0 / rho - z).abs() < 1e-9, "{}: {} mm for {z} mm", MODELS[model], 1.0 / rho);
            let point = Vector3::new(ray[0] * z, ray[1] * z, z);
            let pixel = camera.project(&point).unwrap();
            prop_assert!((pixel[0] - u).hypot(pixel[1] - v) < 1e-6);
        }
    }
}

/// A multiplier that falls from 1 to 0.4 between 800 and 1000 mm: measured depth falls while the true one grows.
#[test]
fn folds_are_refused_with_model_pixel_and_depth() {
    let options: Options =
        [("bins", 3.0), ("near_mm", 600.0), ("far_mm", 1000.0)].map(|(k, v)| (k.to_owned(), v)).into_iter().collect();
    let mut block = Block::new(Register::builtin().piece("multiplier", &options).unwrap());
    for (i, m) in block.theta.iter_mut().enumerate() {
        *m = [1.0, 1.0, 0.4][i % 3];
    }
    let camera = Camera::new(640, 480, [500.0, 500.0, 320.0, 240.0, 0.0], vec![block]);
    let context = Context { pixel: [100.0, 50.0], ..Context::default() };
    assert!(camera.check_depth_folds(&context, [400.0, 750.0], 60).is_ok());
    let fold = camera.check_depth_folds(&context, [400.0, 950.0], 60).unwrap_err();
    let CameraError::NotInvertible { model, u, v, depth_mm } = &fold else { panic!("{fold}") };
    assert_eq!((model.as_str(), *u, *v), ("multiplier", 100.0, 50.0));
    assert!((780.0..=850.0).contains(depth_mm), "{depth_mm}");
    let message = fold.to_string();
    assert!(message.contains("multiplier") && message.contains("100.0, 50.0"), "{message}");
    // Where correction meets the fold it refuses as well.
    assert!(matches!(camera.correct(&context, 1.0, 1.0 / 850.0), Err(CameraError::NotInvertible { .. })));
}

/// With equal nodes over the image, a field at the depth of a bin is its local function with the numbers of that bin. No
/// built-in field has several numbers per bin; a user's may have.
#[test]
fn a_bin_has_the_numbers_of_its_own_fields() {
    let domain = Domain { size_px: [640.0, 480.0], depth_mm: Some([500.0, 2000.0]) };
    let mut block = Block::new(Arc::new(Field::new(PolynomialMap, Grid::linear(3, 2, 3).over(&domain))));
    let number = |name: &str, bin: usize| match name {
        "c0" => [3.0, -2.0, 7.0][bin],
        "c1" => [0.01, 0.02, -0.03][bin],
        _ => [2e-6, -4e-6, 1e-6][bin],
    };
    let names: Vec<String> = block.parameters().iter().map(|parameter| parameter.name.to_string()).collect();
    for (value, name) in block.theta.iter_mut().zip(&names) {
        let (field, place) = name.trim_end_matches(']').split_once('[').unwrap();
        *value = number(field, place.rsplit(',').next().unwrap().parse().unwrap());
    }
    let camera = Camera::new(640, 480, [500.0, 500.0, 320.0, 240.0, 0.0], vec![block]);
    for (bin, z) in [(0, 500.0), (2, 2000.0)] {
        let [c0, c1, c2] = ["c0", "c1", "c2"].map(|name| number(name, bin));
        for pixel in [[0.0, 0.0], [411.3, 77.9], [639.0, 479.0]] {
            let context = Context { pixel, ..Context::default() };
            let measured = 1.0 / camera.measured_inverse_depth(&context, [0.2, -0.3], 1.0, 1.0 / z);
            let expected = z + c0 + c1 * z + c2 * z * z;
            assert!((measured - expected).abs() < 1e-9, "{z} mm at {pixel:?}: {measured} instead of {expected}");
        }
    }
}

/// The piece of one cell is the whole field, seen from a pixel of that cell.
#[test]
fn the_piece_of_a_cell_agrees_with_the_whole() {
    for name in MODELS {
        let camera = camera(name, 1.0, [0.3, 1.1, 2.0]);
        let block = camera.block(name).unwrap();
        let (piece, layout) = (block.piece().unwrap(), block.piece().unwrap().field().unwrap());
        let context = Context { pixel: [411.3, 77.9], ..Context::default() };
        let state = [0.2, -0.3, 1.0 / 870.0, 0.9];
        let mut theta = Vec::new();
        let mut places = Vec::new();
        for first in layout.cell_nodes(layout.grid.cell(context.pixel).0) {
            places.extend(first..first + layout.per_node());
        }
        places.extend(layout.parameter_count() - layout.shared..layout.parameter_count());
        theta.extend(places.iter().map(|i| block.theta[*i]));
        assert_eq!(theta.len(), piece.of_cell().unwrap().parameters().len());
        let (n, m) = (block.theta.len(), theta.len());
        let (mut whole, mut cell) = (([0.0], [0.0; 4], vec![0.0; n]), ([0.0], [0.0; 4], vec![0.0; m]));
        piece.linearize(&block.theta, &state, &[context], &mut whole.0, &mut whole.1, Some(&mut whole.2));
        let of_cell = piece.of_cell().unwrap();
        of_cell.linearize(&theta, &state, &[context], &mut cell.0, &mut cell.1, Some(&mut cell.2));
        assert_eq!((whole.0, whole.1), (cell.0, cell.1));
        let picked: Vec<f64> = places.iter().map(|i| whole.2[*i]).collect();
        assert_eq!(picked, cell.2);
        assert!(whole.2.iter().filter(|d| **d != 0.0).count() <= m, "{name}: nothing outside the cell");
    }
}
