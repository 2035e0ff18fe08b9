//! A scattered part of many values.

/// Keeps about `most` of `count` values, scattered without a pattern: a stride would keep some columns of an image only. Whether
/// a value is kept depends on its key alone, so that of two sets those values are kept that both have.
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

    /// Keeps all.
    pub const ALL: Self = Self { below: 1 << 32 };

    /// Keeps `most` of the `count` values that this thinning has kept, on average, or all of them where there are no more.
    #[must_use]
    pub fn further(self, count: usize, most: usize) -> Self {
        let share = u128::from(Self::new(count, most).below);
        Self { below: ((u128::from(self.below) * share) >> 32) as u64 }
    }

    /// About how many of `count` values are kept, with some room for chance.
    pub fn expected(self, count: usize) -> usize {
        let share = self.below as f64 / (1u64 << 32) as f64;
        (count as f64 * share * 1.1).min(count as f64) as usize
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
        let count = (0..80_000).filter(|i| thinning.keeps(*i)).count() as f64;
        // Binomial: a standard deviation of 62.
        assert!((count - 4000.0).abs() < 4.0 * 62.0, "{count}");
    }

    /// A thinning of what a thinning has kept is a part of it, of the wanted size.
    #[test]
    fn thinnings_are_nested() {
        let first = Thinning::new(80_000, 16_000);
        let second = first.further(16_000, 4000);
        let count = (0..80_000).filter(|i| second.keeps(*i)).count() as f64;
        assert!((count - 4000.0).abs() < 4.0 * 62.0, "{count}");
        assert!((0..80_000).all(|i| first.keeps(i) || !second.keeps(i)));
        assert_eq!(first.further(10, 20), first);
        assert_eq!(Thinning::ALL, Thinning::new(5, 5));
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
