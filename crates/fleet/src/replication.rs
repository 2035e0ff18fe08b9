//! Whether effects that were found in some units repeat in others: replication is what confirms a discovered formula.

use depthcal_io::FleetReplication;
use depthcal_statistics::f_tail;
use nalgebra::{DMatrix, DVector};

use crate::random_effects::{RandomEffects, UnitEstimate};
use crate::scaled::Scaled;
use crate::unit::{EffectKey, Unit};

/// Size in the other units, relative to that where the effect was found, within which it repeats.
const REPEATS: [f64; 2] = [0.5, 2.0];
/// Standard errors that the relative size may be beyond these bounds.
const STANDARD_ERRORS: f64 = 2.0;

/// Every effect that some unit's model has, compared with the other units: those that scored it, or, where all that know it have
/// it in their models, all but the first. Effects that all units have are no findings of some.
pub(crate) fn replications(
    units: &[Unit],
    is_alike: &[bool],
    common: &[EffectKey],
    level: f64,
) -> Vec<FleetReplication> {
    let mut keys: Vec<&EffectKey> = Vec::new();
    for effect in units.iter().flat_map(|u| &u.effects).filter(|e| e.in_model) {
        if !keys.contains(&&effect.key) && !common.contains(&effect.key) {
            keys.push(&effect.key);
        }
    }
    let tests = keys.len().max(1) as f64;
    keys.into_iter().map(|key| replication(units, is_alike, key, level / tests)).collect()
}

fn replication(units: &[Unit], is_alike: &[bool], key: &EffectKey, level: f64) -> FleetReplication {
    let usable = || units.iter().enumerate().filter(|(i, u)| is_alike[*i] && u.effect(key).is_some()).map(|(_, u)| u);
    let is_found = |u: &&Unit| u.effect(key).is_some_and(|e| e.in_model);
    let (finders, tested): (Vec<&Unit>, Vec<&Unit>) = usable().partition(is_found);
    let names = |units: &[&Unit]| units.iter().map(|u| u.name.clone()).collect::<Vec<_>>();
    let described = units.iter().find_map(|u| u.effect(key).filter(|e| e.in_model));
    let mut record = FleetReplication {
        effect: key.name.clone(),
        with: described.map_or_else(String::new, |e| e.with.clone()),
        formula: key.formula.as_ref().map(|f| f.formula.texts().join("; ")),
        found_in: names(&finders),
        tested_in: names(&tested),
        same_sign: None,
        relative_size: None,
        relative_size_std_dev: None,
        p_value: None,
        confirmed: false,
    };
    let Some(described) = described else { return record };
    let (reference, others) = match (finders.split_first(), tested.is_empty()) {
        (Some((first, rest)), true) => (vec![*first], rest.to_vec()),
        _ => (finders, tested),
    };
    let nominal = DVector::from_column_slice(&described.nominal);
    let departures = |units: &[&Unit]| -> Vec<UnitEstimate> {
        let deviation = |u: &&Unit| {
            let estimate = u.estimate_with(&described.names, &[key], 1.0)?;
            Some(UnitEstimate { value: estimate.value - &nominal, covariance: estimate.covariance })
        };
        units.iter().filter_map(deviation).collect()
    };
    let Some((expected, of_expected)) = pooled(&departures(&reference)) else { return record };
    // Sizes along what was found, in units of it.
    let along = |estimate: &UnitEstimate| {
        let weight = Scaled::new(&estimate.covariance)?.inverse() * &expected;
        let information = expected.dot(&weight);
        let value = DVector::from_element(1, weight.dot(&estimate.value) / information);
        Some(UnitEstimate { value, covariance: DMatrix::from_element(1, 1, 1.0 / information) })
    };
    let sizes: Vec<UnitEstimate> = departures(&others).iter().filter_map(along).collect();
    if sizes.is_empty() {
        return record;
    }
    let (size, variance, p_value) = match RandomEffects::diagonal(&sizes).filter(|_| sizes.len() > 1) {
        Some(fit) => {
            let (size, variance) = (fit.mean[0], fit.mean_covariance[(0, 0)]);
            (size, variance, f_tail(size * size / variance, 1, sizes.len() - 1))
        }
        None => {
            let (size, variance) = (sizes[0].value[0], sizes[0].covariance[(0, 0)]);
            (size, variance, depthcal_statistics::chi_squared_tail(size * size / variance, 1))
        }
    };
    // The effect where it was found is known with an error of its own.
    let of_reference =
        Scaled::new(&of_expected).map_or(f64::INFINITY, |f| 1.0 / expected.dot(&(f.inverse() * &expected)));
    let std = (variance + size * size * of_reference).sqrt();
    record.same_sign = Some(sizes.iter().filter(|s| s.value[0] > 0.0).count() as f64 / sizes.len() as f64);
    (record.relative_size, record.relative_size_std_dev, record.p_value) = (Some(size), Some(std), Some(p_value));
    let repeats = size + STANDARD_ERRORS * std >= REPEATS[0] && size - STANDARD_ERRORS * std <= REPEATS[1];
    record.confirmed = size > 0.0 && repeats && p_value < level;
    record
}

/// Mean by inverse covariances, and its covariance.
fn pooled(estimates: &[UnitEstimate]) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let fit = RandomEffects::without_scatter(estimates)?;
    Some((fit.mean, fit.mean_covariance))
}
