//! A scattered part of many values.

/// Keeps about `most` of `count` values, scattered without a pattern: a stride would keep some columns of an image only. Whether a
/// value is kept depends on its key alone, so that of two sets those values are kept that both have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Thinning {
    /// Of 2³² hashes, those below this are kept.
    below: u64,
}

impl Thinning {
    /// Keeps `most` of `count` values on average, or all where there are no more.
    pub fn new(count: usize, most: usize) -> Self {
        let below = if count <= most { 1 << 32 } else { ((most as u128) << 32).div_ceil(count as u128) as u64 };
        Self { below }
    }

    /// Whether the value with this key, for example its number, is kept.
    pub fn keeps(&self, key: u64) -> bool {
        // The finaliser of SplitMix64 (Steele, Lea, Flood 2014): every bit of the key changes half of the hash's bits.
        let mut z = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) >> 32 < self.below
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_all_stay_and_of_many_about_so_many() {
        assert!((0..100).all(|i| Thinning::new(100, 100).keeps(i)));
        let thinning = Thinning::new(80_000, 4000);
        let kept = (0..80_000).filter(|i| thinning.keeps(*i)).count() as f64;
        // Binomial: a standard deviation of 62.
        assert!((kept - 4000.0).abs() < 4.0 * 62.0, "{kept}");
    }

    /// Of the columns of an image none is preferred, whatever its width.
    #[test]
    fn no_column_is_preferred() {
        for width in [320, 512, 640] {
            let thinning = Thinning::new(width * width, width * width / 16);
            let column = |u: usize| (0..width).filter(|v| thinning.keeps((v * width + u) as u64)).count() as f64;
            let expected = width as f64 / 16.0;
            // Poisson counts of some hundred columns: none beyond five standard deviations.
            assert!((0..width).all(|u| (column(u) - expected).abs() < 5.0 * expected.sqrt() + 1.0));
        }
    }
}
