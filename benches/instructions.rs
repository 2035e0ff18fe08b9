//! Instructions per pixel of the per-pixel paths, counted by valgrind's callgrind: a check that noise cannot touch.
//!
//! The program runs itself under callgrind, once with few frames and once with more; the difference is that of the frames
//! alone. Counts beyond the limits below fail. Valgrind has no AVX-512, so that these are the counts of the AVX2 loops.
//! Without valgrind nothing is checked.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::hint::black_box;
use std::process::{Command, ExitCode};

use depthcal_correction::{Corrector, FrameContext, PointsMut, Rays, Remap};
use depthcal_io::DepthImage;
use depthcal_model::{Camera, Register};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
const FEW: usize = 2;
const MORE: usize = 12;
/// Path and most instructions per pixel: some 5 % above what was counted when this was written.
const LIMITS: [(&str, f64); 6] = [
    ("correct_projective", 4.05),
    ("correct_multiplier", 1.75),
    ("correct_and_points", 13.8),
    ("remap_nearest", 4.45),
    ("remap_linear", 20.3),
    ("rays", 19.0),
];

fn camera(model: &str) -> Camera {
    let register = Register::builtin();
    let mut blocks = register.depth_model(model).unwrap();
    for block in &mut blocks {
        match block.name() {
            "projective" => block.theta.copy_from_slice(&[1.3406e-4, -3.52e-6, -6.99e-6, 1.00604654]),
            _ => block.theta.iter_mut().enumerate().for_each(|(i, m)| *m += 0.01 * (0.7 * i as f64).sin()),
        }
    }
    let mut lens = register.block("brown_conrady", None).unwrap();
    lens.theta.copy_from_slice(&[-0.1468, 0.0463, 0.0012, -0.0007, -0.0756]);
    blocks.push(lens);
    Camera::new(WIDTH, HEIGHT, [238.5, 238.5, 156.5, 121.2, 0.0], blocks)
}

fn frames(path: &str, count: usize) {
    let n = WIDTH * HEIGHT;
    let model = if path == "correct_multiplier" { "multiplier@bins=1" } else { "projective" };
    let camera = camera(model);
    let corrector = Corrector::new(&camera).unwrap();
    let (remap, rays) = (Remap::undistort(&camera), Rays::new(&camera));
    let depth =
        DepthImage { width: WIDTH, height: HEIGHT, data: (0..n).map(|i| 300 + (i * 7 % 1500) as u16).collect() };
    let gray: Vec<u8> = depth.data.iter().map(|v| *v as u8).collect();
    let (mut out, mut gray_out, mut points) = (depth.clone(), gray.clone(), vec![0.0f32; 3 * n]);
    let (mut x, mut y) = (vec![0.0f32; n], vec![0.0f32; n]);
    let context = FrameContext::default();
    for _ in 0..count {
        match path {
            "correct_projective" | "correct_multiplier" => {
                corrector.correct_u16(black_box(&depth), 1.0, &context, &mut out).unwrap();
            }
            "correct_and_points" => {
                let out = PointsMut::Interleaved(&mut points);
                corrector.correct_to_points(black_box(&depth), 1.0, &context, out).unwrap();
            }
            "remap_nearest" => remap.nearest(black_box(&depth.data), &mut out.data).unwrap(),
            "remap_linear" => remap.linear(black_box(&gray), &mut gray_out).unwrap(),
            _ => black_box(&rays).single([&mut x, &mut y]).unwrap(),
        }
    }
    black_box((out, gray_out, points, x, y));
}

/// Instructions of this program with some frames; `None` without valgrind.
fn instructions(path: &str, count: usize) -> Option<f64> {
    let program = std::env::current_exe().ok()?;
    let run = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(program)
        .args(["--frames", path, &count.to_string()])
        .env("RAYON_NUM_THREADS", "1")
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&run.stderr).into_owned();
    let line = text.lines().find(|line| line.contains("Collected"))?;
    line.rsplit(' ').next()?.trim().parse().ok()
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, flag, path, count] = arguments.as_slice()
        && flag == "--frames"
    {
        frames(path, count.parse().unwrap());
        return ExitCode::SUCCESS;
    }
    let mut within = true;
    for (path, limit) in LIMITS {
        let (Some(few), Some(more)) = (instructions(path, FEW), instructions(path, MORE)) else {
            println!("instructions: valgrind is not at hand, nothing is checked");
            return ExitCode::SUCCESS;
        };
        let per_pixel = (more - few) / ((MORE - FEW) * WIDTH * HEIGHT) as f64;
        let verdict = if per_pixel <= limit { "" } else { "  TOO MANY" };
        println!("{path:20} {per_pixel:6.2} instructions per pixel, at most {limit}{verdict}");
        within &= per_pixel <= limit;
    }
    if within { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
