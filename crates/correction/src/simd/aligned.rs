//! Tables that begin at the start of a cache line, so that vectors as long as a line never straddle two.

use std::ops::Deref;

/// Bytes of a cache line.
pub(crate) const LINE: usize = 64;

/// A table whose first value lies at a multiple of 64 bytes, where the platform can tell the alignment.
#[derive(Debug, Default)]
pub(crate) struct Aligned {
    /// Padding, then the values.
    padded: Vec<f32>,
    first: usize,
}

impl FromIterator<f32> for Aligned {
    fn from_iter<I: IntoIterator<Item = f32>>(values: I) -> Self {
        let values = values.into_iter();
        let most = LINE / size_of::<f32>();
        // A single allocation: growing the vector would move the values.
        let mut padded: Vec<f32> = Vec::with_capacity(values.size_hint().0 + most);
        let first = padded.as_ptr().align_offset(LINE);
        let first = if first < most { first } else { 0 };
        padded.resize(first, 0.0);
        padded.extend(values);
        Self { padded, first }
    }
}

impl Clone for Aligned {
    fn clone(&self) -> Self {
        self.iter().copied().collect()
    }
}

impl Deref for Aligned {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.padded[self.first..]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_kept_at_the_start_of_a_line() {
        for n in [0, 1, 1000] {
            let table: Aligned = (0..n).map(|i| i as f32).collect();
            for table in [table.clone(), table] {
                assert!(table.iter().copied().eq((0..n).map(|i| i as f32)));
                assert!(n == 0 || table.as_ptr().align_offset(LINE) == 0);
            }
        }
    }
}
