//! A video of a board that a hand moves before the camera, as images and depth in PGM, and a capture of another day of the same
//! camera.
//!
//! `cargo run --release --example moving_board -- FOLDER [--seconds 120] [--rate 30]`
//!
//! writes `FOLDER/video` (a dataset of all frames) and `FOLDER/other` (60 frames at rest, which judge a calibration). The hand
//! holds the board for a second at every of the usual poses, with a tremor, and takes 1.7 s to the next one; what is exposed
//! while it moves is the mean of three moments of a 60th of a second. `benches/recording.py` makes a recording of it.

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use depthcal_simulate::{CameraTruth, Kind, Pose, RenderedFrame, Simulation};
use nalgebra::{Rotation3, Vector3};
use rayon::prelude::*;

type Failure = Box<dyn Error + Send + Sync>;

/// Seconds at a pose, on the way to the next one, and of an exposure.
const AT_REST_S: f64 = 1.0;
const ON_THE_WAY_S: f64 = 1.7;
const EXPOSURE_S: f64 = 1.0 / 60.0;
/// Moments of an exposure.
const MOMENTS: usize = 3;
/// Tremor of a hand: mm, radians, and its two frequencies in Hz.
const TREMOR_MM: f64 = 0.4;
const TREMOR_RAD: f64 = 0.001;
const TREMOR_HZ: [f64; 2] = [1.7, 4.3];
/// Brightest value of an image of 8 bits.
const WHITE: u16 = 255;

struct Options {
    folder: PathBuf,
    seconds: f64,
    rate_hz: f64,
}

impl Options {
    fn of_arguments() -> Result<Self, Failure> {
        let usage = "usage: moving_board FOLDER [--seconds S] [--rate HZ]";
        let mut options = Self { folder: PathBuf::new(), seconds: 120.0, rate_hz: 30.0 };
        let mut arguments = std::env::args().skip(1);
        options.folder = arguments.next().ok_or(usage)?.into();
        while let Some(name) = arguments.next() {
            let value: f64 = arguments.next().ok_or(usage)?.parse()?;
            match name.as_str() {
                "--seconds" => options.seconds = value,
                "--rate" => options.rate_hz = value,
                _ => return Err(usage.into()),
            }
        }
        Ok(options)
    }
}

/// Where the hand holds the board, one pose after the other.
struct Hand {
    poses: Vec<Pose>,
}

impl Hand {
    /// The pose of the board at a time.
    fn pose(&self, time_s: f64) -> Pose {
        let cycle = AT_REST_S + ON_THE_WAY_S;
        let (index, within) = ((time_s / cycle) as usize, time_s % cycle);
        let pose = |i: usize| self.poses[i % self.poses.len()];
        let (from, to) = (pose(index), pose(index + 1));
        let s = ((within - AT_REST_S) / ON_THE_WAY_S).max(0.0);
        let s = s * s * (3.0 - 2.0 * s);
        let rotation = |pose: &Pose| Rotation3::from_matrix_unchecked(pose.matrix());
        let turn = (rotation(&from).inverse() * rotation(&to)).scaled_axis();
        let [slow, fast] = TREMOR_HZ.map(|f| (std::f64::consts::TAU * f * time_s).sin());
        let tremor = Vector3::new(slow, fast, 0.5 * (slow - fast));
        let turned = rotation(&from) * Rotation3::new(turn * s) * Rotation3::new(TREMOR_RAD * tremor);
        let [start, end] = [from, to].map(|pose| Vector3::from(pose.translation));
        let place = start.lerp(&end, s) + TREMOR_MM * Vector3::new(fast, slow, fast * slow);
        Pose::from_rotation_vector(turned.scaled_axis().into(), place.into())
    }

    fn is_moving(&self, time_s: f64) -> bool {
        time_s % (AT_REST_S + ON_THE_WAY_S) > AT_REST_S
    }
}

fn main() -> Result<(), Failure> {
    let options = Options::of_arguments()?;
    let camera = CameraTruth::published(1)?;
    let simulation = |seed: u64| Simulation::new(camera, Kind::General(1), &[], seed);
    simulation(2).frames(60).write_dataset(options.folder.join("other"))?;

    let cycle_s = AT_REST_S + ON_THE_WAY_S;
    let held = simulation(1).frames((options.seconds / cycle_s).ceil() as usize + 1);
    let poses = held.renderer()?.truth().frames.iter().map(|frame| frame.pose).collect();
    let hand = Hand { poses };
    let video = options.folder.join("video");
    for name in ["image", "depth"] {
        fs::create_dir_all(video.join(name))?;
    }
    let count = (options.seconds * options.rate_hz) as usize;
    let times: Vec<f64> = (0..count).map(|i| i as f64 / options.rate_hz).collect();
    times.par_iter().enumerate().try_for_each(|(i, time_s)| -> Result<(), Failure> {
        let moments = if hand.is_moving(*time_s) { MOMENTS } else { 1 };
        let moment = |m: usize| time_s + EXPOSURE_S * (m as f64 - 0.5 * (moments - 1) as f64) / MOMENTS as f64;
        let poses = (0..moments).map(|m| hand.pose(moment(m))).collect();
        let exposure = simulation(1000 + i as u64).poses(poses);
        let renderer = exposure.renderer()?;
        let rendered: Vec<RenderedFrame> = (0..moments).filter_map(|m| renderer.frame(m)).collect();
        write(&video, i, &rendered)
    })?;
    let mut table = String::from("frame,timestamp_s\n");
    for (i, time_s) in times.iter().enumerate() {
        let _ = writeln!(table, "{i:05},{time_s:.4}");
    }
    fs::write(video.join("frames.csv"), table)?;
    let declared = fs::read_to_string(options.folder.join("other/dataset.toml"))?.replace(".png", ".pgm");
    fs::write(video.join("dataset.toml"), declared)?;
    Ok(())
}

/// The mean of the images of an exposure, and the depth of its middle.
fn write(video: &Path, index: usize, moments: &[RenderedFrame]) -> Result<(), Failure> {
    let middle = &moments[moments.len() / 2];
    let mean = |pixel: usize| moments.iter().map(|m| u32::from(m.image[pixel])).sum::<u32>() / moments.len() as u32;
    let image: Vec<u8> = (0..middle.image.len()).map(|i| mean(i).min(u32::from(WHITE)) as u8).collect();
    let depth: Vec<u8> = middle.depth.iter().flat_map(|d| d.to_be_bytes()).collect();
    for (folder, most, values) in [("image", WHITE, &image), ("depth", u16::MAX, &depth)] {
        let mut file = fs::File::create(video.join(folder).join(format!("{index:05}.pgm")))?;
        write!(file, "P5\n{} {}\n{most}\n", middle.width, middle.height)?;
        file.write_all(values)?;
    }
    Ok(())
}
