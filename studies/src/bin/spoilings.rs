//! How often the search for the cause names the right one, none, or a wrong one, over captures that are spoiled in known ways.
//!
//!     cargo run --release -p depthcal-studies --bin spoilings [CAPTURES]
//!
//! Every capture, 4 by default, is spoiled in some 50 ways: its depth by one fault and by two at once, and its board. Captures
//! that are not spoiled, some with strong effects, count as spoiled by nothing: any cause is a wrong one.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]
#![allow(
    unexpected_cfgs,
    dead_code,
    reason = "what it shares with tests of depthcal-detect asks for the configuration of that crate"
)]

#[path = "../../../crates/detect/tests/common/mod.rs"]
mod common;

use std::error::Error;
use std::time::Instant;

use common::{Camera, Pose, Scene, Style, Texture};
use depthcal_calibration::calibrate::{CameraOptions, calibrate_image};
use depthcal_calibration::cause::{
    BoardFault, DepthAlternative, DepthCause, DepthFinding, Quantity, Turn, board_cause, examine_depth,
};
use depthcal_calibration::load::{LoadOptions, load};
use depthcal_calibration::observe::{CameraFrames, MeasuredDepth, PosedFrame, RawFrame};
use depthcal_io::{DepthFrame, DepthValues, GrayImage};
use depthcal_model::target::{Pattern, Target};
use depthcal_simulate::{CameraTruth, Effect, Kind, Simulation};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// One fault of depth.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Turned(Turn),
    Holds(Quantity),
    OfFrame(isize),
    /// Of its unit: by this factor.
    Scaled(f64),
    /// Of its pixel grid: focal length over that of the image.
    OnOtherGrid(f64),
}

const FAULTS: [Fault; 11] = [
    Fault::Turned(Turn::LeftRight),
    Fault::Turned(Turn::UpDown),
    Fault::Turned(Turn::HalfTurn),
    Fault::Holds(Quantity::Range),
    Fault::Holds(Quantity::ExchangedBytes),
    Fault::Holds(Quantity::Disparity),
    Fault::OfFrame(-1),
    Fault::OfFrame(1),
    Fault::Scaled(4.0),
    Fault::OnOtherGrid(0.7),
    Fault::OnOtherGrid(1.25),
];

/// Effects of cameras that are right as they are declared.
const STRONG: [(&str, f64); 4] =
    [("cyclic_depth", 20.0), ("quadratic_depth", 20.0), ("radial_range", 10.0), ("temporal_drift", 20.0)];

#[derive(Default)]
struct Count {
    right: usize,
    none: usize,
    wrong: usize,
    seconds: f64,
}

impl Count {
    fn add(&mut self, is_right: Option<bool>, seconds: f64) {
        match is_right {
            Some(true) => self.right += 1,
            Some(false) => self.wrong += 1,
            None => self.none += 1,
        }
        self.seconds = self.seconds.max(seconds);
    }

    fn row(&self, name: &str) -> String {
        let all = self.right + self.none + self.wrong;
        let percent = |count: usize| format!("{:.0} %", 100.0 * count as f64 / all.max(1) as f64);
        let Self { right, none, wrong, seconds } = self;
        format!("| {name} | {all} | {} | {} | {} | {seconds:.1} s |", percent(*right), percent(*none), percent(*wrong))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let captures: u64 = std::env::args().nth(1).map_or(Ok(4), |n| n.parse())?;
    let mut counts: [Count; 4] = Default::default();
    for seed in 0..captures {
        for (effect, size) in std::iter::once(None).chain(STRONG.map(Some)).map(|effect| effect.unzip()) {
            let effects = effect.zip(size).map(|(name, size)| Effect::new(name, size)).transpose()?;
            let capture = posed(seed, effects.as_slice())?;
            judge(&capture, &[], &mut counts[0]);
            if effect.is_none() {
                spoil_in_all_ways(&capture, seed, &mut counts);
            }
        }
        boards(seed, &mut counts[3]);
    }
    println!(
        "| spoiled | captures | right cause | none | wrong cause | longest search |\n|---|---:|---:|---:|---:|---:|"
    );
    for (name, count) in ["nothing", "depth, one fault", "depth, two faults", "board"].into_iter().zip(&counts) {
        println!("{}", count.row(name));
    }
    Ok(())
}

/// A rendered capture with the poses of its boards by its images.
fn posed(seed: u64, effects: &[Effect]) -> Result<(CameraFrames<PosedFrame>, depthcal_model::Camera), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let camera = CameraTruth::published(1 + seed as usize % 4)?;
    Simulation::new(camera, Kind::General(1), effects, 900 + seed).frames(16).write_dataset(folder.path())?;
    let options = LoadOptions { cache: None, ..LoadOptions::default() };
    let loaded = load(folder.path(), &options)?.into_only_camera()?;
    let calibrated = calibrate_image(&loaded.capture, &CameraOptions::default())?;
    Ok((calibrated.capture, calibrated.camera))
}

fn spoil_in_all_ways(capture: &(CameraFrames<PosedFrame>, depthcal_model::Camera), seed: u64, counts: &mut [Count; 4]) {
    for (i, first) in FAULTS.into_iter().enumerate() {
        judge(capture, &[first], &mut counts[1]);
        for (j, second) in FAULTS.into_iter().enumerate().skip(i + 1) {
            let is_one_kind = std::mem::discriminant(&first) == std::mem::discriminant(&second);
            let is_grid = matches!(second, Fault::OnOtherGrid(_));
            let is_scaled_disparity = first == Fault::Holds(Quantity::Disparity) && matches!(second, Fault::Scaled(_));
            // Two in three, others of every capture.
            if !is_one_kind && !is_grid && !is_scaled_disparity && !(i + j + seed as usize).is_multiple_of(3) {
                judge(capture, &[first, second], &mut counts[2]);
            }
        }
    }
}

/// Spoils depth, searches for the cause, and counts the answer.
fn judge((capture, camera): &(CameraFrames<PosedFrame>, depthcal_model::Camera), faults: &[Fault], count: &mut Count) {
    let mut spoiled = capture.clone();
    for fault in faults {
        spoil(&mut spoiled, *fault);
    }
    let start = Instant::now();
    let finding = examine_depth(&spoiled, camera);
    let seconds = start.elapsed().as_secs_f64();
    let answer = match &finding {
        Ok(DepthFinding::Cause(cause)) => Some(is_right(cause, faults)),
        // A unit that is wrong, and nothing else, is said by the check of the scale; and nothing is nothing.
        _ if faults.iter().all(|fault| matches!(fault, Fault::Scaled(_))) => Some(true),
        _ => None,
    };
    if answer != Some(true) {
        println!("{faults:?} of {}: {finding:?}", capture.name);
    }
    count.add(answer, seconds);
}

fn is_right(cause: &DepthCause, faults: &[Fault]) -> bool {
    let mut truth = DepthAlternative::DECLARED;
    let mut scale = 1.0;
    let mut grid = None;
    for fault in faults {
        match *fault {
            Fault::Turned(turn) => truth.turn = turn,
            Fault::Holds(quantity) => truth.quantity = quantity,
            Fault::OfFrame(frame) => truth.frame = frame,
            Fault::Scaled(factor) => scale = factor,
            Fault::OnOtherGrid(ratio) => grid = Some(ratio),
        }
    }
    match cause {
        DepthCause::Other { alternative, deviation, .. } => {
            *alternative == truth && grid.is_none() && (deviation.scale / scale - 1.0).abs() < 0.2
        }
        DepthCause::OtherGrid { registration, .. } => {
            grid.is_some_and(|ratio| (registration.ratio / ratio - 1.0).abs() < 0.1)
        }
    }
}

fn spoil(capture: &mut CameraFrames<PosedFrame>, fault: Fault) {
    let size = [capture.width, capture.height];
    let mut depth: Vec<DepthFrame> = capture.frames.iter().filter_map(depth_of).collect();
    let count = depth.len();
    match fault {
        // The frame before it has its depth.
        Fault::OfFrame(frame) => {
            depth =
                (0..count).map(|i| depth[(i as isize + frame).rem_euclid(count as isize) as usize].clone()).collect()
        }
        other => depth.iter_mut().for_each(|depth| spoil_image(depth, other, size)),
    }
    for (frame, depth) in capture.frames.iter_mut().zip(depth) {
        frame.detected.raw.depth = MeasuredDepth::Image(depth.into());
    }
}

fn depth_of(frame: &PosedFrame) -> Option<DepthFrame> {
    Some((*frame.depth_image()?.get().ok()?).clone())
}

fn spoil_image(depth: &mut DepthFrame, fault: Fault, [width, height]: [usize; 2]) {
    let DepthValues::Steps(values) = &mut depth.values else { return };
    let before = values.clone();
    let centre = [(width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0];
    for (i, value) in values.iter_mut().enumerate() {
        let (u, v) = (i % width, i / width);
        let offset = [u as f64 - centre[0], v as f64 - centre[1]];
        let measured = (*value != 0 && *value != u16::MAX).then_some(f64::from(*value));
        let stored = |value: f64| value.round().clamp(1.0, 65534.0) as u16;
        *value = match fault {
            Fault::Turned(Turn::LeftRight) => before[v * width + width - 1 - u],
            Fault::Turned(Turn::UpDown) => before[(height - 1 - v) * width + u],
            Fault::Turned(_) => before[before.len() - 1 - i],
            // The published cameras have focal lengths of about 480 px.
            Fault::Holds(Quantity::Range) => measured
                .map_or(0, |z| stored(z * (1.0 + (offset[0].powi(2) + offset[1].powi(2)) / 480f64.powi(2)).sqrt())),
            Fault::Holds(Quantity::ExchangedBytes) => value.swap_bytes(),
            // In steps of 1/8 px, falling with the distance.
            Fault::Holds(_) => measured.map_or(0, |z| stored(8.0 * 480.0 * 50.0 * 8.0 / z)),
            Fault::Scaled(factor) => measured.map_or(0, |z| stored(z * factor)),
            Fault::OnOtherGrid(ratio) => {
                let [x, y] = [0, 1].map(|axis| (centre[axis] + offset[axis] / ratio).round());
                let is_inside = x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64;
                if is_inside { before[y as usize * width + x as usize] } else { 0 }
            }
            Fault::OfFrame(_) => *value,
        };
    }
}

/// Boards that are declared otherwise than they are printed.
fn boards(seed: u64, count: &mut Count) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let chessboard = common::chessboard(9, 6, 25.0);
    let charuco = common::charuco(9, 6, 28.0, 21.0, "DICT_5X5_250");
    let tags = common::aprilgrid(6, 5, 32.0, 24.0);
    let dots = common::asymmetric(4, 11, 17.0, 11.5);
    let size = |target: &Target, columns, rows| Target { columns, rows, ..target.clone() };
    let charuco_of =
        |marker_mm: f64, dictionary: &str, columns, rows| common::charuco(columns, rows, 28.0, marker_mm, dictionary);
    type Check = fn(&[BoardFault]) -> bool;
    let is_size: Check = |faults| matches!(faults, [BoardFault::Size { .. }]);
    let is_dictionary: Check =
        |faults| matches!(faults, [BoardFault::Dictionary { dictionary }] if dictionary.starts_with("DICT_5X5"));
    let both: Check = |faults| matches!(faults, [BoardFault::Dictionary { .. }, BoardFault::Size { .. }]);
    let is_first: Check = |faults| matches!(faults, [BoardFault::FirstTag { seen: [40, _] }]);
    let is_mirrored: Check = |faults| faults == [BoardFault::Mirrored];
    let is_charuco: Check = |faults| matches!(faults, [BoardFault::Kind { kind: "charuco", .. }, ..]);
    let is_chessboard: Check = |faults| matches!(faults, [BoardFault::Kind { kind: "chessboard", .. }, ..]);
    let is_circles: Check = |faults| matches!(faults, [BoardFault::Kind { kind: "asymmetric-circles", .. }, ..]);
    let is_side: Check =
        |faults| matches!(faults, [BoardFault::MarkerSide { share, .. }] if (share - 0.75).abs() < 0.03);
    let plain = Style::default();
    let later = Style { first_tag: 40, ..Style::default() };
    // Printed, its style, whether mirrored, declared, the right answer.
    let cases: Vec<(&Target, Style, bool, Target, Check)> = vec![
        (&chessboard, plain, false, size(&chessboard, 10, 7), is_size),
        (&chessboard, plain, false, size(&chessboard, 8, 5), is_size),
        (&chessboard, plain, false, charuco_of(21.0, "DICT_5X5_250", 10, 7), is_chessboard),
        (&charuco, plain, false, charuco_of(21.0, "DICT_6X6_250", 9, 6), is_dictionary),
        (&charuco, plain, false, charuco_of(21.0, "DICT_5X5_250", 6, 9), is_size),
        (&charuco, plain, false, charuco_of(21.0, "DICT_5X5_250", 8, 5), is_size),
        (&charuco, plain, false, charuco_of(21.0, "DICT_4X4_50", 6, 9), both),
        (&charuco, plain, true, charuco.clone(), is_mirrored),
        (&charuco, later, false, charuco.clone(), is_first),
        (&charuco, plain, false, size(&chessboard, 8, 5), is_charuco),
        (&tags, plain, false, size(&tags, 5, 6), is_size),
        (&tags, plain, false, Target { pattern: Pattern::Aprilgrid { marker_mm: 12.0 }, ..tags.clone() }, is_side),
        (&dots, plain, false, size(&dots, 11, 4), is_size),
        (&dots, plain, false, common::symmetric(4, 11, 17.0, 11.5), is_circles),
    ];
    for (printed, style, is_mirrored, declared, is_right) in cases {
        let texture = match printed.pattern {
            Pattern::Charuco { .. } | Pattern::Aprilgrid { .. } => Texture::with_tags(printed.clone(), 8.0, style),
            _ => Texture::new(printed.clone(), 25.0),
        };
        let images: Vec<RawFrame> =
            (0..5).map(|i| frame(printed, &texture, is_mirrored, 10 * seed + i, &mut rng)).collect();
        let start = Instant::now();
        let cause = board_cause(&declared, images.iter());
        let seconds = start.elapsed().as_secs_f64();
        let answer = cause.as_ref().map(|cause| is_right(&cause.faults));
        if answer != Some(true) {
            println!("{declared:?}, printed {printed:?}: {cause:?}");
        }
        count.add(answer, seconds);
    }
}

/// A rendered image of a board, tilted by up to 35°.
fn frame(target: &Target, texture: &Texture, is_mirrored: bool, seed: u64, rng: &mut ChaCha8Rng) -> RawFrame {
    let camera = Camera::thesis();
    let [low, high] = target.marker_rectangle();
    let middle = [0, 1].map(|axis| (low[axis] + high[axis]) / 2.0);
    let extent = [0, 1].map(|axis| high[axis] - low[axis]);
    let z = 1.25 * (camera.f * extent[0] / camera.width as f64).max(camera.f * extent[1] / camera.height as f64) * 1.3;
    let centre = [camera.width as f64 / 2.0, camera.height as f64 / 2.0].map(|c| c + rng.random_range(-30.0..30.0));
    let (tilt, direction, roll) =
        (rng.random_range(0.05..0.6), rng.random_range(0.0..std::f64::consts::TAU), rng.random_range(-0.3..0.3));
    let pose = Pose::looking(&camera, middle, centre, z, tilt, direction, roll);
    let mut image: GrayImage = Scene::new(camera, pose, texture, seed).render();
    if is_mirrored {
        let width = image.width;
        image.data.chunks_exact_mut(width).for_each(<[u16]>::reverse);
    }
    RawFrame { name: seed.to_string(), image: Some(image.into()), ..RawFrame::default() }
}
