//! Blocks of a camera by index, and the domain of its lens.

use depthcal_model::{Block, Camera, Register};

const PINHOLE: [f64; 5] = [500.0, 505.0, 320.0, 240.0, 0.0];

fn block(text: &str) -> Block {
    Register::builtin().block(text, None).unwrap()
}

/// Whatever the order given, and though fields are laid over the image, every piece is found at its index.
#[test]
fn pieces_are_found_by_index() {
    let names = ["bspline", "projective", "depth_registration", "free_map", "board_bow", "bspline", "brown_conrady"];
    let mut given: Vec<Block> = names.iter().map(|name| block(name)).collect();
    for (i, block) in given.iter_mut().enumerate() {
        block.theta[0] = i as f64;
    }
    let (camera, places) = Camera::assemble(320, 200, Block::pinhole(PINHOLE), given);
    assert_eq!(places.len(), names.len());
    for (i, place) in places.iter().enumerate() {
        let block = &camera.blocks()[*place];
        assert_eq!((block.name(), block.theta[0]), (names[i], i as f64));
    }
    let order: Vec<&str> = camera.blocks().iter().map(Block::name).collect();
    let expected =
        ["board_bow", "brown_conrady", "pinhole", "depth_registration", "bspline", "projective", "free_map", "bspline"];
    assert_eq!(order, expected);
    let field = camera.blocks()[places[0]].piece().unwrap().field().unwrap();
    assert_eq!(field.grid.options()["width_px"], 320.0, "laid over the image");
    assert_eq!(camera.block_index("bspline"), Some(4));
    assert_eq!(camera.block_index("multiplier"), None);
}

#[test]
fn parameter_ranges_follow_each_other_in_theta() {
    let pieces = ["projective", "bspline", "brown_conrady", "board_bow"].map(block);
    let camera = Camera::new(640, 480, PINHOLE, pieces.into());
    let theta: Vec<f64> = (0..camera.theta().len()).map(|i| i as f64).collect();
    let camera = camera.with_theta(&theta);
    let mut end = 0;
    for (block, range) in camera.blocks_with_ranges() {
        assert_eq!(range.start, end);
        assert_eq!(block.theta, theta[range.clone()], "{}", block.name());
        end = range.end;
    }
    assert_eq!(end, theta.len());
    let d = camera.block_index("projective").unwrap();
    assert_eq!(camera.parameter_ranges().nth(d).unwrap(), 13..17, "after board bow, lens and pinhole");
    // The chain has the same order.
    let chain = camera.chain();
    let pinhole = camera.block_index("pinhole").unwrap();
    assert_eq!(camera.parameter_ranges().nth(pinhole).unwrap().start, chain.pinhole_offset());
    assert_eq!(chain.parameter_count(), theta.len());
}

/// The camera's own search for the limit of its lens (in steps of 0.02) against the formulas in the pieces' documentation.
#[test]
fn lenses_are_monotone_up_to_the_documented_radius() {
    let limit = |name: &str, theta: &[f64]| {
        let mut lens = block(name);
        lens.theta = theta.to_vec();
        Camera::new(640, 480, PINHOLE, vec![lens]).lens_limit()
    };
    let near =
        |found: f64, expected: f64| assert!((expected - 0.021..=expected).contains(&found), "{found}, {expected}");
    // 1 + 3 k1 r² + 5 k2 r⁴ + 7 k3 r⁶ = 0
    near(limit("brown_conrady", &[-0.2, 0.0, 0.0, 0.0, 0.0]), (1.0 / 0.6_f64).sqrt());
    near(limit("brown_conrady", &[0.0, -0.05, 0.0, 0.0, 0.0]), (1.0 / 0.25_f64).powf(0.25));
    near(limit("brown_conrady", &[0.0, 0.0, 0.0, 0.0, -0.01]), (1.0 / 0.07_f64).powf(1.0 / 6.0));
    // 1 − k4 r² − 3 k5 r⁴ − 5 k6 r⁶ = 0
    near(limit("rational_distortion", &[0.3, 0.0, 0.0]), (1.0 / 0.3_f64).sqrt());
    near(limit("rational_distortion", &[0.0, 0.1, 0.0]), (1.0 / 0.3_f64).powf(0.25));
    near(limit("rational_distortion", &[0.0, 0.0, 0.04]), (1.0 / 0.2_f64).powf(1.0 / 6.0));
    // 2 r s1 + 4 r³ s2 = 1, along an axis that is among the directions tried.
    near(limit("thin_prism", &[0.25, 0.0, 0.0, 0.0]), 2.0);
    near(limit("thin_prism", &[0.0, 0.0, 0.0, 0.05]), 5.0_f64.powf(1.0 / 3.0));
    // x sin τy + cos τy = 0: the horizon of the tilted sensor.
    near(limit("tilted_sensor", &[0.0, 0.5]), 1.0 / 0.5_f64.tan());
    // 1 + b ρ > 0 at all radii, at a metre.
    assert_eq!(limit("focus_breathing", &[-500.0]), 3.0);
    assert_eq!(limit("brown_conrady", &[0.1, 0.0, 0.0, 0.0, 0.0]), 3.0);
}
