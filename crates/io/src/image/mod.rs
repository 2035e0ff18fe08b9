//! Images in memory and on disk.

mod error;
mod files;
mod jpeg;
mod pgm;
mod pixels;
mod png16;
mod raster;

pub use error::ImageError;
pub use files::{check_same_size, read_depth, read_gray, read_rgb, write_depth, write_gray};
pub use raster::{DepthImage, GrayImage, RgbImage};
