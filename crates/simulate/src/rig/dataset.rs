//! Captures of a rig as dataset folders: a folder per camera, one `dataset.toml` and one `frames.csv`.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::camera::{RigCamera, Streams};
use super::simulation::RigSimulation;
use super::truth::RigTruth;
use crate::dataset::{conditions_csv, write_png, write_rgb, write_text};
use crate::error::SimulateError;
use crate::noise::Noise;
use crate::render::RenderedFrame;
use crate::simulation::Simulation;
use crate::streams::{Purpose, stream};

/// Sensitivity of red, green and blue pixels to the light of the room.
const COLOUR_GAINS: [f64; 3] = [0.92, 1.0, 0.78];

impl RigSimulation {
    /// Names of the files and folders that [`RigSimulation::write_dataset`] makes, `dataset.toml` last.
    pub fn parts(&self) -> Vec<String> {
        let cameras = self.cameras.iter().map(|camera| camera.name.clone());
        cameras.chain(["frames.csv".to_owned(), "dataset.toml".to_owned()]).collect()
    }

    /// Renders every frame of every camera and writes the dataset into `dir`, as
    /// [`Simulation::write_dataset`](crate::Simulation::write_dataset) does for one camera.
    ///
    /// # Errors
    /// [`SimulateError`] when a parameter is unusable; [`SimulateError::NotEmpty`] when `dir` already has frames;
    /// [`SimulateError::Write`] and [`SimulateError::Png`] with the file.
    pub fn write_dataset(&self, dir: impl AsRef<Path>) -> Result<RigTruth, SimulateError> {
        let dir = dir.as_ref();
        let simulations = self.simulations()?;
        if self.parts().iter().any(|part| dir.join(part).exists()) {
            return Err(SimulateError::NotEmpty { path: dir.to_owned() });
        }
        let mut truths = Vec::new();
        for (camera, simulation) in self.cameras.iter().zip(&simulations) {
            let renderer = simulation.renderer()?;
            let folder = dir.join(&camera.name);
            let parts = [("image", camera.streams.has_image()), ("depth", camera.streams.has_depth())];
            for (part, _) in parts.iter().filter(|(_, has)| *has) {
                let path = folder.join(part);
                fs::create_dir_all(&path).map_err(|source| SimulateError::Write { path, source })?;
            }
            (0..renderer.len()).into_par_iter().try_for_each(|index| match renderer.frame(index) {
                Some(frame) => write_frame(&folder, camera, simulation, (index, &frame)),
                None => Ok(()),
            })?;
            truths.push(renderer.truth().clone());
        }
        let truth = self.truth_of(truths);
        if let (Some(first), Some(simulation)) = (truth.cameras.first(), simulations.first()) {
            write_text(dir.join("frames.csv"), &conditions_csv(&first.truth))?;
            write_text(dir.join("dataset.toml"), &declaration(&self.cameras, simulation))?;
        }
        Ok(truth)
    }
}

fn write_frame(
    folder: &Path,
    camera: &RigCamera,
    simulation: &Simulation,
    (index, frame): (usize, &RenderedFrame),
) -> Result<(), SimulateError> {
    let file = format!("{}.png", frame.name);
    let size = (frame.width, frame.height);
    let image = folder.join("image").join(&file);
    match camera.streams {
        Streams::Colour => write_rgb(image, size, &colours(frame, &camera.noise, simulation.seed, index))?,
        Streams::InfraredAndDepth => write_png(image, size, &frame.image, simulation.rendering.image_bits)?,
        Streams::Depth => {}
    }
    if camera.streams.has_depth() {
        write_png(folder.join("depth").join(&file), size, &frame.depth, 16)?;
    }
    Ok(())
}

/// Red, green and blue of every pixel, each with noise of its own.
fn colours(frame: &RenderedFrame, noise: &Noise, seed: u64, index: usize) -> Vec<u8> {
    let mut rng = stream(seed, Purpose::ColourNoise, index);
    let mut values = Vec::with_capacity(3 * frame.amplitude.len());
    for signal in &frame.amplitude {
        for gain in COLOUR_GAINS {
            let signal = gain * f64::from(*signal);
            let sigma = (noise.image_read * noise.image_read + noise.image_shot * signal).sqrt();
            let value = signal + sigma * rng.sample::<f64, _>(StandardNormal);
            values.push((value.clamp(0.0, 1.0) * 255.0).round() as u8);
        }
    }
    values
}

/// The text of `dataset.toml`.
fn declaration(cameras: &[RigCamera], simulation: &Simulation) -> String {
    let mut text = simulation.board_declaration();
    text.push_str("\n[frames]\nmetadata = \"frames.csv\"\n");
    for camera in cameras {
        let name = &camera.name;
        let _ = writeln!(text, "\n[cameras.{name}]");
        if camera.streams.has_image() {
            let _ = writeln!(text, "image = \"{name}/image/*.png\"");
        }
        if camera.streams.has_depth() {
            let _ = writeln!(text, "depth = \"{name}/depth/*.png\"\nunit_mm = {:?}", simulation.declared_unit_mm());
        }
    }
    text
}
