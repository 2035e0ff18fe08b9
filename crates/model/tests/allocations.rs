//! Evaluating a camera's chain with derivatives allocates nothing, however many observations there are, once its workspace has
//! its size.

use std::alloc::System;

use depthcal_model::chain::{Chain, DepthQuery, POSE, Workspace};
use depthcal_model::{Block, Camera, Context, Register, StrayLight, register::Options};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

const POINTS: usize = 500;

/// Allocations of markers and depth pixels with their Jacobians, in a workspace that has been used before.
fn allocations(chain: &Chain, theta: &[f64]) -> usize {
    let pose = Isometry3::from_parts(
        Translation3::new(-60.0, -40.0, 700.0),
        UnitQuaternion::from_scaled_axis(Vector3::new(0.2, -0.3, 0.1)),
    );
    let points: Vec<[f64; 2]> = (0..POINTS).map(|i| [(i % 25) as f64 * 6.0, (i / 25) as f64 * 6.0]).collect();
    let mut work = Workspace::default();
    let mut pixels = vec![[0.0; 2]; POINTS];
    let mut of_image = vec![0.0; 2 * POINTS * (POSE + chain.image_parameter_count())];
    chain.image(&mut work, theta, &pose, &points, &mut pixels, Some(&mut of_image)).unwrap();
    let query = |(point, pixel): (&[f64; 2], &[f64; 2])| DepthQuery {
        board_seed: *point,
        context: Context {
            pixel: *pixel,
            amplitude: 700.0,
            surround: 900.0,
            slope: [0.02, -0.01],
            stray: StrayLight { scene: [[2.5, 0.9], [-1.3, 1.8], [0.4, -1.9]], near: 1.2 },
            time_s: 50.0,
            temperature_c: 30.0,
            ..Context::default()
        },
    };
    let queries: Vec<DepthQuery> = points.iter().zip(&pixels).map(query).collect();
    let (mut rho, mut board) = (vec![0.0; POINTS], vec![[0.0; 2]; POINTS]);
    let mut of_depth = vec![0.0; POINTS * (POSE + chain.parameter_count())];
    chain.depth(&mut work, theta, &pose, &queries, &mut rho, &mut board, Some(&mut of_depth)).unwrap();

    let region = Region::new(ALLOCATOR);
    chain.image(&mut work, theta, &pose, &points, &mut pixels, Some(&mut of_image)).unwrap();
    chain.depth(&mut work, theta, &pose, &queries, &mut rho, &mut board, Some(&mut of_depth)).unwrap();
    let count = region.change();
    count.allocations + count.reallocations
}

#[test]
fn observations_do_not_allocate() {
    let register = Register::builtin();
    let block = |name: &str| Block::new(register.piece(name, &Options::new()).unwrap());
    let all: Vec<&str> = register.names().collect();
    for names in [vec![], vec!["brown_conrady", "projective"], all] {
        let camera =
            Camera::new(640, 480, [480.0, 480.0, 320.0, 240.0, 0.0], names.iter().map(|name| block(name)).collect());
        assert_eq!(allocations(&camera.chain(), &camera.theta()), 0, "{names:?}");
    }
}
