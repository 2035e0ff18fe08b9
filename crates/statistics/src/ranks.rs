//! Rank correlation.

/// Spearman's rank correlation of two samples of equal length, in −1 … 1: how nearly one rises (or falls) whenever the other
/// does. Equal values have their mean rank. 0 for samples that do not vary (Spearman 1904).
pub fn rank_correlation(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (ranks(a), ranks(b));
    let middle = 0.5 * (a.len() as f64 - 1.0);
    let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| (a - middle) * (b - middle)).sum() };
    let scale = (product(&a, &a) * product(&b, &b)).sqrt();
    if scale > 0.0 { product(&a, &b) / scale } else { 0.0 }
}

/// The rank of every value from 0 on, the mean rank of equal ones.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for group in order.chunk_by(|a, b| values[*a] == values[*b]) {
        let mean = first as f64 + 0.5 * (group.len() as f64 - 1.0);
        group.iter().for_each(|i| ranks[*i] = mean);
        first += group.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rises_together_has_1_and_the_reverse_minus_1() {
        let a = [0.3, 7.0, 2.0, 5.0];
        let cubes = a.map(|v: f64| v.powi(3));
        let falling = a.map(|v: f64| (-v).exp());
        assert!((rank_correlation(&a, &cubes) - 1.0).abs() < 1e-12);
        assert!((rank_correlation(&a, &falling) + 1.0).abs() < 1e-12);
        assert_eq!(rank_correlation(&a, &[1.0; 4]), 0.0);
    }

    #[test]
    fn equal_values_have_their_mean_rank() {
        // Kendall, Rank Correlation Methods: ranks 1.5, 1.5, 3, 4 against 1 … 4 have 4.5 / √(4.5 · 5).
        let rho = rank_correlation(&[1.0, 1.0, 2.0, 3.0], &[1.0, 2.0, 3.0, 4.0]);
        assert!((rho - 4.5 / (4.5_f64 * 5.0).sqrt()).abs() < 1e-12, "{rho}");
    }
}
