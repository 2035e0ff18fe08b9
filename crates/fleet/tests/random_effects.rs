//! The random-effects model against brute force, and its intervals and tests against simulated fleets.

use depthcal_fleet::significance::{boundary_p_value, holm, homogeneity_p_value, shared_p_value};
use depthcal_fleet::{RandomEffects, UnitEstimate};
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn normals(rng: &mut ChaCha8Rng, n: usize) -> DVector<f64> {
    DVector::from_fn(n, |_, _| normal(rng))
}

/// A covariance with correlations that differ from unit to unit.
fn covariance(rng: &mut ChaCha8Rng, std: &[f64]) -> DMatrix<f64> {
    let n = std.len();
    let mixed = DMatrix::from_fn(n, n, |i, k| if i == k { 1.0 } else { 0.4 * normal(rng) / (n as f64).sqrt() });
    let product = &mixed * mixed.transpose();
    let scale = |i: usize| std[i] / product[(i, i)].sqrt();
    DMatrix::from_fn(n, n, |i, k| product[(i, k)] * scale(i) * scale(k))
}

/// A fleet with mean `mean`, standard deviations `between` and noise `noise`.
fn fleet(rng: &mut ChaCha8Rng, units: usize, mean: &[f64], between: &[f64], noise: &[f64]) -> Vec<UnitEstimate> {
    (0..units)
        .map(|_| {
            let covariance = covariance(rng, noise);
            let root = covariance.clone().cholesky().unwrap().l();
            let n = mean.len();
            let truth = DVector::from_fn(n, |k, _| mean[k] + between[k] * normal(rng));
            UnitEstimate { value: truth + root * normals(rng, n), covariance }
        })
        .collect()
}

/// Twice the restricted log-likelihood up to a constant, from the joint normal distribution of all contrasts: an implementation
/// of its own.
fn brute_force(units: &[UnitEstimate], between: &DMatrix<f64>) -> f64 {
    let (count, n) = (units.len(), units[0].value.len());
    // All estimates stacked, and contrasts to the last unit, which do not depend on μ.
    let mut stacked = DMatrix::zeros(count * n, count * n);
    let mut value = DVector::zeros(count * n);
    for (i, unit) in units.iter().enumerate() {
        stacked.view_mut((i * n, i * n), (n, n)).copy_from(&(&unit.covariance + between));
        value.rows_mut(i * n, n).copy_from(&unit.value);
    }
    let mut contrast = DMatrix::zeros((count - 1) * n, count * n);
    for i in 0..count - 1 {
        for k in 0..n {
            contrast[(i * n + k, i * n + k)] = 1.0;
            contrast[(i * n + k, (count - 1) * n + k)] = -1.0;
        }
    }
    let covariance = &contrast * stacked * contrast.transpose();
    let difference = contrast * value;
    let log_det = covariance.clone().symmetric_eigenvalues().iter().map(|v| v.ln()).sum::<f64>();
    let inverse = covariance.try_inverse().unwrap();
    -log_det - difference.dot(&(inverse * &difference))
}

#[test]
fn the_estimate_maximises_the_likelihood_of_all_contrasts() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let units = fleet(&mut rng, 9, &[500.0, 1e-4], &[2.0, 3e-6], &[1.5, 2e-6]);
    let fit = RandomEffects::diagonal(&units).unwrap();
    let likelihood =
        |a: f64, b: f64| brute_force(&units, &DMatrix::from_diagonal(&DVector::from_vec(vec![a.max(0.0), b.max(0.0)])));
    let (a, b) = (fit.between[(0, 0)], fit.between[(1, 1)]);
    let best = likelihood(a, b);
    for factor in [0.5, 0.9, 0.99, 1.01, 1.1, 2.0] {
        assert!(
            likelihood(a * factor, b) <= best + 1e-5 && likelihood(a, b * factor) <= best + 1e-5,
            "{factor}: {a} {b}"
        );
    }
    // Far from it too: a grid over both.
    for i in 0..30 {
        for k in 0..30 {
            let (x, y) = (0.4 * f64::from(i), 1e-12 * f64::from(k));
            assert!(likelihood(x, y) <= best + 1e-5, "{x} {y} is better than {a} {b}");
        }
    }
    // Likelihood ratios are those of brute force.
    let ratio = fit.variance_ratios(&units)[0];
    let without = (0..400).map(|k| likelihood(0.0, 1e-13 * f64::from(k))).fold(f64::NEG_INFINITY, f64::max);
    assert!((ratio - (best - without)).abs() < 1e-2, "{ratio} against {}", best - without);
}

/// With equal variances there is a closed form: the restricted estimate of the variance is s² − σ², of the mean the plain mean.
#[test]
fn equal_variances_have_a_closed_form() {
    let values = [1.0, 4.0, 2.0, 7.0, 3.5];
    let units: Vec<UnitEstimate> = values
        .iter()
        .map(|v| UnitEstimate { value: DVector::from_element(1, *v), covariance: DMatrix::from_element(1, 1, 0.5) })
        .collect();
    let fit = RandomEffects::diagonal(&units).unwrap();
    let mean = values.iter().sum::<f64>() / 5.0;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 4.0;
    assert!((fit.mean[0] - mean).abs() < 1e-9);
    assert!((fit.between[(0, 0)] - (variance - 0.5)).abs() < 1e-4 * variance, "{}", fit.between[(0, 0)]);
    assert!((fit.mean_covariance[(0, 0)] - variance / 5.0).abs() < 1e-4);
    // Shrunken by T / (T + σ²).
    let shrunken = fit.shrunken(&units[3])[0];
    assert!((shrunken - (mean + (variance - 0.5) / variance * (7.0 - mean))).abs() < 1e-3);
}

/// Of a fleet without scatter in the second parameter: means are covered, scatter is found where it is and not where it is not.
#[test]
fn means_are_covered_and_scatter_is_found_where_it_is() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let (runs, mean) = (300, [10.0, 0.0, -2.0]);
    let (mut covered, mut detected, mut false_scatter, mut false_shared, mut squares) = (0, 0, 0, 0, 0.0);
    for _ in 0..runs {
        let units = fleet(&mut rng, 16, &mean, &[2.0, 0.0, 1.0], &[1.0, 1.0, 1.0]);
        let fit = RandomEffects::diagonal(&units).unwrap();
        let z = (fit.mean[0] - mean[0]) / fit.mean_covariance[(0, 0)].sqrt();
        // Student's t with 15 degrees of freedom has its 2.5 % at 2.131.
        covered += usize::from(z.abs() < 2.131);
        let p: Vec<f64> = fit.variance_ratios(&units).into_iter().map(boundary_p_value).collect();
        detected += usize::from(p[0] < 0.01);
        false_scatter += usize::from(p[1] < 0.05);
        false_shared += usize::from(shared_p_value(&fit, &[1], &DVector::zeros(1)).unwrap() < 0.05);
        squares += fit.between[(0, 0)];
    }
    let share = |n: usize| n as f64 / f64::from(runs);
    assert!((share(covered) - 0.95).abs() < 0.04, "the mean is covered in {} of runs", share(covered));
    assert!(share(detected) > 0.95, "scatter is found in {}", share(detected));
    assert!(share(false_scatter) < 0.08, "scatter is found where there is none in {}", share(false_scatter));
    assert!(share(false_shared) < 0.08, "a shared effect is found where there is none in {}", share(false_shared));
    assert!((squares / f64::from(runs) - 4.0).abs() < 0.4, "the variance is {} on average", squares / f64::from(runs));
}

#[test]
fn a_common_factor_is_found_where_parameters_scatter_together() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let n = 6;
    let loadings = [3.0, 3.0, -2.0, 0.0, 0.0, 1.5];
    let units: Vec<UnitEstimate> = (0..40)
        .map(|_| {
            let factor = normal(&mut rng);
            let covariance = covariance(&mut rng, &[0.5; 6]);
            let noise = covariance.clone().cholesky().unwrap().l() * normals(&mut rng, n);
            let value = DVector::from_fn(n, |k, _| loadings[k] * factor + 0.6 * normal(&mut rng));
            UnitEstimate { value: value + noise, covariance }
        })
        .collect();
    let fit = RandomEffects::diagonal(&units).unwrap().with_factors(&units);
    assert_eq!(fit.factors, 1);
    let correlation = |i: usize, k: usize| fit.between[(i, k)] / (fit.between[(i, i)] * fit.between[(k, k)]).sqrt();
    assert!(correlation(0, 1) > 0.8 && correlation(0, 2) < -0.6, "{} {}", correlation(0, 1), correlation(0, 2));
    assert!(correlation(3, 4).abs() < 0.5);
    // Without one, none is found.
    let plain = fleet(&mut rng, 40, &[0.0; 6], &[2.0; 6], &[0.5; 6]);
    assert_eq!(RandomEffects::diagonal(&plain).unwrap().with_factors(&plain).factors, 0);
}

/// The prior of the next unit covers it.
#[test]
fn the_next_unit_is_covered() {
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let runs = 400;
    let mut within = [0_usize; 2];
    for _ in 0..runs {
        let units = fleet(&mut rng, 10, &[1.0, 2.0], &[1.0, 0.0], &[0.7, 0.7]);
        let fit = RandomEffects::diagonal(&units).unwrap();
        let next = [1.0 + normal(&mut rng), 2.0];
        for k in 0..2 {
            let std = fit.of_next_unit()[(k, k)].sqrt();
            within[k] += usize::from((next[k] - fit.mean[k]).abs() < 1.96 * std);
        }
    }
    let share = within.map(|n| n as f64 / f64::from(runs));
    assert!(share[0] > 0.91 && share[0] < 0.985, "{share:?}");
    assert!(share[1] > 0.95, "{share:?}");
}

#[test]
fn equal_units_are_homogeneous_and_others_are_not() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let runs = 200;
    let (mut false_alarms, mut detected) = (0, 0);
    for _ in 0..runs {
        let alike = fleet(&mut rng, 8, &[1.0, 2.0], &[0.0, 0.0], &[1.0, 0.1]);
        false_alarms += usize::from(homogeneity_p_value(&alike).unwrap() < 0.05);
        let others = fleet(&mut rng, 8, &[1.0, 2.0], &[0.0, 0.3], &[1.0, 0.1]);
        detected += usize::from(homogeneity_p_value(&others).unwrap() < 0.05);
    }
    assert!((0.02..0.09).contains(&(false_alarms as f64 / f64::from(runs))), "{false_alarms} false alarms");
    assert!(detected > 190, "{detected} found");
}

#[test]
fn corrections_are_holms() {
    let corrected = holm(&[0.01, 0.04, 0.03, 0.5]);
    assert_eq!(corrected, [0.04, 0.09, 0.09, 0.5]);
    assert_eq!(boundary_p_value(0.0), 1.0);
    assert!((boundary_p_value(2.705543454) - 0.05).abs() < 1e-6);
}
