//! From a recording to a dataset.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

use depthcal_io::{DepthValues, write_atomically, write_depth_frame, write_gray};
use depthcal_model::Target;

use crate::dataset::{Imported, Written, describe};
use crate::error::ImportError;
use crate::guess::{Chosen, choose};
use crate::message::{Content, content};
use crate::pairing::{Pairing, paired};
use crate::pick::{PickOptions, Picked, pick};
use crate::picture::{Encoding, Picture};
use crate::recording::Recording;

/// Options of an import.
#[derive(Debug, Clone)]
pub struct ImportOptions {
    /// Stream of the images; chosen by name and size where `None`.
    pub image: Option<String>,
    /// Stream of the depth; chosen where `None`, and left out where `none`.
    pub depth: Option<String>,
    /// The board that the images are to show.
    pub board: Option<Target>,
    /// Largest number of frames.
    pub frames: usize,
    /// How depth is paired with images.
    pub pairing: Pairing,
    /// Seconds at the beginning of the images that are left out: a camera that warms up, or finds its exposure.
    pub skip_s: f64,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self { image: None, depth: None, board: None, frames: 40, pairing: Pairing::Time, skip_s: 0.0 }
    }
}

/// Imports frames of a recording into the folder `out`: images, depth, `frames.csv` and `dataset.toml`, and what the recording
/// says of its cameras.
///
/// Depth belongs to the image that is nearest in time, at most half the depth stream's usual distance of frames away, if
/// [`ImportOptions::pairing`] asks for nothing else. Depth keeps its values bit by bit; images do too, but for uncompressed
/// colour, which becomes luma. Of a file that is cut off, what is complete is read.
///
/// # Errors
/// [`ImportError`] with the file, the stream and the remedy.
pub fn import(path: &Path, out: &Path, options: &ImportOptions) -> Result<Imported, ImportError> {
    let recording = Recording::open(path)?;
    let chosen = choose(&recording, options.image.as_deref(), options.depth.as_deref())?;
    let wanted = PickOptions { board: options.board.as_ref(), wanted: options.frames, skip_s: options.skip_s };
    let picked = pick(&recording, &chosen.image, &wanted)?;
    if picked.images.is_empty() {
        let stream = chosen.image.stream.name.clone();
        return Err(ImportError::Skipped { path: path.to_owned(), stream, images: picked.of, skip_s: options.skip_s });
    }
    let pairs = match &chosen.depth {
        Some(depth) => paired(&recording, [&chosen.image, depth], &picked, options.pairing)?,
        None => Vec::new(),
    };
    let written = write(&recording, &chosen, &picked, &pairs, out)?;
    describe(&recording, &chosen, &picked, written, options.board.as_ref(), out)
}

/// Writes the picked images that have depth, where there is depth at all.
fn write(
    recording: &Recording,
    chosen: &Chosen,
    picked: &Picked,
    pairs: &[Option<usize>],
    out: &Path,
) -> Result<Written, ImportError> {
    // Frames are numbered in the order of time, whatever the order of the file.
    let mut order: Vec<usize> = (0..picked.images.len()).filter(|i| pairs.is_empty() || pairs[*i].is_some()).collect();
    order.sort_by_key(|i| picked.images[*i].time_ns);
    let name = |rank: usize| format!("{:04}", rank + 1);
    let mut images: BTreeMap<usize, String> = BTreeMap::new();
    let mut depths: BTreeMap<usize, Vec<String>> = BTreeMap::new();
    let mut frames = Vec::new();
    for (rank, i) in order.iter().enumerate() {
        images.insert(picked.images[*i].number, name(rank));
        if let Some(Some(number)) = pairs.get(*i) {
            depths.entry(*number).or_default().push(name(rank));
        }
        frames.push((name(rank), picked.images[*i].time_ns));
    }
    let mut image_extension = "png";
    let mut depth_extension = "png";
    let (mut next_image, mut next_depth) = (0, 0);
    let image_stream = &chosen.image.stream;
    let depth_stream = chosen.depth.as_ref().map(|depth| &depth.stream);
    let is_wanted = |s: &crate::recording::StreamInfo| s == image_stream || Some(s) == depth_stream;
    recording.visit(&is_wanted, &mut |packet| {
        let Content::Picture(_, picture) = content(&recording.path, &packet)? else {
            return Ok(ControlFlow::Continue(()));
        };
        if packet.stream == image_stream {
            if let Some(name) = images.get(&next_image) {
                image_extension = write_image(&recording.path, &picture, &out.join("image"), name)?;
            }
            next_image += 1;
        } else {
            for name in depths.get(&next_depth).into_iter().flatten() {
                let frame = picture.depth(&recording.path)?;
                depth_extension = if matches!(frame.values, DepthValues::Float(_)) { "tiff" } else { "png" };
                write_depth_frame(out.join("depth").join(format!("{name}.{depth_extension}")), &frame)?;
            }
            next_depth += 1;
        }
        Ok(ControlFlow::Continue(()))
    })?;
    Ok(Written { frames, image_extension, depth_extension })
}

/// Writes an image; files within messages stay as they are. Returns the extension.
fn write_image(
    recording: &Path,
    picture: &Picture<'_>,
    folder: &Path,
    name: &str,
) -> Result<&'static str, ImportError> {
    if picture.encoding == Encoding::File {
        let extension = if picture.data.starts_with(b"\x89PNG") { "png" } else { "jpg" };
        let path = folder.join(format!("{name}.{extension}"));
        write_atomically(path, |file| file.write_all(picture.data))?;
        return Ok(extension);
    }
    write_gray(folder.join(format!("{name}.png")), &picture.gray(recording)?)?;
    Ok("png")
}
