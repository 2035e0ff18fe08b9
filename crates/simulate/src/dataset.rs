//! Captures as dataset folders: `dataset.toml`, `frames.csv`, images and depth images.

use std::fmt::Write as _;
use std::fs;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::board::Pattern;
use crate::error::SimulateError;
use crate::render::RenderedFrame;
use crate::simulation::Simulation;
use crate::truth::Truth;

impl Simulation {
    /// Renders every frame and writes the dataset into `dir`, which is created if necessary. The folder does not reveal
    /// what was simulated; only the returned truth does. `dataset.toml` is written last, so that an interrupted run
    /// leaves no folder that counts as a dataset.
    ///
    /// # Errors
    /// [`SimulateError`] when a parameter is unusable; [`SimulateError::NotEmpty`] when `dir` already has frames;
    /// [`SimulateError::Write`] and [`SimulateError::Png`] with the file.
    pub fn write_dataset(&self, dir: impl AsRef<Path>) -> Result<Truth, SimulateError> {
        let dir = dir.as_ref();
        let renderer = self.renderer()?;
        if ["dataset.toml", "image", "depth"].iter().any(|name| dir.join(name).exists()) {
            return Err(SimulateError::NotEmpty { path: dir.to_owned() });
        }
        for folder in ["image", "depth"] {
            let path = dir.join(folder);
            fs::create_dir_all(&path).map_err(|source| SimulateError::Write { path, source })?;
        }
        let write_frame = |index: usize| match renderer.frame(index) {
            Some(frame) => self.write_frame(dir, &frame),
            None => Ok(()),
        };
        (0..renderer.len()).into_par_iter().try_for_each(write_frame)?;
        write_text(dir.join("frames.csv"), &conditions_csv(renderer.truth()))?;
        write_text(dir.join("dataset.toml"), &self.declaration())?;
        Ok(renderer.truth().clone())
    }

    fn write_frame(&self, dir: &Path, frame: &RenderedFrame) -> Result<(), SimulateError> {
        let file = format!("{}.png", frame.name);
        let size = (frame.width, frame.height);
        write_png(dir.join("image").join(&file), size, &frame.image, self.rendering.image_bits)?;
        write_png(dir.join("depth").join(&file), size, &frame.depth, 16)
    }

    /// The text of `dataset.toml`, with board and depth unit as declared, which defects make differ from the truth.
    fn declaration(&self) -> String {
        let mut text = self.board_declaration();
        let unit = self.declared_unit_mm();
        let _ = write!(
            text,
            "\n[frames]\nimage = \"image/*.png\"\ndepth = \"depth/*.png\"\nmetadata = \"frames.csv\"\n\n[depth]\nunit_mm \
             = {unit:?}\n"
        );
        text
    }

    /// Millimetres per step of the depth images as declared.
    pub(crate) fn declared_unit_mm(&self) -> f64 {
        self.rendering.depth_unit_mm * self.defects.depth_unit_factor
    }

    /// The section `[board]` of `dataset.toml`.
    pub(crate) fn board_declaration(&self) -> String {
        let board = &self.board;
        let factor = self.defects.spacing_factor;
        let kind = match board.pattern {
            Pattern::AsymmetricCircles { .. } => "asymmetric-circles",
            Pattern::SymmetricCircles { .. } => "symmetric-circles",
            Pattern::Chessboard => "chessboard",
        };
        let mut text = format!(
            "[board]\nkind = \"{kind}\"\ncolumns = {}\nrows = {}\nspacing_mm = {:?}\n",
            board.columns,
            board.rows,
            board.spacing_mm * factor
        );
        if let Some(diameter) = board.circle_diameter_mm() {
            let _ = writeln!(text, "circle_diameter_mm = {:?}", diameter * factor);
        }
        text
    }
}

pub(crate) fn conditions_csv(truth: &Truth) -> String {
    let mut text = String::from("frame,timestamp_s,temperature_c\n");
    for frame in &truth.frames {
        let _ = writeln!(text, "{},{:.3},{:.2}", frame.name, frame.conditions.time_s, frame.conditions.temperature_c);
    }
    text
}

pub(crate) fn write_text(path: PathBuf, text: &str) -> Result<(), SimulateError> {
    fs::write(&path, text).map_err(|source| SimulateError::Write { path, source })
}

/// Writes a grey image of 8 or 16 bits.
pub(crate) fn write_png(path: PathBuf, size: (usize, usize), values: &[u16], bits: u8) -> Result<(), SimulateError> {
    let (bytes, depth): (Vec<u8>, _) = match bits {
        8 => (values.iter().map(|&value| value.min(255) as u8).collect(), png::BitDepth::Eight),
        _ => (values.iter().flat_map(|value| value.to_be_bytes()).collect(), png::BitDepth::Sixteen),
    };
    write_bytes(path, size, &bytes, png::ColorType::Grayscale, depth)
}

/// Writes a colour image of 8 bits, three values per pixel.
pub(crate) fn write_rgb(path: PathBuf, size: (usize, usize), values: &[u8]) -> Result<(), SimulateError> {
    write_bytes(path, size, values, png::ColorType::Rgb, png::BitDepth::Eight)
}

fn write_bytes(
    path: PathBuf,
    (width, height): (usize, usize),
    bytes: &[u8],
    colour: png::ColorType,
    depth: png::BitDepth,
) -> Result<(), SimulateError> {
    let encode = |file: fs::File| -> Result<(), png::EncodingError> {
        let mut out = BufWriter::new(file);
        let mut encoder = png::Encoder::new(&mut out, width as u32, height as u32);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.set_compression(png::Compression::Fast);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(bytes)?;
        writer.finish()?;
        out.flush()?;
        Ok(())
    };
    match fs::File::create(&path) {
        Ok(file) => encode(file).map_err(|source| match source {
            png::EncodingError::IoError(source) => SimulateError::Write { path, source },
            source => SimulateError::Png { path, source },
        }),
        Err(source) => Err(SimulateError::Write { path, source }),
    }
}
