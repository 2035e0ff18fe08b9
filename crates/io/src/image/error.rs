//! Errors of images.

use std::io;
use std::path::{Path, PathBuf};

/// Why an image cannot be used. Every message names the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The file cannot be opened or read.
    #[error("{path}: cannot read the image: {error}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        error: io::Error,
    },
    /// The image's data are broken or incomplete.
    #[error("{path}: this {format} image is damaged or incomplete: {message}; copy or capture it anew")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Name of the format.
        format: &'static str,
        /// The decoder's message.
        message: String,
    },
    /// A file of an unknown format.
    #[error("{path}: this is not an image of a known format: convert it to {expected}")]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// Formats that are read.
        expected: &'static str,
    },
    /// A variant of a known format that is not supported, or an image of an implausible size.
    #[error("{path}: {problem}")]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The problem and its remedy.
        problem: String,
    },
    /// An image that cannot hold depth.
    #[error(
        "{path}: a depth image holds one channel of 16-bit or floating-point values, but this is {found}: save the depth as 16-bit grey PNG, \
         or as TIFF, NPY, EXR or 16-bit PGM"
    )]
    NotDepth {
        /// The file.
        path: PathBuf,
        /// The contents of the file.
        found: String,
    },
    /// Image and depth of a frame differ in size.
    #[error(
        "{image} has {}×{} pixels, but {depth} has {}×{}: a frame's image and depth must lie on one pixel grid; {}",
        .image_size[0], .image_size[1], .depth_size[0], .depth_size[1], sizes_remedy((image, *.image_size), (depth, *.depth_size), *.orientation)
    )]
    SizesDiffer {
        /// The image.
        image: PathBuf,
        /// Width and height of the image, px.
        image_size: [usize; 2],
        /// The depth image.
        depth: PathBuf,
        /// Width and height of the depth image, px.
        depth_size: [usize; 2],
        /// The image's EXIF orientation, where it is another than 1.
        orientation: Option<u16>,
    },
}

/// The remedy for an image and a depth image of different sizes.
fn sizes_remedy(
    (image_path, image): (&Path, [usize; 2]),
    (depth_path, depth): (&Path, [usize; 2]),
    orientation: Option<u16>,
) -> String {
    let is_array =
        |path: &Path| path.extension().is_some_and(|extension| extension.to_string_lossy().starts_with("np"));
    let turned = match orientation {
        Some(5) => Some("transposed"),
        Some(6) => Some("turned by 90° clockwise"),
        Some(7) => Some("transposed and turned by 180°"),
        Some(8) => Some("turned by 90° anticlockwise"),
        _ => None,
    };
    match (image == [depth[1], depth[0]], orientation.zip(turned)) {
        (true, Some((number, turned))) => format!(
            "the image's EXIF orientation {number} has viewers show it {turned}, which does not change its pixels, and the depth lies as it is shown: \
             write the image as it is shown without that entry, or turn the depth back"
        ),
        (true, None) if is_array(image_path) != is_array(depth_path) => {
            "the array was saved as (width, height): save its transpose, with the shape (height, width)".to_owned()
        }
        (true, None) => "one of them is turned by 90°: turn it back".to_owned(),
        (false, _) => "register the depth to the image".to_owned(),
    }
}
