//! Functions planted in rows of frames whose poses, and three shared parameters, are free.

use std::collections::BTreeSet;

use depthcal_formula::FormulaCovariate as C;
use depthcal_model::Context;
use depthcal_model::chain::POSE;
use depthcal_solver::additive::{ClusterRows, Normal};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::super::observations::{FrameRows, Observations, Sample};
use super::{Component, described};

const FRAMES: usize = 24;
const SAMPLES: usize = 150;
/// Standard deviation of inverse depth, 1/mm.
const SIGMA: f64 = 1e-6;
/// Inverse depth, offset and slopes of a plane are known to this many times [`SIGMA`] from the markers.
const POSE_SIGMAS: f64 = 0.5;

/// Planes of 24 frames from 0.6 m to 2.4 m, whose depth has an error, mm: a function of the ray (x, y) and depth, mm.
fn observations(seed: u64, error_mm: impl Fn([f64; 2], f64) -> f64) -> Observations {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let frames = (0..FRAMES).map(|_| {
        let centre = [0, 1].map(|_| rng.random_range(-0.25..0.25));
        let slopes = [0, 1].map(|_| rng.random_range(-0.6..0.6));
        let distance: f64 = rng.random_range(600.0..2400.0);
        let half_width = (200.0 / distance).min(0.2);
        let mut jacobian = DMatrix::zeros(SAMPLES, POSE + 3);
        let mut samples = Vec::new();
        for row in 0..SAMPLES {
            let [x, y] = centre.map(|centre| centre + rng.random_range(-half_width..half_width));
            let rho = (1.0 + slopes[0] * (x - centre[0]) + slopes[1] * (y - centre[1])) / distance;
            let noise: f64 = StandardNormal.sample(&mut rng);
            // Predicted less measured inverse depth.
            let residual = noise + rho * rho * error_mm([x, y], 1.0 / rho) / SIGMA;
            let state = [x, y, rho, 0.9];
            let slopes = [1.0 / SIGMA; 2];
            samples.push(Sample { state, measured_rho: rho, context: Context::default(), residual, slopes });
            for (column, value) in [(0, 1.0), (1, x), (2, y), (POSE, 1.0), (POSE + 1, 1e3 * rho), (POSE + 2, x)] {
                jacobian[(row, column)] = value;
            }
        }
        let residuals = DVector::from_iterator(SAMPLES, samples.iter().map(|sample| sample.residual));
        let mut normal = jacobian.tr_mul(&jacobian);
        (0..POSE).for_each(|i| normal[(i, i)] += POSE_SIGMAS.powi(-2));
        let normal = Normal { hessian: normal, gradient: jacobian.tr_mul(&residuals) };
        let rows = ClusterRows::new(&jacobian, &residuals, &normal, POSE).unwrap();
        FrameRows { samples, rows, is_set_aside: false }
    });
    Observations { frames: frames.collect(), shared: 3 }
}

fn covariates(found: &[Component]) -> Vec<BTreeSet<C>> {
    let covariates_of =
        |component: &Component| component.description.covariates.iter().filter_map(|name| C::of(name)).collect();
    found.iter().map(covariates_of).collect()
}

fn saw(z: f64) -> f64 {
    (3.0 * (2.0 * std::f64::consts::PI * z / 420.0).sin()).atan()
}

fn ring([x, y]: [f64; 2]) -> f64 {
    ((x.hypot(y) - 0.25) / 0.08).tanh()
}

#[test]
fn nothing_is_found_where_nothing_is() {
    for seed in 0..6 {
        let components = described(&observations(seed, |_, _| 0.0), &[]);
        assert_eq!(covariates(&components), [] as [BTreeSet<C>; 0], "seed {seed}");
    }
}

#[test]
fn two_functions_are_found_together() {
    let components = described(&observations(1, |ray, z| 3.0 * saw(z) + 4.0 * ring(ray)), &[]);
    let mut sets = covariates(&components);
    sets.sort();
    let mut expected = vec![BTreeSet::from([C::R]), BTreeSet::from([C::Z])];
    expected.sort();
    assert_eq!(sets, expected);
}

/// Neither function changes evenly, so that no product of one with the other covariate is the same; none of them is seen alone.
#[test]
fn a_product_of_two_functions_is_a_function_of_both() {
    let bump = |x: f64| (-(x / 0.25).powi(2)).exp() - 0.5;
    let wave = |z: f64| (2.0 * std::f64::consts::PI * z / 1800.0).sin();
    let components = described(&observations(3, |ray, z| 8.0 * bump(ray[0]) * wave(z)), &[]);
    assert_eq!(covariates(&components), [BTreeSet::from([C::X, C::Z])]);
    assert_eq!(components[0].description.effect.name(), "found_x_z");
}

/// A name is taken already: another is found. The formula is a spline, and smooth.
#[test]
fn a_function_is_described_by_a_spline_with_a_name_of_its_own() {
    let components = described(&observations(2, |_, z| 3.0 * saw(z)), &["found_z".to_owned()]);
    assert_eq!(covariates(&components), [BTreeSet::from([C::Z])]);
    let effect = &components[0].description.effect;
    assert_eq!(effect.name(), "found_z_2");
    assert!(effect.text().contains("spline(z, "), "{}", effect.text());
    assert!(components[0].description.is_smooth_function() && !components[0].description.confirmed);
    assert!(components[0].share > 0.1, "{}", components[0].share);
}

/// The wave is finer than the functions of any two covariates are, and its product with the other covariate has no mean: it shows
/// only in a function that is fine along one of the two.
#[test]
fn a_fine_function_times_another_is_found() {
    let wave = |x: f64| (2.0 * std::f64::consts::PI * x / 0.3).sin();
    let bump = |z: f64| (-((z - 1400.0) / 350.0).powi(2)).exp() - 0.35;
    let components = described(&observations(4, |ray, z| 6.0 * wave(ray[0]) * bump(z)), &[]);
    assert_eq!(covariates(&components), [BTreeSet::from([C::X, C::Z])]);
}
