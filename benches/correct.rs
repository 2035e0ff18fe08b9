//! The per-pixel paths of a frame at three sizes, on one thread and on two, beside a copy and a triad of the same size.
//!
//! Throughput is in bytes read and written, so that the ratio to the machine's own copy is in the report.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use depthcal_correction::{Corrector, FrameContext, PointsMut, Rays, Remap};
use depthcal_io::DepthImage;
use depthcal_model::{Camera, Register};
use rayon::ThreadPool;

const SIZES: [(usize, usize); 3] = [(640, 480), (1280, 720), (1920, 1080)];
const MODELS: [&str; 5] =
    ["projective", "bspline", "multiplier@bins=1", "multiplier", "projective+bspline+cyclic_depth+range_offset"];

fn camera(model: &str, (width, height): (usize, usize)) -> Camera {
    let register = Register::builtin();
    let mut blocks = register.depth_model(model).unwrap();
    for block in &mut blocks {
        match block.name() {
            "projective" => block.theta.copy_from_slice(&[1.3406e-4, -3.52e-6, -6.99e-6, 1.00604654]),
            "multiplier" => block.theta.iter_mut().enumerate().for_each(|(i, m)| *m += 0.01 * (0.7 * i as f64).sin()),
            "bspline" => block.theta.iter_mut().enumerate().for_each(|(i, a)| *a += 1e-5 * (0.7 * i as f64).sin()),
            _ => block.theta.fill(1.5),
        }
    }
    let mut lens = register.block("brown_conrady", None).unwrap();
    lens.theta.copy_from_slice(&[-0.1468, 0.0463, 0.0012, -0.0007, -0.0756]);
    blocks.push(lens);
    let f = 477.0 * width as f64 / 640.0;
    Camera::new(width, height, [f, f, 0.489 * width as f64, 0.505 * height as f64, 0.0], blocks)
}

fn paths(c: &mut Criterion) {
    let pools = [1, 2].map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap());
    for size in SIZES {
        let (width, height) = size;
        let n = width * height;
        let data: Vec<u16> = (0..n).map(|i| 300 + (i * 7 % 3000) as u16).collect();
        let depth = DepthImage { width, height, data };
        let context = FrameContext::default();
        let mut group = c.benchmark_group(format!("{width}x{height}"));
        group.sample_size(20);
        let on = |pool: &ThreadPool, name: &str| BenchmarkId::new(name, pool.current_num_threads());

        group.throughput(Throughput::Bytes(4 * n as u64));
        let mut out = depth.clone();
        group.bench_function("copy_u16", |b| b.iter(|| out.data.copy_from_slice(black_box(&depth.data))));
        group.throughput(Throughput::Bytes(12 * n as u64));
        let (x, y, mut z) = (vec![1.0f32; n], vec![2.0f32; n], vec![0.0f32; n]);
        group.bench_function("triad_f32", |b| {
            b.iter(|| z.iter_mut().zip(black_box(&x)).zip(&y).for_each(|((z, x), y)| *z = x + 3.0 * y));
        });

        let correctors = MODELS.map(|model| (model, Corrector::new(&camera(model, size)).unwrap()));
        for pool in &pools {
            for (model, corrector) in &correctors {
                group.throughput(Throughput::Bytes(8 * n as u64));
                group.bench_function(on(pool, &format!("u16_to_u16/{model}")), |b| {
                    pool.install(|| {
                        b.iter(|| corrector.correct_u16(black_box(&depth), 1.0, &context, &mut out).unwrap());
                    });
                });
                group.throughput(Throughput::Bytes(10 * n as u64));
                group.bench_function(on(pool, &format!("u16_to_f32/{model}")), |b| {
                    pool.install(|| {
                        b.iter(|| corrector.correct_u16_to_f32(black_box(&depth), 1.0, &context, &mut z).unwrap());
                    });
                });
            }
            let (_, corrector) = &correctors[0];
            let mut points = vec![0.0f32; 3 * n];
            group.throughput(Throughput::Bytes(22 * n as u64));
            group.bench_function(on(pool, "u16_to_points/projective"), |b| {
                pool.install(|| {
                    b.iter(|| {
                        let out = PointsMut::Interleaved(&mut points);
                        corrector.correct_to_points(black_box(&depth), 1.0, &context, out).unwrap()
                    });
                });
            });
            let camera = camera("projective", size);
            let remap = Remap::undistort(&camera);
            group.throughput(Throughput::Bytes(4 * n as u64));
            group.bench_function(on(pool, "remap_nearest_u16"), |b| {
                pool.install(|| b.iter(|| remap.nearest(black_box(&depth.data), &mut out.data).unwrap()));
            });
            group.bench_function(on(pool, "remap_depth_u16"), |b| {
                pool.install(|| b.iter(|| remap.depth(black_box(&depth.data), &mut out.data).unwrap()));
            });
            let gray: Vec<u8> = depth.data.iter().map(|v| *v as u8).collect();
            let mut gray_out = gray.clone();
            group.throughput(Throughput::Bytes(6 * n as u64));
            group.bench_function(on(pool, "remap_linear_u8"), |b| {
                pool.install(|| b.iter(|| remap.linear(black_box(&gray), &mut gray_out).unwrap()));
            });
            let rays = Rays::new(&camera);
            let mut planes = [vec![0.0f32; n], vec![0.0f32; n]];
            group.throughput(Throughput::Bytes(8 * n as u64));
            group.bench_function(on(pool, "rays_f32"), |b| {
                let [x, y] = &mut planes;
                pool.install(|| b.iter(|| black_box(&rays).single([x, y]).unwrap()));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, paths);
criterion_main!(benches);
