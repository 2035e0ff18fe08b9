//! Counting of pixels.

/// The number of values that are not 0.
#[inline(always)]
pub(crate) fn count_u16(values: &[u16]) -> usize {
    let mut count = 0;
    for part in values.chunks(usize::from(u16::MAX)) {
        // Sums of 16 bits, so that a vector counts as many values as it holds.
        let mut of_part = 0u16;
        for value in part {
            of_part += (*value).min(1);
        }
        count += usize::from(of_part);
    }
    count
}

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
