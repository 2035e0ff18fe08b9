//! Depth of ROS' `compressed_depth_image_transport`: twelve bytes of configuration, then a PNG or RVL.
//!
//! Depth in metres is quantised: depth = a / (v − b) of the values v, with a and b from the configuration; 0 is no measurement.

use std::path::Path;

use depthcal_io::{DepthFrame, DepthValues, ImageError, decode_depth_frame};

/// How depth is compressed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum DepthCodec {
    /// 16-bit depth as PNG.
    Png,
    /// 16-bit depth by RVL (Wilson 2017, "Fast lossless depth image compression").
    Rvl,
    /// Quantised depth in metres, as PNG or, where the flag is set, by RVL; with a and b.
    Quantised(bool, [f32; 2]),
}

impl Eq for DepthCodec {}

/// Most pixels of an image by RVL, whose runs of zeros cost next to nothing: memory does not follow from the length of its data.
const MOST_PIXELS: usize = 1 << 24;

impl DepthCodec {
    /// The codec of a message's `format`, such as `16UC1; compressedDepth rvl`, and the data behind the configuration.
    pub fn of<'a>(format: &str, data: &'a [u8]) -> Result<(Self, &'a [u8]), String> {
        let unknown = || {
            format!(
                "compressed images of the format {format:?} are not read: record JPEG, PNG, or depth as compressedDepth"
            )
        };
        let (head, inner) = data.split_first_chunk::<12>().ok_or_else(unknown)?;
        let is_png = inner.starts_with(b"\x89PNG");
        // Before ROS 2 Humble the format of a PNG did not say that it is one.
        let is_rvl = !is_png && format.to_ascii_lowercase().contains("rvl");
        let codec = match (format.contains("32FC1"), is_png, is_rvl) {
            (true, _, _) if is_png || is_rvl => {
                let number = |i: usize| f32::from_le_bytes([head[i], head[i + 1], head[i + 2], head[i + 3]]);
                DepthCodec::Quantised(is_rvl, [number(4), number(8)])
            }
            (false, true, _) => DepthCodec::Png,
            (false, _, true) => DepthCodec::Rvl,
            _ => return Err(unknown()),
        };
        Ok((codec, inner))
    }

    /// Whether decoded depth is in metres, not in steps.
    pub fn is_metres(self) -> bool {
        matches!(self, DepthCodec::Quantised(..))
    }

    /// The depth of the data behind the configuration.
    pub fn decode(self, path: &Path, data: &[u8]) -> Result<DepthFrame, ImageError> {
        let frame = match self {
            DepthCodec::Rvl | DepthCodec::Quantised(true, _) => rvl(data).ok_or_else(|| ImageError::Damaged {
                path: path.to_owned(),
                format: "RVL",
                message: "it ends before its last pixel, or has more pixels than it says".to_owned(),
            })?,
            DepthCodec::Png | DepthCodec::Quantised(false, _) => decode_depth_frame(path, data)?,
        };
        let (DepthCodec::Quantised(_, [a, b]), DepthValues::Steps(steps)) = (self, &frame.values) else {
            return Ok(frame);
        };
        let metres = |v: &u16| if *v == 0 { f32::NAN } else { a / (f32::from(*v) - b) };
        let values = DepthValues::Float(steps.iter().map(metres).collect());
        Ok(DepthFrame { values, ..frame })
    }
}

/// Width and height, then runs of zeros and of differences, in groups of three bits with a bit that says whether another follows,
/// eight of them in a 32-bit word.
fn rvl(data: &[u8]) -> Option<DepthFrame> {
    let (size, data) = data.split_first_chunk::<8>()?;
    let side = |i: usize| u32::from_le_bytes([size[i], size[i + 1], size[i + 2], size[i + 3]]) as usize;
    let (width, height) = (side(0), side(4));
    let pixels = width.checked_mul(height).filter(|pixels| (1..=MOST_PIXELS).contains(pixels))?;
    let mut numbers = Numbers { data, word: 0, groups: 0 };
    let mut values: Vec<u16> = Vec::new();
    let mut previous = 0_i32;
    while values.len() < pixels {
        let zeros = numbers.next()? as usize;
        let end = values.len().checked_add(zeros).filter(|end| *end <= pixels)?;
        values.resize(end, 0);
        let differences = numbers.next().or((end == pixels).then_some(0))? as usize;
        if zeros == 0 && differences == 0 || differences > pixels - end {
            return None;
        }
        for _ in 0..differences {
            let folded = numbers.next()?;
            previous = previous.wrapping_add((folded >> 1) as i32 ^ -((folded & 1) as i32));
            values.push(previous as u16);
        }
    }
    Some(DepthFrame { width, height, values: DepthValues::Steps(values) })
}

/// Numbers of variable length.
struct Numbers<'a> {
    data: &'a [u8],
    word: u32,
    /// Groups that the word still has.
    groups: u32,
}

impl Numbers<'_> {
    fn next(&mut self) -> Option<u32> {
        let mut value = 0;
        for shift in (0..32).step_by(3) {
            if self.groups == 0 {
                let (word, tail) = self.data.split_first_chunk()?;
                (self.word, self.groups, self.data) = (u32::from_le_bytes(*word), 8, tail);
            }
            let group = self.word >> 28;
            self.word <<= 4;
            self.groups -= 1;
            value |= (group & 7) << shift;
            if group & 8 == 0 {
                return Some(value);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The encoder of the paper's appendix.
    fn encoded(width: u32, height: u32, values: &[u16]) -> Vec<u8> {
        let (mut words, mut word, mut groups) = (Vec::new(), 0_u32, 0);
        let mut put = |mut value: u32| loop {
            let more = value >> 3;
            word = word << 4 | value & 7 | if more > 0 { 8 } else { 0 };
            groups += 1;
            if groups == 8 {
                words.push(word);
                (word, groups) = (0, 0);
            }
            value = more;
            if more == 0 {
                break groups;
            }
        };
        let (mut i, mut previous) = (0, 0_i32);
        let mut left = 0;
        while i < values.len() {
            let zeros = values[i..].iter().take_while(|v| **v == 0).count();
            let others = values[i + zeros..].iter().take_while(|v| **v != 0).count();
            put(zeros as u32);
            left = put(others as u32);
            for value in &values[i + zeros..][..others] {
                let difference = i32::from(*value) - previous;
                left = put((difference << 1 ^ difference >> 31) as u32);
                previous = i32::from(*value);
            }
            i += zeros + others;
        }
        if left > 0 {
            words.push(word << (4 * (8 - left)));
        }
        let head = [width.to_le_bytes(), height.to_le_bytes()].concat();
        head.into_iter().chain(words.iter().flat_map(|word| word.to_le_bytes())).collect()
    }

    fn scene(n: u32) -> Vec<u16> {
        let value = |i: u32| if (i / 7).is_multiple_of(3) { 0 } else { (i.wrapping_mul(2_654_435_761) >> 16) as u16 };
        (0..n).map(value).collect()
    }

    #[test]
    fn rvl_gives_back_what_was_written() {
        for values in [scene(48 * 31), vec![0; 48 * 31], vec![65535; 48 * 31]] {
            let data = [&[0; 12][..], &encoded(48, 31, &values)].concat();
            let (codec, inner) = DepthCodec::of("16UC1; compressedDepth rvl", &data).unwrap();
            let frame = codec.decode(Path::new("a"), inner).unwrap();
            assert_eq!((frame.width, frame.height, &frame.values), (48, 31, &DepthValues::Steps(values)));
        }
    }

    #[test]
    fn quantised_depth_is_in_metres() {
        let head = [&[0; 4][..], &2000.0_f32.to_le_bytes(), &(-10.0_f32).to_le_bytes()].concat();
        let data = [head, encoded(2, 1, &[0, 990])].concat();
        let (codec, inner) = DepthCodec::of("32FC1; compressedDepth rvl", &data).unwrap();
        let DepthValues::Float(values) = codec.decode(Path::new("a"), inner).unwrap().values else { panic!() };
        assert!(codec.is_metres() && values[0].is_nan() && (values[1] - 2.0).abs() < 1e-6, "{values:?}");
    }

    #[test]
    fn what_is_broken_is_an_error_without_memory() {
        let good = encoded(48, 31, &scene(48 * 31));
        for bytes in
            [&good[..7], &good[..good.len() - 4], &[255; 16], &[255, 255, 255, 0, 255, 255, 255, 0, 1, 2, 3, 4]]
        {
            assert!(DepthCodec::Rvl.decode(Path::new("a"), bytes).is_err());
        }
        assert!(DepthCodec::of("16UC1; compressedDepth h264", &[0; 40]).unwrap_err().contains("h264"));
        assert!(DepthCodec::of("16UC1; compressedDepth rvl", &[0; 5]).is_err());
    }
}
