//! Units that are unlike the others.
//!
//! Every unit is compared with what the others predict of it: y_i − μ has the covariance C_i + T + Cov(μ), where μ and T come
//! from the units that are like each other, this one left out. Two statistics have their p-values combined (Bonferroni): the sum
//! of squares of the decorrelated departures, for a unit that is a little off everywhere, and the largest departure of one
//! parameter given all others, for a unit that is off in one. T is an estimate from n units, so a standardised departure is taken
//! as Student's t with n − 1 degrees of freedom and mapped to the normal deviate of the same tail.
//!
//! Outliers must not hide each other by what they do to T. The search begins from medians and median absolute deviations of every
//! parameter (Rousseeuw, Croux 1993), which a few units cannot move, and then takes units out and in by their p-values until none
//! changes.

use depthcal_statistics::{chi_squared_tail, chi_squared_upper_quantile, f_tail, median};
use nalgebra::DVector;
use rayon::prelude::*;

use crate::random_effects::{RandomEffects, UnitEstimate};
use crate::scaled::{Scaled, decorrelated};

/// Standard deviation of a normal distribution over its median absolute deviation.
const NORMAL_MAD: f64 = 1.4826;
/// Least variance between units with which the search begins, as a share of the variance that is seen.
const LEAST_START: f64 = 0.1;
/// p-value below which a unit is left out when the search begins: generous, since it comes back if the others do not mind.
const START_LEVEL: f64 = 0.01;
/// Rounds in which units are taken out and in.
const MOST_ROUNDS: usize = 12;

/// How a unit departs from what the others predict.
#[derive(Debug, Clone)]
pub struct Departure {
    /// p-value of this unit alone, uncorrected for the number of units.
    pub p_value: f64,
    /// Values that the other units predict.
    pub expected: DVector<f64>,
    /// Departure of every parameter given all other parameters of the unit, in standard deviations.
    pub standardized: DVector<f64>,
    /// `standardized` as normal deviates of the same probability, which small numbers of units make smaller.
    pub deviates: DVector<f64>,
}

/// The units that are like each other, and how every unit departs from them.
#[derive(Debug, Clone)]
pub struct OutlierSearch {
    /// Whether each unit is like the others.
    pub kept: Vec<bool>,
    /// How each departs; `None` where it cannot be compared.
    pub departures: Vec<Option<Departure>>,
}

/// Searches units whose p-value is below `level`, which the caller has divided by the number of tests.
pub fn find_outliers(units: &[UnitEstimate], level: f64) -> OutlierSearch {
    let fewest = units.len() / 2 + 1;
    let mut is_alike = robust_start(units, fewest);
    let mut departures = Vec::new();
    let mut seen: Vec<Vec<bool>> = Vec::new();
    for _ in 0..MOST_ROUNDS {
        departures = (0..units.len()).into_par_iter().map(|i| departure(units, &is_alike, i)).collect();
        let next = most_alike(&departures, level, fewest);
        if next == is_alike {
            break;
        }
        // A cycle: the units in question are kept, which errs towards no outlier.
        if seen.contains(&next) {
            is_alike = is_alike.iter().zip(&next).map(|(a, b)| *a || *b).collect();
            departures = (0..units.len()).into_par_iter().map(|i| departure(units, &is_alike, i)).collect();
            let clear = most_alike(&departures, level, fewest);
            is_alike = is_alike.iter().zip(clear).map(|(a, b)| *a && b).collect();
            break;
        }
        seen.push(std::mem::replace(&mut is_alike, next));
    }
    OutlierSearch { kept: is_alike, departures }
}

/// Units with p-values of at least `level`, and as many of the others as are needed for a majority.
fn most_alike(departures: &[Option<Departure>], level: f64, fewest: usize) -> Vec<bool> {
    let p = |d: &Option<Departure>| d.as_ref().map_or(1.0, |d| d.p_value);
    let mut order: Vec<usize> = (0..departures.len()).collect();
    order.sort_by(|a, b| p(&departures[*b]).total_cmp(&p(&departures[*a])));
    let mut is_alike = vec![false; departures.len()];
    for (rank, i) in order.into_iter().enumerate() {
        is_alike[i] = rank < fewest || p(&departures[i]) >= level;
    }
    is_alike
}

/// The units that are near the others' median in every parameter and altogether.
fn robust_start(units: &[UnitEstimate], fewest: usize) -> Vec<bool> {
    let n = units.first().map_or(0, |u| u.value.len());
    let over_units =
        |quantity: &dyn Fn(&UnitEstimate) -> f64| median(&mut units.iter().map(quantity).collect::<Vec<f64>>());
    let centre = DVector::from_fn(n, |k, _| over_units(&|u| u.value[k]));
    let between = DVector::from_fn(n, |k, _| {
        let deviation = NORMAL_MAD * over_units(&|u| (u.value[k] - centre[k]).abs());
        let noise = over_units(&|u| u.covariance[(k, k)]);
        // The scatter that is seen has noise in it; it is no larger than what is seen.
        (deviation * deviation - noise).max(LEAST_START * deviation * deviation)
    });
    let p: Vec<f64> = units
        .iter()
        .map(|unit| {
            let covariance = &unit.covariance + nalgebra::DMatrix::from_diagonal(&between);
            let Some(factor) = Scaled::new(&covariance) else { return 1.0 };
            let precision = factor.inverse();
            let difference = &unit.value - &centre;
            let pulled = &precision * &difference;
            let largest = (0..n).map(|k| pulled[k] * pulled[k] / precision[(k, k)]).fold(0.0, f64::max);
            (n as f64 * chi_squared_tail(largest, 1)).min(chi_squared_tail(difference.dot(&pulled), n))
        })
        .collect();
    let mut order: Vec<usize> = (0..units.len()).collect();
    order.sort_by(|a, b| p[*b].total_cmp(&p[*a]));
    let mut is_alike = vec![false; units.len()];
    for (rank, i) in order.into_iter().enumerate() {
        is_alike[i] = rank < fewest || p[i] >= START_LEVEL;
    }
    is_alike
}

/// How unit `i` departs from what the kept others predict.
fn departure(units: &[UnitEstimate], is_alike: &[bool], i: usize) -> Option<Departure> {
    let others: Vec<UnitEstimate> =
        units.iter().enumerate().filter(|(k, _)| is_alike[*k] && *k != i).map(|(_, unit)| unit.clone()).collect();
    if others.len() < 2 {
        return None;
    }
    let fit = RandomEffects::diagonal(&others)?;
    let covariance = &units[i].covariance + &fit.between + &fit.mean_covariance;
    let difference = &units[i].value - &fit.mean;
    let degrees = others.len() - 1;
    let precision = Scaled::new(&covariance)?.inverse();
    let pulled = &precision * &difference;
    let standardized = DVector::from_fn(pulled.len(), |k, _| pulled[k] / precision[(k, k)].sqrt());
    let deviates = standardized.map(|t| normal_deviate(t, degrees));
    let n = deviates.len();
    let whole: f64 = decorrelated(&difference, &covariance)?.iter().map(|t| normal_deviate(*t, degrees).powi(2)).sum();
    let largest = chi_squared_tail(deviates.amax().powi(2), 1) * n as f64;
    let p_value = if n == 1 { largest } else { 2.0 * largest.min(chi_squared_tail(whole, n)) };
    Some(Departure { p_value: p_value.min(1.0), expected: fit.mean, standardized, deviates })
}

/// The normal deviate with the tail that Student's t has with so many degrees of freedom.
fn normal_deviate(t: f64, degrees: usize) -> f64 {
    let tail = f_tail(t * t, 1, degrees);
    // Where the tails are all but one, both deviates are near zero.
    let square = if tail > 0.999 { 0.0 } else { chi_squared_upper_quantile(tail.max(1e-300), 1) };
    square.sqrt().copysign(t)
}
