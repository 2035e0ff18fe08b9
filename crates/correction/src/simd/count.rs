//! Which pixels have a measured depth, and how many.

/// A measured depth, or 0 where a camera has none and writes the largest value of the type instead.
///
/// An addition that wraps and a subtraction that does not: two instructions for a whole vector on every instruction set.
#[inline(always)]
pub(crate) fn measurement(raw: u16) -> u16 {
    raw.wrapping_add(1).saturating_sub(1)
}

/// The number of values that are not 0.
#[inline(always)]
pub(crate) fn count_u16(values: &[u16]) -> usize {
    values.chunks(PART).map(|part| usize::from(part.iter().fold(0u16, |n, value| n + (*value).min(1)))).sum()
}

/// The number of values that are measured depths.
#[inline(always)]
pub(crate) fn count_measured(values: &[u16]) -> usize {
    values.chunks(PART).map(|part| usize::from(part.iter().fold(0u16, |n, value| n + measurement(*value).min(1)))).sum()
}

/// Values that are counted at a time: sums have 16 bits, so that a vector counts as many values as it holds.
const PART: usize = u16::MAX as usize;

/// The number of values above 0, and the number of NaNs.
#[inline(always)]
pub(crate) fn count_f32(values: &[f32]) -> (usize, usize) {
    let (mut depths, mut nans) = (0u32, 0u32);
    for value in values {
        depths += u32::from(*value > 0.0);
        nans += u32::from(value.is_nan());
    }
    (depths as usize, nans as usize)
}

#[cfg(test)]
mod tests {
    use depthcal_io::DepthImage;

    use super::*;

    #[test]
    fn what_is_no_measurement_becomes_zero_and_nothing_else_changes() {
        for raw in 0..=u16::MAX {
            assert_eq!(measurement(raw), if DepthImage::is_measurement(raw) { raw } else { 0 });
        }
    }
}
