//! Tables that begin with a line of the cache: vectors of a whole line do not straddle two then.

use std::ops::Deref;

/// Bytes of a line.
pub(super) const LINE: usize = 64;

/// Values that begin at a multiple of 64 bytes, unless the platform cannot tell.
#[derive(Debug, Default)]
pub(super) struct Aligned {
    /// With room before the first value.
    room: Vec<f32>,
    first: usize,
}

impl FromIterator<f32> for Aligned {
    fn from_iter<I: IntoIterator<Item = f32>>(values: I) -> Self {
        let values = values.into_iter();
        let most = LINE / size_of::<f32>();
        // One allocation: growing would move what was aligned.
        let mut room: Vec<f32> = Vec::with_capacity(values.size_hint().0 + most);
        let first = room.as_ptr().align_offset(LINE);
        let first = if first < most { first } else { 0 };
        room.resize(first, 0.0);
        room.extend(values);
        Self { room, first }
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
        &self.room[self.first..]
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
