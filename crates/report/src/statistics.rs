//! Small statistics of the report.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Seed of tests that flip signs: the same input gives the same report.
const SIGN_SEED: u64 = 0x6465_7074_6863_616d;

/// Root mean square of finite values; NaN of none.
pub(super) fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.filter(|v| v.is_finite()).fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
    (sum / n).sqrt()
}

/// The generator of tests that flip signs.
pub(super) fn sign_generator() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(SIGN_SEED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_mean_squares_leave_out_what_is_no_number() {
        assert_eq!(rms([3.0, f64::NAN, -4.0].into_iter()), 12.5_f64.sqrt());
        assert!(rms(std::iter::empty()).is_nan());
    }
}
