//! Images in memory.

/// A grey image, row-major, with the bits of its file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GrayImage {
    /// Width in px.
    pub width: usize,
    /// Height in px.
    pub height: usize,
    /// `height` × `width` values.
    pub data: Vec<u16>,
    /// Bits of a value in the file, 8 or 16; 8-bit values are at most 255.
    pub bits: u8,
}

/// A depth image, row-major, in steps of the dataset's depth unit; 0 and the largest value mean no measurement.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DepthImage {
    /// Width in px.
    pub width: usize,
    /// Height in px.
    pub height: usize,
    /// `height` × `width` values.
    pub data: Vec<u16>,
}

impl DepthImage {
    /// Whether a value is a measurement: cameras write 0 or the largest value where they have none.
    pub fn is_measurement(value: u16) -> bool {
        value != 0 && value != u16::MAX
    }
}

/// A colour image, row-major.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RgbImage {
    /// Width in px.
    pub width: usize,
    /// Height in px.
    pub height: usize,
    /// `height` × `width` values of red, green, blue.
    pub data: Vec<[u8; 3]>,
}
