//! Images in memory and on disk.

mod decoded;
mod depth_frame;
mod disparity;
mod error;
mod exr_file;
mod files;
mod jpeg;
mod npy;
mod pixels;
mod png16;
mod pnm;
mod raster;
mod tiff_file;

pub use depth_frame::{DepthFrame, DepthValues};
pub use disparity::Disparity;
pub use error::ImageError;
pub use files::{
    DEPTH_EXTENSIONS, IMAGE_EXTENSIONS, check_same_size, decode_depth_frame, decode_gray, decode_rgb, read_depth,
    read_depth_frame, read_gray, read_rgb, write_depth, write_depth_frame, write_gray, write_rgb,
};
pub(crate) use pixels::MAX_PIXELS;
pub use raster::{DepthImage, GrayImage, RgbImage};
