//! Images of every format.

use std::path::Path;

use depthcal_io::{
    DepthFrame, DepthValues, decode_depth_frame, decode_gray, decode_rgb, read_depth_frame, write_depth_frame,
};

use super::memory_folder;

/// Depth images of at most so many pixels are written and read again; more would be slow.
const SMALL: usize = 256;

/// Decodes an image as grey values, as colours and as depth. Depth that is written reads back with the same bits.
pub fn image(bytes: &[u8]) {
    let path = Path::new("image");
    if let Ok(image) = decode_gray(path, bytes) {
        assert_eq!(image.data.len(), image.width * image.height);
        assert!(image.bits == 16 || image.bits == 8 && image.data.iter().all(|value| *value < 256));
    }
    if let Ok(image) = decode_rgb(path, bytes) {
        assert_eq!(image.data.len(), image.width * image.height);
    }
    let Ok(depth) = decode_depth_frame(path, bytes) else { return };
    assert_eq!(depth.len(), depth.width * depth.height);
    if depth.len() <= SMALL {
        let name = match depth.values {
            DepthValues::Steps(_) => ["depth.png", "depth.pgm", "depth.npy", "depth.tiff"][depth.len() % 4],
            DepthValues::Float(_) => ["depth.exr", "depth.npy", "depth.tiff"][depth.len() % 3],
        };
        let file = memory_folder::path(name);
        write_depth_frame(&file, &depth).expect("depth is written");
        let again = read_depth_frame(&file).expect("written depth is read");
        assert!(is_same(&depth, &again), "{name}: {depth:?} became {again:?}");
    }
}

/// Whether two images are the same to the bit; NaN equals itself.
fn is_same(a: &DepthFrame, b: &DepthFrame) -> bool {
    let values = match (&a.values, &b.values) {
        (DepthValues::Steps(a), DepthValues::Steps(b)) => a == b,
        (DepthValues::Float(a), DepthValues::Float(b)) => {
            a.iter().map(|v| v.to_bits()).eq(b.iter().map(|v| v.to_bits()))
        }
        _ => false,
    };
    values && (a.width, a.height) == (b.width, b.height)
}
