//! Everything that units say together.

use depthcal_io::{
    Fleet, FleetLeftOut, FleetOutlier, FleetOutlierPart, FleetParameter, FleetUnit, FleetUnitValue, Prior,
};
use nalgebra::{DMatrix, DVector};

use crate::effects::{EffectOutliers, Effects};
use crate::error::{FEWEST_UNITS, FleetError};
use crate::errors::large_errors;
use crate::on_depth::on_depth;
use crate::outliers::{Departure, OutlierSearch, find_outliers};
use crate::random_effects::{RandomEffects, UnitEstimate};
use crate::replication::replications;
use crate::significance::{boundary_p_value, holm, shared_p_value};
use crate::unit::{EffectKey, Unit};

/// Departure of a parameter, in standard deviations, from which it is named among those that carry an outlier.
const NAMED: f64 = 3.0;
/// Share of the units that must tell a shared effect for it to be in the prior.
const LEAST_SHARE: f64 = 0.6;

/// How calibrations are joined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FleetOptions {
    /// Level at which every family of tests as a whole finds nothing where there is nothing.
    pub level: f64,
}

impl Default for FleetOptions {
    fn default() -> Self {
        Self { level: 0.01 }
    }
}

/// The result of joining units.
#[derive(Debug, Clone)]
pub struct Joined {
    /// The record.
    pub fleet: Fleet,
    /// Prior for the next unit.
    pub prior: Prior,
}

/// The parameters that units have in common.
struct Common {
    units: Vec<Unit>,
    left_out: Vec<FleetLeftOut>,
    names: Vec<String>,
    /// Effects that every unit's model has.
    effects: Vec<EffectKey>,
}

/// Joins units of one camera type.
///
/// # Errors
/// [`FleetError::TooFew`], [`FleetError::NotPositiveDefinite`].
pub fn join(units: Vec<Unit>, left_out: Vec<FleetLeftOut>, options: &FleetOptions) -> Result<Joined, FleetError> {
    let Common { units, left_out, names, effects: common } = common(units, left_out)?;
    let adopted = adopted(&units, &common);
    let keys: Vec<&EffectKey> = common.iter().chain(&adopted).collect();
    let estimates: Vec<UnitEstimate> = units
        .iter()
        .map(|u| u.estimate_with(&names, &keys, 1.0))
        .collect::<Option<_>>()
        .ok_or(FleetError::NotPositiveDefinite)?;
    let tested: usize =
        Effects { units: &units, kept: &vec![true; units.len()], adopted: &adopted, level: options.level }
            .count_all(&common);
    let tests = (units.len() * (tested + 1)) as f64;
    let search = find_outliers(&estimates, options.level / tests);
    let of_errors = large_errors(&units, tests);
    let is_alike = without(&search.kept, &of_errors);
    let alike_of = |values: &[UnitEstimate]| -> Vec<UnitEstimate> {
        values.iter().zip(&is_alike).filter(|(_, is_alike)| **is_alike).map(|(v, _)| v.clone()).collect()
    };
    let alike = alike_of(&estimates);
    let fit = RandomEffects::diagonal(&alike).ok_or(FleetError::NotPositiveDefinite)?;
    let ratios = fit.variance_ratios(&alike);
    let fit = fit.with_factors(&alike);
    let effects = Effects { units: &units, kept: &is_alike, adopted: &adopted, level: options.level };
    let (found_effects, shared) = effects.all(&common);
    let of_effects = effects.outliers(&common, &shared);
    let on_depth = on_depth(&units, &is_alike, &common);
    let mut replications = replications(&units, &is_alike, &common, options.level);
    replications.retain(|r| r.relative_size.is_some() || !on_depth.iter().any(|compared| compared.effect == r.effect));
    let prior = prior(&units, &is_alike, &names, [&common, &adopted, &shared], &fit);
    let fleet = Fleet {
        units: units.iter().zip(&search.departures).map(|(u, d)| unit_record(u, d.as_ref())).collect(),
        left_out,
        level: options.level,
        parameters: parameters(&units, &names, &estimates, &fit, &ratios),
        between_units: rows(&fit.between),
        of_mean: rows(&fit.mean_covariance),
        common_factors: fit.factors,
        effects: found_effects,
        outliers: by_certainty(of_errors, outliers(&units, &names, &estimates, &search, &of_effects, tests)),
        replications,
        on_depth,
    };
    Ok(Joined { fleet, prior })
}

/// The units with the majority's image size and parameters.
fn common(units: Vec<Unit>, mut left_out: Vec<FleetLeftOut>) -> Result<Common, FleetError> {
    let majority = |count: usize| 2 * count > units.len();
    let size = units.iter().map(|u| u.size).find(|size| majority(units.iter().filter(|u| u.size == *size).count()));
    // Effects that each of the units has with the same constants are parts of the model.
    let of_all: Vec<EffectKey> = units.first().map_or_else(Vec::new, |first| {
        let is_of_all = |key: &EffectKey| units.iter().all(|u| u.effect(key).is_some_and(|e| e.in_model));
        first.effects.iter().filter(|e| e.in_model && is_of_all(&e.key)).map(|e| e.key.clone()).collect()
    });
    let is_of_some = |u: &Unit, name: &String| {
        u.effects.iter().any(|e| e.in_model && !of_all.contains(&e.key) && e.names.contains(name))
    };
    let has = |u: &Unit, name: &String| u.parameters.iter().any(|p| p.name == *name) && !is_of_some(u, name);
    let mut names: Vec<String> = Vec::new();
    for parameter in units.iter().flat_map(|u| &u.parameters) {
        let name = &parameter.name;
        if !names.contains(name) && majority(units.iter().filter(|u| has(u, name)).count()) {
            names.push(name.clone());
        }
    }
    let mut alike: Vec<Unit> = Vec::new();
    for unit in &units {
        let missing: Vec<&str> = names.iter().filter(|name| !has(unit, name)).map(String::as_str).collect();
        let twin = alike.iter().find(|u| !u.digest.is_empty() && u.digest == unit.digest);
        let reason = match (size, twin) {
            (Some(size), _) if unit.size != size => {
                format!(
                    "its images have {}×{} px, those of the others {}×{}",
                    unit.size[0], unit.size[1], size[0], size[1]
                )
            }
            (_, Some(twin)) => format!("it is of the same dataset as {}", twin.name),
            _ if !missing.is_empty() => {
                format!(
                    "{} held or not determined, but most others have it: calibrate it with the same --model, --with and --lens, such as brown-conrady:full",
                    if missing.len() == 1 {
                        format!("{} is", missing[0])
                    } else {
                        format!("{} are", missing.join(", "))
                    }
                )
            }
            _ => {
                alike.push(unit.clone());
                continue;
            }
        };
        left_out.push(FleetLeftOut { calibration: unit.calibration.clone(), reason });
    }
    if alike.len() < FEWEST_UNITS || names.is_empty() {
        let reasons: Vec<String> = left_out.iter().map(|l| format!("{}: {}", l.calibration, l.reason)).collect();
        let reasons = if reasons.is_empty() { String::new() } else { format!(": {}", reasons.join("; ")) };
        return Err(FleetError::TooFew { found: alike.len(), needed: FEWEST_UNITS, reasons });
    }
    Ok(Common { units: alike, left_out, names, effects: of_all })
}

/// Effects that the models of some units have, and that all others scored: they are made free in all, in which the parameters of
/// a unit mean the same whether its model has the effect or not.
fn adopted(units: &[Unit], common: &[EffectKey]) -> Vec<EffectKey> {
    let mut keys: Vec<EffectKey> = Vec::new();
    for effect in units.iter().flat_map(|u| &u.effects).filter(|e| e.in_model) {
        let is_new = !common.contains(&effect.key) && !keys.contains(&effect.key);
        if is_new && units.iter().all(|u| u.effect(&effect.key).is_some()) {
            keys.push(effect.key.clone());
        }
    }
    keys
}

fn unit_record(unit: &Unit, departure: Option<&Departure>) -> FleetUnit {
    FleetUnit {
        name: unit.name.clone(),
        calibration: unit.calibration.clone(),
        frames: unit.frames,
        depth_rms_mm: unit.depth_rms_mm,
        reprojection_rms_px: unit.reprojection_rms_px,
        has_scores: unit.scores.is_some(),
        p_value: departure.map_or(1.0, |d| d.p_value),
    }
}

fn parameters(
    units: &[Unit],
    names: &[String],
    estimates: &[UnitEstimate],
    fit: &RandomEffects,
    ratios: &[f64],
) -> Vec<FleetParameter> {
    let described = |name: &String| units[0].parameters.iter().find(|p| p.name == *name);
    let nominal: Vec<Option<f64>> = names.iter().map(|name| described(name).and_then(|p| p.nominal)).collect();
    let shared =
        |k: usize| nominal[k].map(|value| shared_p_value(fit, &[k], &DVector::from_element(1, value)).unwrap_or(1.0));
    let with_nominal: Vec<usize> = (0..names.len()).filter(|k| nominal[*k].is_some()).collect();
    let corrected = holm(&with_nominal.iter().filter_map(|k| shared(*k)).collect::<Vec<_>>());
    let differs = holm(&ratios.iter().map(|ratio| boundary_p_value(*ratio)).collect::<Vec<_>>());
    let shrunken: Vec<DVector<f64>> = estimates.iter().map(|e| fit.shrunken(e)).collect();
    let count = estimates.len() as f64;
    let parameter = |k: usize| FleetParameter {
        name: names[k].clone(),
        unit: described(&names[k]).map_or_else(|| "1".to_owned(), |p| p.unit.clone()),
        nominal: nominal[k],
        mean: fit.mean[k],
        mean_std_dev: fit.mean_covariance[(k, k)].sqrt(),
        shared_p_value: with_nominal.iter().position(|i| *i == k).map(|i| corrected[i]),
        between_units: fit.between[(k, k)].max(0.0).sqrt(),
        of_noise: (estimates.iter().map(|e| e.covariance[(k, k)]).sum::<f64>() / count).sqrt(),
        differs_p_value: differs.get(k).copied().unwrap_or(1.0),
        values: (0..estimates.len())
            .map(|unit| FleetUnitValue {
                unit,
                value: estimates[unit].value[k],
                std_dev: estimates[unit].covariance[(k, k)].sqrt(),
                shrunken: shrunken[unit][k],
            })
            .collect(),
    };
    (0..names.len()).map(parameter).collect()
}

/// Outliers in the parameters, and of every other unit the effect in which it is most unlike the others.
fn outliers(
    units: &[Unit],
    names: &[String],
    estimates: &[UnitEstimate],
    search: &OutlierSearch,
    of_effects: &[EffectOutliers],
    tests: f64,
) -> Vec<FleetOutlier> {
    let record = |unit: usize, within: &str, names: &[String], values: &DVector<f64>, d: &Departure| FleetOutlier {
        unit,
        name: units[unit].name.clone(),
        within: within.to_owned(),
        p_value: (d.p_value * tests).min(1.0),
        parts: parts(names, values, d),
    };
    let mut outliers = Vec::new();
    for unit in 0..units.len() {
        if let (false, Some(d)) = (search.kept[unit], &search.departures[unit]) {
            outliers.push(record(unit, "model", names, &estimates[unit].value, d));
        }
        let departing = of_effects
            .iter()
            .filter(|e| !e.search.kept[unit])
            .filter_map(|e| Some((e, e.search.departures[unit].as_ref()?, e.values[unit].as_ref()?)));
        if let Some((effect, d, values)) = departing.min_by(|a, b| a.1.p_value.total_cmp(&b.1.p_value)) {
            outliers.push(record(unit, &effect.key.name, &effect.names, values, d));
        }
    }
    outliers
}

/// All outliers, the most certain first.
fn by_certainty(of_errors: Vec<FleetOutlier>, others: Vec<FleetOutlier>) -> Vec<FleetOutlier> {
    let mut all: Vec<FleetOutlier> = of_errors.into_iter().chain(others).collect();
    all.sort_by(|a, b| a.p_value.total_cmp(&b.p_value).then(a.unit.cmp(&b.unit)));
    all
}

/// Units that are alike and have no large error; the large errors count for nothing where too few units would be left.
fn without(alike: &[bool], of_errors: &[FleetOutlier]) -> Vec<bool> {
    let is_large = |unit: usize| of_errors.iter().any(|outlier| outlier.unit == unit);
    let usual: Vec<bool> = alike.iter().enumerate().map(|(unit, is_alike)| *is_alike && !is_large(unit)).collect();
    let left = usual.iter().filter(|is_usual| **is_usual).count();
    if left >= FEWEST_UNITS && 2 * left > alike.len() { usual } else { alike.to_vec() }
}

/// The parameters that carry a departure, the largest first; of an effect, whose departures are in coordinates of their own, all.
fn parts(names: &[String], values: &DVector<f64>, departure: &Departure) -> Vec<FleetOutlierPart> {
    let in_parameters = departure.standardized.len() == names.len();
    let size = |k: usize| if in_parameters { departure.deviates[k].abs() } else { f64::INFINITY };
    let mut order: Vec<usize> = (0..names.len()).collect();
    order.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
    let named = order.iter().filter(|k| size(**k) >= NAMED).count().max(1);
    order
        .into_iter()
        .take(named)
        .map(|k| FleetOutlierPart {
            parameter: names[k].clone(),
            value: values[k],
            expected: departure.expected[k],
            standardized: if in_parameters { departure.standardized[k] } else { departure.standardized.amax() },
        })
        .collect()
}

/// The prior for the next unit: parameters with the shared effects in the model, where enough units tell these.
fn prior(
    units: &[Unit],
    is_alike: &[bool],
    names: &[String],
    [common, adopted, shared]: [&[EffectKey]; 3],
    fit: &RandomEffects,
) -> Prior {
    let alike: Vec<&Unit> = units.iter().zip(is_alike).filter(|(_, is_alike)| **is_alike).map(|(u, _)| u).collect();
    let with = |keys: &[EffectKey]| -> Vec<String> {
        let text = |key: &EffectKey| alike.iter().find_map(|u| u.effect(key).map(|e| e.with.clone()));
        keys.iter().filter_map(text).collect()
    };
    let extended = || {
        let mut all = names.to_vec();
        all.extend(
            shared
                .iter()
                .flat_map(|key| alike.iter().find_map(|u| u.effect(key)).map(|e| e.names.clone()).unwrap_or_default()),
        );
        let others = adopted.iter().filter(|key| !shared.contains(key));
        let free: Vec<&EffectKey> = common.iter().chain(others).chain(shared).collect();
        let told: Vec<UnitEstimate> = alike.iter().filter_map(|u| u.estimate_with(&all, &free, 1.0)).collect();
        if told.len() < FEWEST_UNITS || (told.len() as f64) < LEAST_SHARE * alike.len() as f64 {
            return None;
        }
        Some((all, RandomEffects::diagonal(&told)?.with_factors(&told)))
    };
    let whole = if shared.is_empty() { None } else { extended() };
    let all_effects: Vec<EffectKey> = common.iter().chain(shared).cloned().collect();
    let (parameters, fit, effects) = match &whole {
        Some((all, fit)) => (all.clone(), fit, with(&all_effects)),
        None => (names.to_vec(), fit, with(common)),
    };
    Prior {
        units: fit.units,
        width: units[0].size[0],
        height: units[0].size[1],
        with: effects,
        parameters,
        mean: fit.mean.iter().copied().collect(),
        between_units: rows(&fit.between),
        of_mean: rows(&fit.mean_covariance),
        covariance: rows(&fit.of_next_unit()),
    }
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let n = matrix.nrows();
    (0..n).map(|i| (0..n).map(|k| 0.5 * (matrix[(i, k)] + matrix[(k, i)])).collect()).collect()
}
