//! Times the per-pixel paths and prints one line of JSON for each: case, mode, w, h, threads, ms.
//!
//!     cargo run --release -p depthcal-benches --bin pixel -- [SECONDS PER CASE] [WIDTH] [CASE]
//!
//! `hot` works on one frame again and again; `cold` on a ring of frames of more than 256 MB, so that every frame comes from
//! memory. The camera is the thesis' camera 1, scaled to the size. `copy` and `triad` beside them are the machine's own: a
//! copy of the depth image, and a + 3 b over f32 images of that size, on as many threads.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::hint::black_box;
use std::time::Instant;

use depthcal_correction::{Corrector, FrameContext, PointsMut, Rays, Remap};
use depthcal_io::DepthImage;
use depthcal_model::{Camera, Register};
use rayon::prelude::*;

const SIZES: [(usize, usize); 3] = [(640, 480), (1280, 720), (1920, 1080)];

fn camera(width: usize, height: usize, depth_model: &str) -> Camera {
    let register = Register::builtin();
    let mut blocks = register.depth_model(depth_model).expect("a model of the register");
    for block in &mut blocks {
        match block.name() {
            "projective" => block.theta = vec![1.3406e-4, -3.52e-6, -6.99e-6, 1.00604654],
            _ => block.theta.iter_mut().enumerate().for_each(|(i, m)| *m += 0.01 * (0.7 * i as f64).sin()),
        }
    }
    let mut lens = register.block("brown_conrady", None).expect("a piece of the register");
    lens.theta = vec![-0.1468, 0.0463, 0.0012, -0.0007, -0.0756];
    blocks.push(lens);
    let f = 477.0 * width as f64 / 640.0;
    Camera::new(width, height, [f, f, 0.489 * width as f64, 0.505 * height as f64, 0.0], blocks)
}

/// Median, smallest and 90th percentile of the time of one call, ms.
fn time(seconds: f64, inner: usize, mut call: impl FnMut(usize)) -> [f64; 3] {
    let mut times = Vec::new();
    let mut frame = 0;
    let end = Instant::now();
    while end.elapsed().as_secs_f64() < seconds || times.len() < 5 {
        let start = Instant::now();
        for _ in 0..inner {
            call(frame);
            frame += 1;
        }
        times.push(start.elapsed().as_secs_f64() * 1e3 / inner as f64);
    }
    times.sort_by(f64::total_cmp);
    [times[times.len() / 2], times[0], times[times.len() * 9 / 10]]
}

struct Bench {
    seconds: f64,
    only: Option<String>,
    mode: &'static str,
    size: (usize, usize),
    threads: usize,
}

impl Bench {
    /// `bytes` are those that a pixel moves.
    fn case(&self, name: &str, bytes: usize, call: impl FnMut(usize)) {
        if self.only.as_ref().is_some_and(|only| only != name) {
            return;
        }
        let (w, h) = self.size;
        let inner = if self.mode == "hot" { (2_000_000 / (w * h)).max(1) } else { 1 };
        let [ms, ms_min, ms_p90] = time(self.seconds, inner, call);
        let (mode, threads) = (self.mode, self.threads);
        let gbs = bytes as f64 * (w * h) as f64 / ms * 1e-6;
        println!(
            r#"{{"case":"{name}","impl":"depthcal","mode":"{mode}","w":{w},"h":{h},"threads":{threads},"ms":{ms:.4},"ms_min":{ms_min:.4},"ms_p90":{ms_p90:.4},"gbs":{gbs:.2}}}"#
        );
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize| arguments.get(i).and_then(|a| a.parse::<f64>().ok());
    let seconds = number(0).unwrap_or(0.3);
    let only = arguments.get(2).cloned();
    for (width, height) in SIZES {
        if number(1).is_some_and(|w| w as usize != width) {
            continue;
        }
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            for mode in ["hot", "cold"] {
                let bench = Bench { seconds, only: only.clone(), mode, size: (width, height), threads };
                pool.install(|| run(&bench));
            }
        }
    }
}

/// Runs all cases of one size, mode and number of threads.
fn run(bench: &Bench) {
    let (width, height) = bench.size;
    let n = width * height;
    let ring = if bench.mode == "hot" { 1 } else { (256usize << 20).div_ceil(16 * n).max(2) };
    let frame = |k: usize| {
        let value = |i: usize| 300 + ((((k * n + i) as u64 * 2_654_435_761) >> 20) % 1500) as u16;
        DepthImage { width, height, data: (0..n).map(value).collect() }
    };
    let depth: Vec<DepthImage> = (0..ring).map(frame).collect();
    memory(bench, &depth);
    corrections(bench, &depth);
    let camera = camera(width, height, "projective");
    points(bench, &camera, &depth);
    remaps(bench, &camera, &depth);
    rays(bench, &camera, ring);
}

/// The machine's own speed: a copy of the frames, and a + 3 b over images of their size.
fn memory(bench: &Bench, depth: &[DepthImage]) {
    let (n, ring) = (depth[0].data.len(), depth.len());
    let mut out = depth.to_vec();
    // As many parts as there are threads.
    let part = n.div_ceil(bench.threads);
    bench.case("copy", 4, |k| {
        let (to, from) = (&mut out[k % ring].data, black_box(&depth[k % ring].data));
        to.par_chunks_mut(part).zip(from.par_chunks(part)).for_each(|(to, from)| to.copy_from_slice(from));
    });
    let (b, c) = (vec![vec![1.0f32; n]; ring], vec![vec![2.0f32; n]; ring]);
    let mut a = b.clone();
    bench.case("triad", 12, |k| {
        let k = k % ring;
        let (b, c) = (black_box(&b[k]), &c[k]);
        let parts = a[k].par_chunks_mut(part).zip(b.par_chunks(part)).zip(c.par_chunks(part));
        parts.for_each(|((a, b), c)| a.iter_mut().zip(b).zip(c).for_each(|((a, b), c)| *a = b + 3.0 * c));
    });
}

/// Bytes of a line of the cache.
const LINE: usize = 64;

/// Correction from 16 bits to 16 bits by the tables of several models.
fn corrections(bench: &Bench, depth: &[DepthImage]) {
    let (width, height) = bench.size;
    let (n, ring) = (width * height, depth.len());
    let context = FrameContext::default();
    // Frames one behind the other, from a line of the cache on, as drivers keep them.
    let mut buffers = [0, 1].map(|_| vec![0_u16; ring * n + LINE]);
    let starts = buffers.each_ref().map(|b| b.as_ptr().align_offset(LINE).min(LINE));
    for (k, frame) in depth.iter().enumerate() {
        buffers[0][starts[0] + k * n..][..n].copy_from_slice(&frame.data);
    }
    let [buffer, results] = &mut buffers;

    let models = [
        ("correct_projective", "projective"),
        ("correct_multiplier", "multiplier@bins=1"),
        ("correct_multiplier_in_depth", "multiplier"),
        ("correct_bspline", "bspline"),
    ];
    for (case, model) in models {
        let camera = camera(width, height, model).map_blocks(|mut block| {
            if block.name() == "bspline" {
                block.theta.iter_mut().for_each(|t| *t *= 1e-3);
            }
            block
        });
        let corrector = Corrector::new(&camera).expect("a usable camera");
        assert!(corrector.has_tables(), "{model}");
        bench.case(case, 8, |k| {
            let frame = k % ring * n;
            let (from, to) = (black_box(&buffer[starts[0] + frame..][..n]), starts[1] + frame);
            corrector.correct_u16_buffer(from, 1.0, &context, &mut results[to..][..n]).expect("sizes agree");
        });
    }
}

/// Points with and without correction.
fn points(bench: &Bench, camera: &Camera, depth: &[DepthImage]) {
    let (n, ring) = (depth[0].data.len(), depth.len());
    let context = FrameContext::default();
    let corrector = Corrector::new(camera).expect("a usable camera");
    let mut points = vec![vec![0.0f32; 3 * n]; ring];
    bench.case("correct_and_points", 22, |k| {
        let k = k % ring;
        let out = PointsMut::Interleaved(&mut points[k]);
        corrector.correct_to_points(black_box(&depth[k]), 1.0, &context, out).expect("sizes agree");
    });
    bench.case("points", 22, |k| {
        let k = k % ring;
        let out = PointsMut::Interleaved(&mut points[k]);
        corrector.points_into(black_box(&depth[k]), 1.0, out).expect("sizes agree");
    });
}

/// Undistorted images and depth.
fn remaps(bench: &Bench, camera: &Camera, depth: &[DepthImage]) {
    let ring = depth.len();
    let remap = Remap::undistort(camera);
    let mut out = depth.to_vec();
    bench.case("remap_nearest", 8, |k| {
        let k = k % ring;
        remap.nearest(black_box(&depth[k].data), &mut out[k].data).expect("sizes agree");
    });
    bench.case("remap_depth", 8, |k| {
        let k = k % ring;
        remap.depth(black_box(&depth[k].data), &mut out[k].data).expect("sizes agree");
    });
    let gray: Vec<Vec<u8>> = depth.iter().map(|d| d.data.iter().map(|v| *v as u8).collect()).collect();
    let mut gray_out = gray.clone();
    bench.case("remap_linear", 8, |k| {
        let k = k % ring;
        remap.linear(black_box(&gray[k]), &mut gray_out[k]).expect("sizes agree");
    });
}

/// Rays of all pixels in single and double precision, into `ring` images.
fn rays(bench: &Bench, camera: &Camera, ring: usize) {
    let n = bench.size.0 * bench.size.1;
    let rays = Rays::new(camera);
    let mut single = vec![[vec![0.0f32; n], vec![0.0f32; n]]; ring];
    bench.case("rays", 8, |k| {
        let [x, y] = &mut single[k % ring];
        black_box(&rays).single([x, y]).expect("sizes agree");
    });
    drop(single);
    let ring = ring.min(32);
    let mut double = vec![[vec![0.0f64; n], vec![0.0f64; n]]; ring];
    bench.case("rays_1e-9", 16, |k| {
        let [x, y] = &mut double[k % ring];
        black_box(&rays).double([x, y]).expect("sizes agree");
    });
}
