//! Quantiles, linearly interpolated between order statistics (Hyndman, Fan 1996, type 7).

/// Quantile `q` in [0, 1] of values in ascending order; NaN of none.
pub fn quantile_of_sorted(sorted: &[f64], q: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let position = q * last as f64;
    let (i, t) = (position.floor() as usize, position.fract());
    let next = sorted[(i + 1).min(last)];
    sorted[i] + t * (next - sorted[i])
}

/// Quantile `q` in [0, 1] of the finite ones of `values`, in linear time; NaN of none.
pub fn quantile(values: impl IntoIterator<Item = f64>, q: f64) -> f64 {
    let mut finite: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    let Some(last) = finite.len().checked_sub(1) else { return f64::NAN };
    let position = q * last as f64;
    let (i, t) = (position.floor() as usize, position.fract());
    let (_, lower, above) = finite.select_nth_unstable_by(i.min(last), f64::total_cmp);
    let (lower, next) = (*lower, above.iter().copied().fold(f64::INFINITY, f64::min));
    if above.is_empty() { lower } else { lower + t * (next - lower) }
}

/// The upper median of values, which are reordered: of an even number the greater one of the two in the middle, so that the
/// result is one of the values. `None` of none.
pub fn upper_median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The value in ascending order whose rank is nearest to the quantile `q` in [0, 1]: one of the values. `None` of none.
pub fn nearest_rank(sorted: &[f64], q: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    Some(sorted[(q * last as f64).round() as usize])
}

/// Median of values, which are reordered, in linear time; NaN of none. Of an even number it is the mean of the two in the
/// middle.
pub fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    let upper = *values.select_nth_unstable_by(middle, f64::total_cmp).1;
    if values.len() % 2 == 1 {
        return upper;
    }
    let lower = values[..middle].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (upper + lower) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `numpy.quantile` with its default method.
    #[test]
    fn quantiles_are_interpolated() {
        let values = [4.0, f64::NAN, 1.0, 2.0, 3.0];
        assert_eq!(quantile(values, 0.0), 1.0);
        assert_eq!(quantile(values, 1.0), 4.0);
        assert_eq!(quantile(values, 0.5), 2.5);
        assert!((quantile(values, 0.9) - 3.7).abs() < 1e-12);
        assert!(quantile([], 0.5).is_nan());
    }

    #[test]
    fn quantiles_by_selection_are_those_by_sorting() {
        let values: Vec<f64> = (0..1000).map(|i| f64::from((i * 7919) % 1009).sin()).collect();
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        for q in [0.0, 0.025, 0.25, 0.5, 0.7321, 0.975, 1.0] {
            assert_eq!(quantile(values.iter().copied(), q), quantile_of_sorted(&sorted, q));
        }
    }

    #[test]
    fn medians_of_odd_and_even_numbers() {
        assert_eq!(median(&mut [5.0, 1.0, 3.0]), 3.0);
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), 2.5);
        assert!(median(&mut []).is_nan());
        assert_eq!(upper_median(&mut [4.0, 1.0, 3.0, 2.0]), Some(3.0));
        assert_eq!((upper_median(&mut []), nearest_rank(&[], 0.5)), (None, None));
        assert_eq!(nearest_rank(&[1.0, 2.0, 10.0], 0.8), Some(10.0));
    }
}
