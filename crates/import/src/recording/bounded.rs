//! A reader for files whose parts refer to each other, perhaps in a circle.

use std::io::{self, ErrorKind, Read, Seek, SeekFrom};

/// Reads and seeks no more than a multiple of the file's length, so that its user comes to an end. Nothing that a file holds
/// has to be read more than a few times: its header, its index, its data.
pub(super) struct Bounded<R> {
    reader: R,
    /// Bytes and seeks that are left.
    left: u64,
}

impl<R> Bounded<R> {
    /// `length`: of the file, bytes.
    pub(super) fn new(reader: R, length: u64) -> Self {
        Self { reader, left: length.saturating_mul(8).saturating_add(1 << 16) }
    }

    fn spend(&mut self, count: u64) -> io::Result<()> {
        let circle = || io::Error::new(ErrorKind::InvalidData, "it leads back to the same places without end");
        self.left = self.left.checked_sub(count).ok_or_else(circle)?;
        Ok(())
    }
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.reader.read(buffer)?;
        self.spend(count as u64 + 1)?;
        Ok(count)
    }
}

impl<R: Seek> Seek for Bounded<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.spend(1)?;
        self.reader.seek(to)
    }

    fn stream_position(&mut self) -> io::Result<u64> {
        self.reader.stream_position()
    }
}
