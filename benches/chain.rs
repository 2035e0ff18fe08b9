//! The hot loops of the adjustment: Jacobians of image and depth observations, and a whole joint adjustment.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use depthcal_calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal_calibration::simulated;
use depthcal_model::chain::{DepthQuery, POSE, Workspace};
use depthcal_model::{Block, Camera, Context, Register};
use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};
use nalgebra::Isometry3;

fn camera(pieces: &[&str]) -> Camera {
    let register = Register::builtin();
    let blocks: Vec<Block> = pieces.iter().map(|name| register.block(name, None).unwrap()).collect();
    Camera::new(640, 480, [476.9, 476.9, 313.0, 242.5, 0.0], blocks)
}

/// One frame of 44 markers: with the same in plain f64 beside it, so that the price of derivatives shows.
fn image(c: &mut Criterion) {
    let camera = camera(&["brown_conrady"]);
    let (chain, theta) = (camera.chain(), camera.theta());
    let pose = Isometry3::new([-60.0, -80.0, 700.0].into(), [0.3, -0.2, 0.1].into());
    let points: Vec<[f64; 2]> = (0..44).map(|i| [f64::from(i % 4) * 34.0, f64::from(i / 4) * 17.0]).collect();
    let mut pixels = vec![[0.0; 2]; 44];
    let mut jacobian = vec![0.0; 88 * (POSE + chain.image_parameter_count())];
    let mut work = Workspace::default();
    let mut group = c.benchmark_group("image_factor_44_markers");
    group.throughput(Throughput::Elements(44));
    group.bench_function("values", |b| {
        b.iter(|| chain.image(&mut work, black_box(&theta), &pose, &points, &mut pixels, None).unwrap());
    });
    group.bench_function("values_and_jacobian", |b| {
        b.iter(|| chain.image(&mut work, black_box(&theta), &pose, &points, &mut pixels, Some(&mut jacobian)).unwrap());
    });
    group.finish();
}

/// One frame of 500 depth pixels, for the projective model and with effects on top.
fn depth(c: &mut Criterion) {
    let mut group = c.benchmark_group("depth_factor_500_pixels");
    group.throughput(Throughput::Elements(500));
    let stacks: [&[&str]; 3] = [
        &["brown_conrady", "projective"],
        &["brown_conrady", "projective", "cyclic_depth"],
        &["brown_conrady", "board_bow", "depth_registration", "projective", "incidence_bias"],
    ];
    for pieces in stacks {
        let camera = camera(pieces);
        let (chain, theta) = (camera.chain(), camera.theta());
        let pose = Isometry3::new([-60.0, -80.0, 700.0].into(), [0.3, -0.2, 0.1].into());
        let queries: Vec<DepthQuery> = (0..500)
            .map(|i| {
                let board = [f64::from(i % 25) * 4.0, f64::from(i / 25) * 8.0];
                let point = pose * nalgebra::Point3::new(board[0], board[1], 0.0);
                let pixel = camera.project(&point.coords).unwrap().map(f64::round);
                DepthQuery { board_seed: board, context: Context { pixel, ..Context::default() } }
            })
            .collect();
        let (mut rho, mut board) = (vec![0.0; 500], vec![[0.0; 2]; 500]);
        let mut jacobian = vec![0.0; 500 * (POSE + chain.parameter_count())];
        let mut work = Workspace::default();
        group.bench_function(BenchmarkId::new("values_and_jacobian", pieces[1..].join("+")), |b| {
            b.iter(|| {
                let rows = Some(&mut jacobian[..]);
                chain.depth(&mut work, black_box(&theta), &pose, &queries, &mut rho, &mut board, rows).unwrap();
            });
        });
    }
    group.finish();
}

/// Start values, image adjustment and joint adjustment of 27 frames with 44 markers and 500 depth pixels each.
fn whole_calibration(c: &mut Criterion) {
    let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 1);
    let capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
    let mut group = c.benchmark_group("calibrate_27_frames");
    group.sample_size(10);
    group.bench_function("joint", |b| {
        b.iter(|| calibrate_camera(black_box(&capture), &CameraOptions::default()).unwrap())
    });
    group.finish();
}

criterion_group!(benches, image, depth, whole_calibration);
criterion_main!(benches);
