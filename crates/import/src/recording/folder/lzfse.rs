//! Files that are compressed by Apple's LZFSE.

use std::io::Read;
use std::path::Path;

use lzfse_rust::LzfseRingDecoder;

use super::files::fault;
use crate::error::ImportError;

/// Most pixels of a depth image.
pub(super) const MOST_PIXELS: usize = 1 << 24;

/// A file that is compressed by LZFSE.
pub(super) struct Lzfse<'a> {
    pub path: &'a Path,
    pub bytes: &'a [u8],
}

impl Lzfse<'_> {
    /// Its contents, of at most so many bytes.
    pub fn unpacked(&self, most: usize) -> Result<Vec<u8>, ImportError> {
        let mut data = Vec::new();
        let mut decoder = LzfseRingDecoder::default();
        decoder
            .reader(self.bytes)
            .take(most as u64 + 1)
            .read_to_end(&mut data)
            .map_err(|error| fault(self.path, format!("it cannot be decompressed ({error}): export it anew")))?;
        if data.len() > most {
            return Err(fault(self.path, format!("it holds more than {most} bytes: export it anew")));
        }
        Ok(data)
    }

    /// Depth of an image of a size.
    pub fn floats(&self, [width, height]: [usize; 2]) -> Result<Vec<f32>, ImportError> {
        let pixels = width * height;
        let data = self.unpacked(4 * pixels)?;
        if data.len() != 4 * pixels {
            let problem = format!("{} bytes are no {width}×{height} px of depth: export it anew", data.len());
            return Err(fault(self.path, problem));
        }
        // Not a number where nothing was measured.
        let metres = data.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
        Ok(metres.map(|z| if z.is_finite() && z > 0.0 { z } else { 0.0 }).collect())
    }
}
