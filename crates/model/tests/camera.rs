//! Blocks of a camera by index, and the domain of its lens.

use depthcal_model::hook::{Depth, DepthState};
use depthcal_model::{Block, Camera, Context, Parameter, Piece, Register, Scalar};

const PINHOLE: [f64; 5] = [500.0, 505.0, 320.0, 240.0, 0.0];

fn block(text: &str) -> Block {
    Register::builtin().block(text, None).unwrap()
}

fn with_theta(text: &str, theta: &[f64]) -> Block {
    let mut block = block(text);
    block.theta = theta.to_vec();
    block
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
    assert_eq!(camera.parameter_ranges().nth(pinhole).unwrap().end, chain.image_parameter_count());
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
        |radius: f64, expected: f64| assert!((expected - 0.021..=expected).contains(&radius), "{radius}, {expected}");
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
    let widest = 85.0_f64.to_radians().tan();
    let everywhere = |radius: f64| assert!((radius - widest).abs() < 1e-3, "{radius}, {widest}");
    everywhere(limit("focus_breathing", &[-500.0]));
    everywhere(limit("brown_conrady", &[0.1, 0.0, 0.0, 0.0, 0.0]));
    // 1 + 3 k1 θ² = 0 and 1 + 9 k4 θ⁸ = 0, θ = atan r.
    near(limit("kannala_brandt", &[-0.4, 0.0, 0.0, 0.0]), (1.0 / 1.2_f64).sqrt().tan());
    near(limit("kannala_brandt", &[0.0, 0.0, 0.0, -0.1]), (1.0 / 0.9_f64).powf(1.0 / 8.0).tan());
    everywhere(limit("kannala_brandt", &[0.1, 0.0, 0.0, 0.0]));
    near(limit("division", &[0.1]), 2.5_f64.sqrt());
    everywhere(limit("division", &[-0.3]));
    everywhere(limit("unified", &[1.1, 0.0, 0.0, 0.0, 0.0]));
    // m = r / (1 + ξ √(1 + r²)) at which 1 + 3 k1 m² = 0: m = 0.5, ξ = 1.
    near(limit("unified", &[1.0, -4.0 / 3.0, 0.0, 0.0, 0.0]), 4.0 / 3.0);
    // 1 + r0 + 3 r1 r² = 0
    near(limit("cahvor", &[0.0, 0.0, 0.2, -0.4, 0.0]), 1.0);
    let opencv = |k: &[f64]| limit("opencv_lens", &[k, &[0.0; 14]].concat()[..14]);
    near(opencv(&[-0.2]), (1.0 / 0.6_f64).sqrt());
    near(opencv(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.3]), (1.0 / 0.3_f64).sqrt());
    near(opencv(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.25]), 2.0);
}

/// Wide cameras: rays up to 80° off axis go to pixels and come back, with every lens that describes such a camera.
#[test]
fn rays_of_wide_lenses_round_trip() {
    let lenses: [(&str, &[f64]); 4] = [
        ("unified", &[1.2, -0.1, 0.02, 1e-4, -2e-4]),
        ("kannala_brandt", &[0.03, -0.01, 0.004, -0.001]),
        ("division", &[-0.4]),
        ("opencv_lens", &[1.2, 0.1, 1e-4, -2e-4, 0.001, 1.7, 0.4, 0.01, 1e-5, 0.0, -1e-5, 0.0, 0.01, -0.02]),
    ];
    for (name, theta) in lenses {
        let mut lens = block(name);
        lens.theta = theta.to_vec();
        let camera = Camera::new(1280, 1024, [420.0, 421.0, 640.3, 511.2, 0.0], vec![lens]);
        assert!(camera.lens_limit() > 5.6, "{name}: {}", camera.lens_limit());
        for i in 0..400 {
            let (angle, azimuth) = (80.0_f64.to_radians() * f64::from(i) / 399.0, 0.37 * f64::from(i));
            let ray = [angle.tan() * azimuth.cos(), angle.tan() * azimuth.sin()];
            let pixel = camera.project(&nalgebra::Vector3::new(900.0 * ray[0], 900.0 * ray[1], 900.0)).unwrap();
            let back = camera.ray(pixel, 1e-3).unwrap();
            let error = (back[0] - ray[0]).hypot(back[1] - ray[1]) * angle.cos().powi(2);
            assert!(error < 1e-11, "{name} at {angle}: {error:e} rad");
        }
    }
}

/// Brown–Conrady with the effect `rational_distortion`, in whatever order they are given, is OpenCV's lens of eight coefficients;
/// with `thin_prism` and `tilted_sensor` that of fourteen.
#[test]
fn effects_of_the_lens_add_up_to_opencvs_model() {
    let theta = [-0.2, 0.05, 1e-2, -2e-2, 0.01, 0.1, -0.04, 0.02, 3e-3, -1e-3, 2e-3, 5e-4, 0.02, -0.03];
    let with = |name: &str, range: std::ops::Range<usize>| {
        let mut b = block(name);
        b.theta.copy_from_slice(&theta[range]);
        b
    };
    let whole = Camera::new(640, 480, PINHOLE, vec![with("opencv_lens", 0..14)]);
    let [brown, rational, prism, tilt] = [
        with("brown_conrady", 0..5),
        with("rational_distortion", 5..8),
        with("thin_prism", 8..12),
        with("tilted_sensor", 12..14),
    ];
    let orders = [
        vec![brown.clone(), rational.clone(), prism.clone(), tilt.clone()],
        vec![rational.clone(), brown.clone(), prism.clone(), tilt.clone()],
        vec![brown, prism, tilt, rational],
    ];
    for pieces in orders {
        let camera = Camera::new(640, 480, PINHOLE, pieces);
        for i in 0..100 {
            let point = nalgebra::Vector3::new(7.0 * f64::from(i % 10) - 30.0, 5.0 * f64::from(i / 10) - 20.0, 80.0);
            let (a, b) = (camera.project(&point).unwrap(), whole.project(&point).unwrap());
            assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 1e-10, "{a:?} {b:?}");
        }
    }
}

/// A camera fitted to the rays of one of its own kind is that camera; to those of another kind it comes near.
#[test]
fn lenses_imitate_each_other() {
    let with = |name: &str, theta: &[f64]| {
        let mut lens = block(name);
        lens.theta[..theta.len()].copy_from_slice(theta);
        Camera::new(1280, 1024, [420.0, 421.0, 640.3, 511.2, 0.0], vec![lens])
    };
    let fisheye = with("kannala_brandt", &[0.03, -0.01, 0.004, -0.001]);
    let (rays, pixels) = fisheye.rays_over_image(21, 17);
    assert!(rays.len() > 280, "the corners alone see more than 85°: {}", rays.len());
    let largest = |camera: &Camera| {
        let error = |(r, p): (&[f64; 2], &[f64; 2])| {
            let projected = camera.project(&nalgebra::Vector3::new(r[0], r[1], 1.0)).unwrap_or([f64::INFINITY; 2]);
            (projected[0] - p[0]).hypot(projected[1] - p[1])
        };
        rays.iter().zip(&pixels).map(error).fold(0.0, f64::max)
    };
    let mut start = with("kannala_brandt", &[]);
    assert!(largest(&start) > 10.0);
    start = start.fitted_to_rays(&rays, &pixels);
    assert!(largest(&start) < 1e-6, "{}", largest(&start));
    for (name, free, most_px) in [("unified", 5, 0.5), ("opencv_lens", 8, 0.5)] {
        let mut other = with(name, &[]);
        other = other.map_blocks(|mut b| {
            b.free.iter_mut().skip(free).for_each(|f| *f = false);
            b
        });
        let error_px = largest(&other.fitted_to_rays(&rays, &pixels));
        assert!(error_px < most_px, "{name}: {error_px}");
    }
}

/// A bent board by its formula, and a displaced depth image by its two numbers.
#[test]
fn points_of_the_board_and_pixels_of_the_image_are_those_of_the_pieces() {
    let pieces = vec![with_theta("board_bow", &[2e-5, -1e-5, 3e-5]), with_theta("depth_registration", &[1.7, -0.6])];
    let camera = Camera::new(640, 480, PINHOLE, pieces);
    let [x, y] = [120.0, -70.0];
    let height = 2e-5 * x * x - 1e-5 * x * y + 3e-5 * y * y;
    assert_eq!(camera.board_point([x, y]), [x, y, height]);
    let context = Context { pixel: [100.0, 200.0], ..Context::default() };
    let [u, v] = camera.image_pixel(&context);
    assert!((u - 98.3).abs() < 1e-12 && (v - 200.6).abs() < 1e-12, "({u}, {v})");
}

/// Where no true depth gives the measured one, the message has the pixel and the depth.
#[test]
fn depth_that_cannot_be_inverted_is_named() {
    let projective = with_theta("projective", &[0.0, 0.0, 1e-3, 1.0]);
    let camera = Camera::new(640, 480, PINHOLE, vec![projective]);
    let context = Context { pixel: [12.0, 34.0], ..Context::default() };
    assert!(camera.true_inverse_depth(&context, [0.1, 0.2], 1.0, 1.0 / 900.0).is_ok());
    let error = camera.true_inverse_depth(&context, [0.1, 0.2], 1.0, 1.0 / 1500.0).unwrap_err().to_string();
    assert!(error.contains("(12.0, 34.0)") && error.contains("1500.0 mm"), "{error}");
}

/// Measured inverse depth that grows like a logarithm: 8·10⁻⁴ would need e⁸⁰⁰.
#[derive(Debug)]
struct Logarithm;

impl Piece<Depth, 1> for Logarithm {
    const NAME: &'static str = "logarithm";
    const SUMMARY: &'static str = "grows like a logarithm";
    const EQUATION: &'static str = "s ln(1 + 1000 ρ)";
    const SOURCE: &'static str = "a test";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("s", "1/mm", 1e-6, 1e-7)];

    fn map<T: Scalar>(&self, state: DepthState<T>, [s]: [T; 1], _: &Context) -> T {
        s * (state.rho * 1000.0 + 1.0).ln()
    }
}

/// An iteration that has found no bound from above has found no step between two depths either.
#[test]
fn depth_that_is_out_of_reach_is_refused() {
    let mut register = Register::builtin();
    register.add(|_| Logarithm);
    let camera = Camera::new(640, 480, PINHOLE, vec![register.block("logarithm", None).unwrap()]);
    let corrected = |measured: f64| camera.true_inverse_depth(&Context::default(), [0.1, 0.2], 1.0, measured);
    let expected = (0.7_f64.exp() - 1.0) / 1000.0;
    assert!((corrected(0.7e-6).unwrap() / expected - 1.0).abs() < 1e-12);
    assert!(corrected(8e-4).is_err());
}

#[test]
fn blocks_have_the_titles_of_their_pieces() {
    for block in [block("projective"), block("brown_conrady")] {
        assert_eq!(block.title(), block.piece().unwrap().title());
    }
    assert_eq!(Block::pinhole(PINHOLE).title(), "Pinhole K");
}
