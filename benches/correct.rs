//! The per-pixel paths of a corrected frame: depth correction and back-projection, beside a copy of the same buffer.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use depthcal::corrector::{Corrector, FrameContext};
use depthcal_io::DepthImage;
use depthcal_model::{Camera, Register};

fn camera(model: &str) -> Camera {
    let register = Register::builtin();
    let mut blocks = register.depth_model(model).unwrap();
    for block in &mut blocks {
        if block.name() == "projective" {
            block.theta.copy_from_slice(&[1.3406e-4, -3.52e-6, -6.99e-6, 1.00604654]);
        }
    }
    let mut lens = register.block("brown_conrady", None).unwrap();
    lens.theta.copy_from_slice(&[-0.1468, 0.0463, 0.0012, -0.0007, -0.0756]);
    blocks.push(lens);
    Camera::new(640, 480, [476.9, 476.9, 312.97, 242.49, 0.0], blocks)
}

fn correct(c: &mut Criterion) {
    let mut group = c.benchmark_group("640x480");
    let data: Vec<u16> = (0..640 * 480).map(|i| 2400 + (i * 7 % 5000) as u16).collect();
    let depth = DepthImage { width: 640, height: 480, data };
    let mut out = depth.clone();
    group.throughput(Throughput::Bytes(2 * 2 * 640 * 480));
    group.bench_function("copy_u16", |b| b.iter(|| out.data.copy_from_slice(black_box(&depth.data))));
    for model in ["projective", "projective+cyclic_depth"] {
        let corrector = Corrector::new(&camera(model)).unwrap();
        let context = FrameContext::default();
        group.bench_function(BenchmarkId::new("correct_u16", model), |b| {
            b.iter(|| corrector.correct_u16(black_box(&depth), 0.125, &context, &mut out).unwrap());
        });
    }
    let corrector = Corrector::new(&camera("projective")).unwrap();
    group.bench_function("points", |b| b.iter(|| corrector.points(black_box(&depth), 0.125).unwrap()));
    group.finish();
}

criterion_group!(benches, correct);
criterion_main!(benches);
