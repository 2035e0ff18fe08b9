//! Means and what scatters about them.

/// Root mean square; 0 of nothing.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, n) = values.into_iter().fold((0.0, 0_usize), |(sum, n), v| (sum + v * v, n + 1));
    (sum / n.max(1) as f64).sqrt()
}

/// Mean and standard deviation (divided by n, not n − 1); zeros of nothing.
pub fn mean_std<I: IntoIterator<Item = f64>>(values: I) -> (f64, f64)
where
    I::IntoIter: Clone,
{
    let values = values.into_iter();
    let n = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / n;
    let std = (values.map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    (mean, std)
}

/// The mean over its standard error (Student's t of the mean against zero); 0 where the values do not scatter.
pub fn mean_to_standard_error(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    if variance > 0.0 { mean / (variance / n).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_a_few_numbers() {
        assert_eq!(rms([3.0, 4.0, 0.0, 0.0]), 2.5);
        assert_eq!(rms([]), 0.0);
        assert_eq!(mean_std([1.0, 3.0]), (2.0, 1.0));
        // Mean 2, variance 1 of three values: t = 2 / (1 / √3).
        assert!((mean_to_standard_error(&[1.0, 2.0, 3.0]) - 2.0 * 3.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(mean_to_standard_error(&[5.0, 5.0]), 0.0);
    }
}
