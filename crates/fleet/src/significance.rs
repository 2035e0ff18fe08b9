//! p-values of the tests of a fleet, and their correction for the number of tests.

use depthcal_statistics::{chi_squared_tail, f_tail};
use nalgebra::DVector;

use crate::random_effects::{RandomEffects, UnitEstimate};
use crate::scaled::{Scaled, part, picked};

/// p-values multiplied so that the chance of any false finding among all of them stays below the level (Holm 1979), in the given
/// order.
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|a, b| p_values[*a].total_cmp(&p_values[*b]));
    let mut corrected = vec![1.0; p_values.len()];
    let mut largest = 0.0_f64;
    for (rank, i) in order.into_iter().enumerate() {
        largest = largest.max((p_values[i] * (p_values.len() - rank) as f64).min(1.0));
        corrected[i] = largest;
    }
    corrected
}

/// p-value of a likelihood ratio of a variance that is zero: under the hypothesis the estimate is at the bound in half of all
/// cases, so the ratio is a mixture of zero and χ² with one degree of freedom in equal parts (Self, Liang 1987; Stram, Lee 1994).
/// With few units the estimate is at the bound more often, which makes the test cautious.
pub fn boundary_p_value(ratio: f64) -> f64 {
    if ratio > 0.0 { 0.5 * chi_squared_tail(ratio, 1) } else { 1.0 }
}

/// p-value of a shared mean of some parameters being `nominal`, by Hotelling's T² with as many degrees of freedom as units give
/// for the scatter between them; `None` with too few units.
pub fn shared_p_value(fit: &RandomEffects, places: &[usize], nominal: &DVector<f64>) -> Option<f64> {
    let statistic = shared_statistic(fit, places, nominal)?;
    let (units, n) = (fit.units, places.len());
    if units <= n + 1 {
        return None;
    }
    let f = statistic * (units - n) as f64 / (n * (units - 1)) as f64;
    Some(f_tail(f, n, units - n))
}

/// Squared distance of the shared mean from `nominal` in standard deviations.
pub fn shared_statistic(fit: &RandomEffects, places: &[usize], nominal: &DVector<f64>) -> Option<f64> {
    let departure = picked(&fit.mean, places) - nominal;
    let covariance = part(&fit.mean_covariance, places, places);
    Some(departure.dot(&(Scaled::new(&covariance)?.inverse() * &departure)))
}

/// p-value of all units having the same parameters: Cochran's Q, the squared distances from the common mean, is χ² with
/// n (units − 1) degrees of freedom where every unit scatters by its own noise alone.
pub fn homogeneity_p_value(units: &[UnitEstimate]) -> Option<f64> {
    let common = RandomEffects::without_scatter(units)?;
    let mut q = 0.0;
    for unit in units {
        let departure = &unit.value - &common.mean;
        q += departure.dot(&(Scaled::new(&unit.covariance)?.inverse() * &departure));
    }
    Some(chi_squared_tail(q, common.mean.len() * (units.len() - 1)))
}
