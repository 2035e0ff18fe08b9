//! Times effects given as formulas, and the same effects written in Rust: batches of a fit, and frames of `apply`.

use std::path::Path;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use depthcal_correction::{Corrector, FrameContext};
use depthcal_formula::FormulaFile;
use depthcal_io::{DepthImage, GrayImage};
use depthcal_model::{AnyPiece, Block, Camera, Context, Options, Register, erase};

/// The modules that a piece of depthcal's own finds in its crate.
mod hook {
    pub use depthcal_model::hook::*;
}
mod piece {
    pub use depthcal_model::{Constant, Context, Covariate, On, Options, Parameter, Piece, Scalar};
}

#[path = "formula_pieces/amplitude_bias.rs"]
mod amplitude_bias;
#[path = "formula_pieces/row_gain.rs"]
mod row_gain;

const SIZE: (usize, usize) = (640, 480);
/// Observations of a batch.
const BATCH: usize = 4096;

/// An effect as a formula and in Rust, and values of its parameters.
type Pair = (&'static str, [Arc<dyn AnyPiece>; 2], Vec<f64>);

/// The effects as formulas and in Rust. The first has a table per pixel; the second depends on place and amplitude together and
/// is inverted pixel by pixel.
fn effects() -> Vec<Pair> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("formula_pieces/effects.toml");
    let file = FormulaFile::read(&path).unwrap();
    let none = Options::new();
    let formula = |name: &str| file.effects().iter().find(|e| e.name() == name).unwrap().piece(&none);
    vec![
        ("row_gain", [formula("row_gain"), erase(row_gain::RowGain::with_options(&none))], vec![2e-6]),
        (
            "amplitude_bias",
            [formula("amplitude_bias"), erase(amplitude_bias::AmplitudeBias::with_options(&none))],
            vec![2.0, 3.0],
        ),
    ]
}

fn batches(c: &mut Criterion) {
    let states: Vec<f64> = (0..BATCH)
        .flat_map(|i| {
            let t = i as f64 / BATCH as f64;
            [0.5 - t, 0.3 * (7.0 * t).sin(), 1.0 / (500.0 + 900.0 * t), 0.8 + 0.2 * t]
        })
        .collect();
    let contexts: Vec<Context> =
        (0..BATCH).map(|i| Context { amplitude: 500.0 + i as f64, surround: 1200.0, ..Context::default() }).collect();
    let mut group = c.benchmark_group("linearize");
    group.throughput(Throughput::Elements(BATCH as u64));
    for (name, [formula, rust], theta) in effects() {
        let (mut out, mut d_state, mut d_theta) =
            (vec![0.0; BATCH], vec![0.0; 4 * BATCH], vec![0.0; theta.len() * BATCH]);
        for (kind, piece) in [("formula", &formula), ("rust", &rust)] {
            group.bench_function(BenchmarkId::new(name, kind), |b| {
                b.iter(|| piece.linearize(&theta, &states, &contexts, &mut out, &mut d_state, Some(&mut d_theta)));
            });
        }
    }
}

fn frames(c: &mut Criterion) {
    let (width, height) = SIZE;
    let n = width * height;
    let depth = DepthImage { width, height, data: (0..n).map(|i| 300 + (i * 7 % 3000) as u16).collect() };
    let amplitude = GrayImage { width, height, data: (0..n).map(|i| 500 + (i * 13 % 4000) as u16).collect(), bits: 16 };
    let context = FrameContext { amplitude: Some((&amplitude).into()), ..FrameContext::default() };
    let mut group = c.benchmark_group("apply");
    group.sample_size(10).throughput(Throughput::Elements(n as u64));
    for (name, pieces, theta) in effects() {
        for (kind, piece) in ["formula", "rust"].into_iter().zip(pieces) {
            let mut blocks = Register::builtin().depth_model("projective").unwrap();
            blocks[0].theta.copy_from_slice(&[1.3406e-4, -3.52e-6, -6.99e-6, 1.00604654]);
            let mut effect = Block::new(piece);
            effect.theta.copy_from_slice(&theta);
            blocks.push(effect);
            let corrector =
                Corrector::new(&Camera::new(width, height, [477.0, 477.0, 313.0, 242.0, 0.0], blocks)).unwrap();
            let mut out = depth.clone();
            group.bench_function(BenchmarkId::new(name, kind), |b| {
                b.iter(|| corrector.correct_u16(&depth, 1.0, &context, &mut out).unwrap());
            });
        }
    }
}

criterion_group!(benches, batches, frames);
criterion_main!(benches);
