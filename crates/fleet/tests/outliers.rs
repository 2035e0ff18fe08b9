//! Planted outliers are found and hide each other not; fleets without any have none.

use depthcal_fleet::UnitEstimate;
use depthcal_fleet::outliers::find_outliers;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const PARAMETERS: usize = 14;

fn fleet(rng: &mut ChaCha8Rng, units: usize) -> Vec<UnitEstimate> {
    // Between units 1; noise from a tenth to three, with correlations.
    let noise = |k: usize| 0.1 * 30f64.powf(k as f64 / (PARAMETERS - 1) as f64);
    let mut draw = || -> f64 { StandardNormal.sample(rng) };
    (0..units)
        .map(|_| {
            let common = DVector::from_fn(PARAMETERS, |k, _| 0.7 * noise(k));
            let specific = DMatrix::from_diagonal(&DVector::from_fn(PARAMETERS, |k, _| 0.51 * noise(k).powi(2)));
            let covariance = specific + &common * common.transpose();
            let root = covariance.clone().cholesky().unwrap().l();
            let errors = root * DVector::from_fn(PARAMETERS, |_, _| draw());
            UnitEstimate { value: DVector::from_fn(PARAMETERS, |_, _| draw()) + errors, covariance }
        })
        .collect()
}

#[test]
fn without_outliers_none_is_found() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let (runs, units) = (60, 24);
    let mut fleets_with = 0;
    for _ in 0..runs {
        let search = find_outliers(&fleet(&mut rng, units), 0.01 / units as f64);
        fleets_with += usize::from(search.kept.contains(&false));
    }
    // At the 1 % level of a fleet as a whole; three of sixty have a probability of 2 %.
    assert!(fleets_with <= 2, "{fleets_with} of {runs} fleets have outliers");
}

#[test]
fn two_outliers_do_not_hide_each_other() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let (mut both, mut others, runs) = (0, 0, 20);
    for _ in 0..runs {
        let mut units = fleet(&mut rng, 24);
        // The same parameter twice, which doubles its variance many times over for a plain estimate.
        units[5].value[2] += 12.0;
        units[17].value[2] += 12.0;
        let search = find_outliers(&units, 0.01 / 24.0);
        both += usize::from(!search.kept[5] && !search.kept[17]);
        others += search.kept.iter().filter(|is_alike| !**is_alike).count()
            - usize::from(!search.kept[5])
            - usize::from(!search.kept[17]);
        for unit in [5, 17] {
            let departure = search.departures[unit].as_ref().unwrap();
            assert_eq!(departure.standardized.iamax(), 2, "the parameter that carries it");
        }
    }
    assert_eq!(both, runs);
    assert_eq!(others, 0);
}

#[test]
fn the_p_values_of_good_units_are_uniform_or_cautious() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut p = Vec::new();
    for _ in 0..20 {
        let search = find_outliers(&fleet(&mut rng, 24), 1e-12);
        p.extend(search.departures.into_iter().flatten().map(|d| d.p_value));
    }
    for level in [0.01, 0.05, 0.2] {
        let share = p.iter().filter(|p| **p < level).count() as f64 / p.len() as f64;
        assert!(share < 1.6 * level, "{share} of p-values below {level}");
    }
}
