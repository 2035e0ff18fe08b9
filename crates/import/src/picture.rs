//! Images in messages, and what they become.

use std::path::Path;

use depthcal_io::{DepthFrame, DepthValues, GrayImage, ImageError, decode_depth_frame, decode_gray};

/// How pixels are encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    Mono8,
    Mono16Little,
    Mono16Big,
    /// 32-bit floating-point numbers: depth in metres.
    Float32Little,
    Float32Big,
    /// Three or four bytes per pixel, with the places of red, green and blue.
    Colour {
        bytes: usize,
        order: [usize; 3],
    },
    /// Two bytes per pixel, the first or the second of which is the luma.
    Luma {
        place: usize,
    },
    /// A whole image file: PNG or JPEG.
    File,
}

impl Encoding {
    /// By ROS' name.
    pub fn of(name: &str, is_big: bool) -> Result<Self, String> {
        let colour = |bytes, order| Encoding::Colour { bytes, order };
        Ok(match name {
            "mono8" | "8UC1" => Encoding::Mono8,
            "mono16" | "16UC1" | "Y16" if is_big => Encoding::Mono16Big,
            "mono16" | "16UC1" | "Y16" => Encoding::Mono16Little,
            "32FC1" if is_big => Encoding::Float32Big,
            "32FC1" => Encoding::Float32Little,
            "rgb8" => colour(3, [0, 1, 2]),
            "bgr8" | "8UC3" => colour(3, [2, 1, 0]),
            "rgba8" => colour(4, [0, 1, 2]),
            "bgra8" | "8UC4" => colour(4, [2, 1, 0]),
            "yuv422" | "uyvy" => Encoding::Luma { place: 1 },
            "yuv422_yuy2" | "yuyv" => Encoding::Luma { place: 0 },
            other => {
                return Err(format!(
                    "images of the encoding {other:?} are not read: record mono8, mono16, 16UC1, 32FC1, rgb8, bgr8 or a compressed image"
                ));
            }
        })
    }

    /// The image file within a compressed message of a `format`.
    pub fn compressed<'a>(format: &str, data: &'a [u8]) -> Result<(Self, &'a [u8]), String> {
        let is_file = |data: &[u8]| data.starts_with(b"\x89PNG") || data.starts_with(b"\xff\xd8\xff");
        if is_file(data) {
            return Ok((Encoding::File, data));
        }
        // compressed_depth_image_transport: 12 bytes of configuration, then a PNG (of 16UC1; 32FC1 is quantised).
        match data.get(12..) {
            Some(inner) if is_file(inner) && !format.contains("32FC1") => Ok((Encoding::File, inner)),
            _ => Err(format!(
                "compressed images of the format {format:?} are not read: record JPEG, PNG, or 16UC1 as PNG"
            )),
        }
    }

    /// Bytes of a pixel; 0 of a file.
    pub fn bytes(self) -> usize {
        match self {
            Encoding::Mono8 => 1,
            Encoding::Mono16Little | Encoding::Mono16Big | Encoding::Luma { .. } => 2,
            Encoding::Float32Little | Encoding::Float32Big => 4,
            Encoding::Colour { bytes, .. } => bytes,
            Encoding::File => 0,
        }
    }
}

/// An image in a message, of rows `step` bytes apart. Of files width and height may be 0: they are in the file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Picture<'a> {
    pub width: usize,
    pub height: usize,
    pub step: usize,
    pub encoding: Encoding,
    pub data: &'a [u8],
}

impl Picture<'_> {
    /// Width and height, px.
    pub fn size(&self, path: &Path) -> Result<[usize; 2], ImageError> {
        match self.encoding {
            Encoding::File => decode_gray(path, self.data).map(|image| [image.width, image.height]),
            _ => Ok([self.width, self.height]),
        }
    }

    /// Whether it can be depth: one channel of 16 bits or floating-point numbers.
    pub fn may_be_depth(&self) -> bool {
        match self.encoding {
            Encoding::Mono16Little | Encoding::Mono16Big | Encoding::Float32Little | Encoding::Float32Big => true,
            // Bit depth and colour type of a PNG.
            Encoding::File => self.data.starts_with(b"\x89PNG") && self.data.get(24..26) == Some(&[16, 0]),
            _ => false,
        }
    }

    /// Whether depth of this encoding is in metres.
    pub fn is_metres(&self) -> bool {
        matches!(self.encoding, Encoding::Float32Little | Encoding::Float32Big)
    }

    /// The pixels, each `N` bytes, row by row. Rows that the data lack are left out.
    fn pixels<const N: usize, T>(&self, value: impl Fn([u8; N]) -> T + Copy) -> Vec<T> {
        let rows = (0..self.height).filter_map(|row| self.data.get(row * self.step..)?.get(..N * self.width));
        rows.flat_map(|row| row.as_chunks::<N>().0.iter().map(move |bytes| value(*bytes))).collect()
    }

    fn complete(&self, path: &Path, pixels: usize) -> Result<(), ImageError> {
        if pixels == self.width * self.height {
            return Ok(());
        }
        let message = format!("it has {pixels} pixels of {}×{}", self.width, self.height);
        Err(ImageError::Damaged { path: path.to_owned(), format: "recorded", message })
    }

    /// Grey values; colour becomes luma.
    pub fn gray(&self, path: &Path) -> Result<GrayImage, ImageError> {
        let luma =
            |[r, g, b]: [u8; 3]| ((299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b) + 500) / 1000) as u16;
        let (data, bits) = match self.encoding {
            Encoding::Mono8 => (self.pixels(|[v]: [u8; 1]| u16::from(v)), 8),
            Encoding::Mono16Little => (self.pixels(u16::from_le_bytes), 16),
            Encoding::Mono16Big => (self.pixels(u16::from_be_bytes), 16),
            Encoding::Float32Little => (self.pixels(|b| f32::from_le_bytes(b).round() as u16), 16),
            Encoding::Float32Big => (self.pixels(|b| f32::from_be_bytes(b).round() as u16), 16),
            Encoding::Luma { place } => (self.pixels(|b: [u8; 2]| u16::from(b[place])), 8),
            Encoding::Colour { bytes: 3, order } => (self.pixels(|b: [u8; 3]| luma(order.map(|i| b[i]))), 8),
            Encoding::Colour { order, .. } => (self.pixels(|b: [u8; 4]| luma(order.map(|i| b[i]))), 8),
            Encoding::File => return decode_gray(path, self.data),
        };
        self.complete(path, data.len())?;
        Ok(GrayImage { width: self.width, height: self.height, data, bits })
    }

    /// Depth in the unit of its encoding.
    pub fn depth(&self, path: &Path) -> Result<DepthFrame, ImageError> {
        let values = match self.encoding {
            Encoding::Mono16Little => DepthValues::Steps(self.pixels(u16::from_le_bytes)),
            Encoding::Mono16Big => DepthValues::Steps(self.pixels(u16::from_be_bytes)),
            Encoding::Float32Little => DepthValues::Float(self.pixels(f32::from_le_bytes)),
            Encoding::Float32Big => DepthValues::Float(self.pixels(f32::from_be_bytes)),
            Encoding::File => return decode_depth_frame(path, self.data),
            _ => return Err(ImageError::NotDepth { path: path.to_owned(), found: "an image of 8 bits".into() }),
        };
        let frame = DepthFrame { width: self.width, height: self.height, values };
        self.complete(path, frame.len())?;
        Ok(frame)
    }
}
