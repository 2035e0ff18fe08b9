//! Images in messages, and what they become.

use std::path::Path;

use crate::compressed_depth::DepthCodec;
use crate::packed::Packing;
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
    /// One colour per pixel behind a colour filter, of one or two bytes.
    Bayer(Wide),
    /// Grey values of 10 or 12 bits without gaps between them.
    Packed(Packing),
    /// Depth of `compressed_depth_image_transport`.
    Depth(DepthCodec),
    /// A whole image file: PNG or JPEG.
    File,
}

/// How many bytes a value has, and their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wide {
    One,
    Little,
    Big,
}

impl Encoding {
    /// By ROS' name.
    pub fn of(name: &str, is_big: bool) -> Result<Self, String> {
        let colour = |bytes, order| Encoding::Colour { bytes, order };
        if let Some(bits) = name.strip_prefix("bayer_").and_then(|pattern| pattern.get(4..)) {
            match (bits, is_big) {
                ("8", _) => return Ok(Encoding::Bayer(Wide::One)),
                ("16", false) => return Ok(Encoding::Bayer(Wide::Little)),
                ("16", true) => return Ok(Encoding::Bayer(Wide::Big)),
                _ => {}
            }
        }
        if let Some(packing) = Packing::of(name) {
            return Ok(Encoding::Packed(packing));
        }
        Ok(match name {
            "mono8" | "8UC1" => Encoding::Mono8,
            "mono10" | "mono12" | "mono16" | "16UC1" | "Y16" if is_big => Encoding::Mono16Big,
            "mono10" | "mono12" | "mono16" | "16UC1" | "Y16" => Encoding::Mono16Little,
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
                    "images of the encoding {other:?} are not read: record mono8, mono16, 16UC1, 32FC1, rgb8, bgr8, Bayer or a compressed image"
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
        let (codec, inner) = DepthCodec::of(format, data)?;
        // The file itself holds what was measured where nothing was quantised.
        if codec == DepthCodec::Png && is_file(inner) {
            return Ok((Encoding::File, inner));
        }
        Ok((Encoding::Depth(codec), inner))
    }

    /// Bytes of a row of `width` pixels; 0 of a file. `None` where there is no such number.
    pub fn row_bytes(self, width: usize) -> Option<usize> {
        match self {
            Encoding::Packed(packing) => packing.row_bytes(width),
            _ => width.checked_mul(self.bytes()),
        }
    }

    /// Bytes of a pixel; 0 of a file, and where pixels share bytes.
    fn bytes(self) -> usize {
        match self {
            Encoding::Mono8 | Encoding::Bayer(Wide::One) => 1,
            Encoding::Mono16Little | Encoding::Mono16Big | Encoding::Luma { .. } | Encoding::Bayer(_) => 2,
            Encoding::Float32Little | Encoding::Float32Big => 4,
            Encoding::Colour { bytes, .. } => bytes,
            Encoding::File | Encoding::Depth(_) | Encoding::Packed(_) => 0,
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
            Encoding::Depth(codec) => codec.decode(path, self.data).map(|depth| [depth.width, depth.height]),
            _ => Ok([self.width, self.height]),
        }
    }

    /// Whether it can be depth: one channel of 16 bits or floating-point numbers.
    pub fn may_be_depth(&self) -> bool {
        match self.encoding {
            Encoding::Mono16Little | Encoding::Mono16Big | Encoding::Float32Little | Encoding::Float32Big => true,
            Encoding::Depth(_) => true,
            // Bit depth and colour type of a PNG.
            Encoding::File => self.data.starts_with(b"\x89PNG") && self.data.get(24..26) == Some(&[16, 0]),
            _ => false,
        }
    }

    /// Whether depth of this encoding is in metres.
    pub fn is_metres(&self) -> bool {
        match self.encoding {
            Encoding::Float32Little | Encoding::Float32Big => true,
            Encoding::Depth(codec) => codec.is_metres(),
            _ => false,
        }
    }

    /// The pixels, each `N` bytes, row by row. Rows that the data lack are left out.
    fn pixels<const N: usize, T>(&self, value: impl Fn([u8; N]) -> T + Copy) -> Vec<T> {
        let rows = (0..self.height).filter_map(|row| self.data.get(row * self.step..)?.get(..N * self.width));
        rows.flat_map(|row| row.as_chunks::<N>().0.iter().map(move |bytes| value(*bytes))).collect()
    }

    /// Grey values behind a colour filter: means of 3×3 pixels with the weights 1 2 1 of rows and columns, so that red, green and
    /// blue have 1/4, 1/2 and 1/4 at every pixel of every pattern, and nothing is displaced.
    fn mosaic<const N: usize>(&self, value: impl Fn([u8; N]) -> u16 + Copy) -> Vec<u16> {
        const WEIGHTS: [u32; 3] = [1, 2, 1];
        let raw = self.pixels(value);
        let (width, height) = (self.width, self.height);
        if raw.len() != width * height || width < 2 || height < 2 {
            return raw;
        }
        // Mirrored at the border, which keeps each neighbour's colour.
        let around = |i: usize, n: usize| [if i == 0 { 1 } else { i - 1 }, i, if i + 1 == n { n - 2 } else { i + 1 }];
        let raw_at = |u: usize, v: usize| u32::from(raw[v * width + u]);
        let smooth = |i: usize| {
            let (columns, rows) = (around(i % width, width), around(i / width, height));
            let row = |v: usize| (0..3).map(|k| WEIGHTS[k] * raw_at(columns[k], v)).sum::<u32>();
            ((0..3).map(|k| WEIGHTS[k] * row(rows[k])).sum::<u32>() + 8) / 16
        };
        (0..raw.len()).map(|i| smooth(i) as u16).collect()
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
            Encoding::Bayer(Wide::One) => (self.mosaic(|[v]: [u8; 1]| u16::from(v)), 8),
            Encoding::Bayer(Wide::Little) => (self.mosaic(u16::from_le_bytes), 16),
            Encoding::Bayer(Wide::Big) => (self.mosaic(u16::from_be_bytes), 16),
            Encoding::Packed(packing) => (packing.unpack(self.data, self.step, [self.width, self.height]), 16),
            Encoding::File => return decode_gray(path, self.data),
            Encoding::Depth(_) => {
                return Err(ImageError::Damaged {
                    path: path.to_owned(),
                    format: "recorded",
                    message: "it is compressed depth, which shows no board: name the stream of the images".to_owned(),
                });
            }
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
            Encoding::Depth(codec) => return codec.decode(path, self.data),
            _ => return Err(ImageError::NotDepth { path: path.to_owned(), found: "an image of 8 bits".into() }),
        };
        let frame = DepthFrame { width: self.width, height: self.height, values };
        self.complete(path, frame.len())?;
        Ok(frame)
    }
}
