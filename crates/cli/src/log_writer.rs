//! Log messages on standard error, each warning once.

use std::collections::BTreeSet;
use std::io::{Result, Write, stderr};
use std::sync::{Mutex, PoisonError};

/// Warnings that were written: one set for the process, as its standard error is.
static WRITTEN: Mutex<BTreeSet<Vec<u8>>> = Mutex::new(BTreeSet::new());

/// Writes log messages to standard error. Parts of a cross-validation, for example, are fitted with the same warning each, of
/// which the first is enough.
#[derive(Debug)]
pub(super) struct LogWriter;

impl Write for LogWriter {
    /// Writes one message, which is whole.
    fn write(&mut self, message: &[u8]) -> Result<usize> {
        let mut written = WRITTEN.lock().unwrap_or_else(PoisonError::into_inner);
        if is_news(message, &mut written) {
            stderr().write_all(message)?;
        }
        Ok(message.len())
    }

    fn flush(&mut self) -> Result<()> {
        stderr().flush()
    }
}

/// Whether a message is to be written: all are but warnings that were written before.
fn is_news(message: &[u8], written: &mut BTreeSet<Vec<u8>>) -> bool {
    let is_warning = message.windows(4).take(16).any(|word| word == b"WARN");
    !is_warning || written.insert(message.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_is_written_once_and_other_messages_every_time() {
        let mut written = BTreeSet::new();
        let mut news = |message: &str| is_news(message.as_bytes(), &mut written);
        let told =
            [" WARN frame 3 is dropped", " WARN frame 3 is dropped", " WARN frame 4 is dropped", " INFO a", " INFO a"];
        assert_eq!(told.map(&mut news), [true, false, true, true, true]);
        assert_eq!(["\x1b[33m WARN\x1b[0m bent", "\x1b[33m WARN\x1b[0m bent"].map(&mut news), [true, false]);
    }
}
