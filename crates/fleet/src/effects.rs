//! Effects over all units: which are shared, and which differ from unit to unit.
//!
//! Of every effect each unit gives an estimate: from its model where that has the effect, else one step from its score, ê = V⁻¹ U
//! with covariance V⁻¹. Where V pools to enough information, an effect is found that no unit's own data show: the noncentrality
//! of the fleet's test is the sum of the units'. Estimates are compared in the coordinates in which the mean information is the
//! identity, without the directions that no unit determines. Variances are multiplied by the factor by which the frames' scores
//! scatter more than the noise model says, over all units together: a single unit has too few frames to tell.
//!
//! Effects are found one after another, as in a diagnosis: the best one first, then what is left given those found, every unit
//! having these free. What was significant and is not any more is explained by the effect that was found last.

use depthcal_io::{FleetEffect, FleetEffectUnit};
use depthcal_statistics::noncentrality;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::error::FEWEST_UNITS;
use crate::outliers::{OutlierSearch, find_outliers};
use crate::random_effects::{RandomEffects, UnitEstimate};
use crate::scaled::{Scaled, part};
use crate::significance::{holm, homogeneity_p_value, shared_p_value};
use crate::unit::{EffectKey, Unit};

/// Most effects that are found one after another.
const MOST_FOUND: usize = 6;
/// Directions with less than this share of the information of the best one, parameters being scaled, are not compared.
const DETERMINED: f64 = 1e-6;
/// Squared standard deviations by which an effect must explain more than another to be told from it.
const TOLD_APART: f64 = 9.0;
/// Probability with which a unit alone detects an effect of the detectable size.
const POWER: f64 = 0.8;

/// Coordinates in which the mean information of an effect is the identity.
pub(crate) struct Coordinates {
    /// To these coordinates.
    to: DMatrix<f64>,
    /// Back to parameters.
    from: DMatrix<f64>,
}

impl Coordinates {
    fn new(estimates: &[UnitEstimate]) -> Option<Self> {
        let n = estimates.first()?.value.len();
        let mut information = DMatrix::zeros(n, n);
        for estimate in estimates {
            information += Scaled::new(&estimate.covariance)?.inverse();
        }
        information /= estimates.len() as f64;
        let scale = information.diagonal().map(f64::sqrt);
        let scaled = DMatrix::from_fn(n, n, |i, k| information[(i, k)] / (scale[i] * scale[k]));
        let eigen = SymmetricEigen::new(scaled);
        let largest = eigen.eigenvalues.max();
        let mut determined: Vec<usize> = (0..n).filter(|i| eigen.eigenvalues[*i] > DETERMINED * largest).collect();
        determined.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let root = |i: usize| eigen.eigenvalues[determined[i]].sqrt();
        let to =
            DMatrix::from_fn(determined.len(), n, |i, k| root(i) * eigen.eigenvectors[(k, determined[i])] * scale[k]);
        let from =
            DMatrix::from_fn(n, determined.len(), |k, i| eigen.eigenvectors[(k, determined[i])] / (root(i) * scale[k]));
        Some(Self { to, from })
    }

    fn of(&self, estimate: &UnitEstimate) -> UnitEstimate {
        let covariance = &self.to * &estimate.covariance * self.to.transpose();
        let covariance = (&covariance + covariance.transpose()) * 0.5;
        UnitEstimate { value: &self.to * &estimate.value, covariance }
    }
}

/// The evidence for one effect.
pub(crate) struct Evidence {
    /// Departure of every unit's estimate from nominal; `None` for units that say nothing.
    estimates: Vec<Option<UnitEstimate>>,
    /// The fit in the coordinates.
    fit: RandomEffects,
    coordinates: Coordinates,
    /// How well it explains the observations: twice the rise of their log-likelihood, less the price of its parameters.
    merit: f64,
    /// p-value of no shared effect; 1 with too few units.
    shared_p_value: f64,
    /// p-value of units not differing.
    differs_p_value: f64,
    overdispersion: f64,
}

/// An effect of the units, with what describes it.
struct Described<'a> {
    key: &'a EffectKey,
    with: &'a str,
    names: &'a [String],
    nominal: &'a [f64],
}

/// Effects over all units.
pub(crate) struct Effects<'a> {
    /// All units.
    pub units: &'a [Unit],
    /// Which of them are like the others.
    pub kept: &'a [bool],
    /// Effects that some models have and all units tell: free in all of them.
    pub adopted: &'a [EffectKey],
    /// Level of every family of tests.
    pub level: f64,
}

/// A unit that is unlike the others in an effect.
pub(crate) struct EffectOutliers {
    pub key: EffectKey,
    pub names: Vec<String>,
    /// Departures are in parameters.
    pub search: OutlierSearch,
    /// Values of every unit.
    pub values: Vec<Option<DVector<f64>>>,
}

impl<'a> Effects<'a> {
    /// The effects that at least [`FEWEST_UNITS`] kept units have or scored, but for those in `common`.
    fn described(&self, common: &[EffectKey]) -> Vec<Described<'a>> {
        let mut described: Vec<Described<'a>> = Vec::new();
        for effect in self.units.iter().flat_map(|u| &u.effects) {
            let is_new = described.iter().all(|f| *f.key != effect.key);
            if is_new && !common.contains(&effect.key) && self.count(&effect.key) >= FEWEST_UNITS {
                let (key, with, names, nominal) = (&effect.key, &*effect.with, &*effect.names, &*effect.nominal);
                described.push(Described { key, with, names, nominal });
            }
        }
        described
    }

    /// Number of effects that are tested.
    pub fn count_all(&self, common: &[EffectKey]) -> usize {
        self.described(common).len()
    }

    fn count(&self, key: &EffectKey) -> usize {
        self.units.iter().zip(self.kept).filter(|(u, is_alike)| **is_alike && u.effect(key).is_some()).count()
    }

    /// Factor by which the frames' scores scatter more than the noise model says, over all kept units; at least 1.
    fn overdispersion(&self, key: &EffectKey) -> f64 {
        let (mut observed, mut expected) = (0.0, 0.0);
        for (unit, _) in self.units.iter().zip(self.kept).filter(|(_, is_alike)| **is_alike) {
            let (Some(effect), Some(scores)) = (unit.effect(key), &unit.scores) else { continue };
            let Some(scatter) = &effect.scatter else { continue };
            let places: Option<Vec<usize>> =
                effect.names.iter().map(|n| scores.names.iter().position(|m| m == n)).collect();
            let inverse = places
                .and_then(|places| Scaled::with_ridge(&part(&scores.information, &places, &places), DETERMINED))
                .map(|factor| factor.inverse());
            if let Some(inverse) = inverse {
                observed += (inverse * scatter).trace();
                expected += effect.names.len() as f64 * (unit.frames.max(2) - 1) as f64 / unit.frames.max(2) as f64;
            }
        }
        if expected > 0.0 { (observed / expected).max(1.0) } else { 1.0 }
    }

    /// The evidence for an effect given others; `None` where the units do not determine it.
    fn evidence(&self, effect: &Described<'_>, given: &[EffectKey]) -> Option<Evidence> {
        let mut free = vec![effect.key];
        for key in self.adopted.iter().chain(given) {
            if !free.contains(&key) {
                free.push(key);
            }
        }
        let overdispersion = free.iter().map(|key| self.overdispersion(key)).fold(1.0, f64::max);
        let nominal = DVector::from_column_slice(effect.nominal);
        let estimates = |overdispersion: f64| -> Vec<Option<UnitEstimate>> {
            let estimate = |unit: &Unit| {
                let mut estimate = unit.estimate_with(effect.names, &free, overdispersion)?;
                estimate.value -= &nominal;
                Some(estimate)
            };
            self.units.iter().map(estimate).collect()
        };
        let of_kept = |estimates: &[Option<UnitEstimate>]| -> Vec<UnitEstimate> {
            estimates.iter().zip(self.kept).filter(|(_, is_alike)| **is_alike).filter_map(|(e, _)| e.clone()).collect()
        };
        // The noise model is that of all effects; factors of their own would make their merits those of different data.
        let by_noise = of_kept(&estimates(1.0));
        let estimates = estimates(overdispersion);
        let alike = of_kept(&estimates);
        if alike.len() < FEWEST_UNITS {
            return None;
        }
        let coordinates = Coordinates::new(&alike)?;
        let in_coordinates =
            |estimates: &[UnitEstimate]| -> Vec<UnitEstimate> { estimates.iter().map(|e| coordinates.of(e)).collect() };
        let (in_own, by_noise) = (in_coordinates(&alike), in_coordinates(&by_noise));
        let fit = RandomEffects::diagonal(&in_own)?;
        let merit = self.merit(&by_noise)?;
        let rank = fit.mean.len();
        let (all, zero) = ((0..rank).collect::<Vec<_>>(), DVector::zeros(rank));
        Some(Evidence {
            merit,
            shared_p_value: shared_p_value(&fit, &all, &zero).unwrap_or(1.0),
            differs_p_value: homogeneity_p_value(&in_own)?,
            estimates,
            fit,
            coordinates,
            overdispersion,
        })
    }

    /// Twice the rise of the log-likelihood by a mean and a scatter of these estimates, less the logarithm of the number of
    /// frames for each of its numbers (Schwarz 1978). A false effect that resembles the true one explains every unit a little
    /// differently, and pays for that with its scatter.
    fn merit(&self, estimates: &[UnitEstimate]) -> Option<f64> {
        let fit = RandomEffects::diagonal(estimates)?;
        let alike = self.units.iter().zip(self.kept).filter(|(_, is_alike)| **is_alike);
        let frames: usize = alike.map(|(unit, _)| unit.frames).sum();
        let numbers = fit.mean.len() + fit.between.diagonal().iter().filter(|v| **v > 0.0).count();
        Some(fit.gain_over_nothing(estimates)? - numbers as f64 * (frames.max(1) as f64).ln())
    }

    /// All effects with what was found of them, by rising p-value, and the keys of the shared ones in the order in which they
    /// were found.
    pub fn all(&self, common: &[EffectKey]) -> (Vec<FleetEffect>, Vec<EffectKey>) {
        let described = self.described(common);
        let marginal: Vec<(&Described<'_>, Evidence)> =
            described.iter().filter_map(|d| Some((d, self.evidence(d, &[])?))).collect();
        let first = holm(&marginal.iter().map(|(_, e)| e.shared_p_value).collect::<Vec<_>>());
        let differs = holm(&marginal.iter().map(|(_, e)| e.differs_p_value).collect::<Vec<_>>());
        let mut chosen: Vec<EffectKey> = Vec::new();
        let mut indistinguishable: Vec<Vec<String>> = Vec::new();
        let mut explained: Vec<Option<String>> = vec![None; marginal.len()];
        let mut present: Vec<Option<(f64, f64)>> =
            marginal.iter().map(|(_, e)| Some((e.shared_p_value, e.merit))).collect();
        while chosen.len() < MOST_FOUND {
            let p: Vec<f64> = present.iter().map(|e| e.map_or(1.0, |e| e.0)).collect();
            let corrected = holm(&p);
            let merit = |i: usize| present[i].map_or(f64::NEG_INFINITY, |e| e.1);
            let significant: Vec<usize> = (0..marginal.len()).filter(|i| corrected[*i] < self.level).collect();
            let Some(best) = significant.iter().copied().max_by(|a, b| merit(*a).total_cmp(&merit(*b))) else { break };
            let rivals: Vec<usize> = significant.iter().copied().filter(|i| *i != best).collect();
            let close = |i: &&usize| merit(**i) > merit(best) - TOLD_APART;
            let close: Vec<usize> = rivals.iter().filter(close).copied().collect();
            chosen.push(marginal[best].0.key.clone());
            present[best] = None;
            for (i, (effect, _)) in marginal.iter().enumerate() {
                if present[i].is_some() {
                    let left = self.evidence(effect, &chosen);
                    present[i] = left.map(|e| (e.shared_p_value, e.merit));
                }
            }
            let left = holm(&present.iter().map(|e| e.map_or(1.0, |e| e.0)).collect::<Vec<_>>());
            for i in rivals.iter().filter(|i| left[**i] >= self.level) {
                explained[*i].get_or_insert_with(|| marginal[best].0.with.to_owned());
            }
            let twins = close.iter().filter(|i| left[**i] >= self.level);
            indistinguishable.push(twins.map(|i| marginal[*i].0.with.to_owned()).collect());
        }
        let mut records: Vec<(f64, FleetEffect)> = marginal
            .iter()
            .enumerate()
            .map(|(i, (effect, evidence))| {
                let position = chosen.iter().position(|key| key == effect.key);
                let (level_each, merit) = (self.level / marginal.len() as f64, evidence.merit);
                // Shared effects are told with each other in the model.
                let others: Vec<EffectKey> = chosen.iter().filter(|key| *key != effect.key).cloned().collect();
                let last = position.and_then(|_| self.evidence(effect, &others));
                let evidence = last.as_ref().unwrap_or(evidence);
                let record = FleetEffect {
                    shared_p_value: first[i],
                    differs_p_value: differs[i],
                    shared: position.is_some(),
                    explained_by: explained[i].clone().filter(|_| position.is_none()),
                    indistinguishable: position.map(|index| indistinguishable[index].clone()).unwrap_or_default(),
                    ..self.record(effect, evidence, level_each)
                };
                (merit, record)
            })
            .collect();
        records.sort_by(|(a, x), (b, y)| {
            (y.shared, -y.shared_p_value)
                .partial_cmp(&(x.shared, -x.shared_p_value))
                .unwrap_or(std::cmp::Ordering::Equal)
                .then(b.total_cmp(a))
        });
        (records.into_iter().map(|(_, record)| record).collect(), chosen)
    }

    fn record(&self, effect: &Described<'_>, evidence: &Evidence, level: f64) -> FleetEffect {
        let Coordinates { from, .. } = &evidence.coordinates;
        let departure = from * &evidence.fit.mean;
        let std = |covariance: &DMatrix<f64>| -> Vec<f64> {
            (from * covariance * from.transpose()).diagonal().iter().map(|v| v.max(0.0).sqrt()).collect()
        };
        let squares: Vec<&DMatrix<f64>> =
            self.units.iter().filter_map(|u| u.effect(effect.key)?.square_mm2.as_ref()).collect();
        let square = |m: &&DMatrix<f64>| departure.dot(&(*m * &departure)).max(0.0);
        let mean_square = squares.iter().map(square).sum::<f64>() / squares.len().max(1) as f64;
        let mut noncentralities: Vec<f64> = evidence
            .estimates
            .iter()
            .zip(self.kept)
            .filter_map(|(e, is_alike)| {
                let seen = evidence.coordinates.of(e.as_ref().filter(|_| *is_alike)?);
                Some(evidence.fit.mean.dot(&(Scaled::new(&seen.covariance)?.inverse() * &evidence.fit.mean)))
            })
            .collect();
        noncentralities.sort_by(f64::total_cmp);
        let sufficient = noncentrality(evidence.fit.mean.len(), level, POWER);
        let unit = |(i, estimate): (usize, &Option<UnitEstimate>)| {
            let estimate = estimate.as_ref()?;
            Some(FleetEffectUnit {
                unit: i,
                in_model: self.units[i].effect(effect.key).is_some_and(|e| e.in_model),
                values: estimate.value.iter().zip(effect.nominal).map(|(v, n)| v + n).collect(),
                std_dev: estimate.covariance.diagonal().iter().map(|v| v.sqrt()).collect(),
            })
        };
        FleetEffect {
            effect: effect.key.name.clone(),
            with: effect.with.to_owned(),
            in_models: self.units.iter().filter(|u| u.effect(effect.key).is_some_and(|e| e.in_model)).count(),
            parameters: effect.names.to_vec(),
            mean: departure.iter().zip(effect.nominal).map(|(d, n)| d + n).collect(),
            mean_std_dev: std(&evidence.fit.mean_covariance),
            between_units: std(&evidence.fit.between),
            shared_p_value: evidence.shared_p_value,
            differs_p_value: evidence.differs_p_value,
            shared: false,
            explained_by: None,
            indistinguishable: Vec::new(),
            size_mm: (!squares.is_empty()).then(|| mean_square.sqrt()),
            of_detectable: noncentralities.get(noncentralities.len() / 2).map(|lambda| (lambda / sufficient).sqrt()),
            overdispersion: evidence.overdispersion,
            units: evidence.estimates.iter().enumerate().filter_map(unit).collect(),
        }
    }

    /// Units that are unlike the others in an effect, `given` effects being free; `level` is divided by the number of units and
    /// effects.
    pub fn outliers(&self, common: &[EffectKey], given: &[EffectKey]) -> Vec<EffectOutliers> {
        let described = self.described(common);
        let tests = (self.units.len() * (described.len() + 1)) as f64;
        let search = |effect: &Described<'_>| {
            let others: Vec<EffectKey> = given.iter().filter(|key| *key != effect.key).cloned().collect();
            let evidence = self.evidence(effect, &others)?;
            let places: Vec<usize> = (0..self.units.len()).filter(|i| evidence.estimates[*i].is_some()).collect();
            let estimates: Vec<UnitEstimate> = places
                .iter()
                .filter_map(|i| evidence.estimates[*i].as_ref())
                .map(|e| evidence.coordinates.of(e))
                .collect();
            let search = find_outliers(&estimates, self.level / tests);
            let mut is_alike = vec![true; self.units.len()];
            let mut departures: Vec<_> = (0..self.units.len()).map(|_| None).collect();
            let nominal = DVector::from_column_slice(effect.nominal);
            for ((place, is_kept), departure) in places.iter().zip(search.kept).zip(search.departures) {
                is_alike[*place] = is_kept;
                departures[*place] = departure.map(|mut d| {
                    d.expected = &nominal + &evidence.coordinates.from * &d.expected;
                    d
                });
            }
            let value = |e: &Option<UnitEstimate>| e.as_ref().map(|e| &e.value + &nominal);
            Some(EffectOutliers {
                key: effect.key.clone(),
                names: effect.names.to_vec(),
                search: OutlierSearch { kept: is_alike, departures },
                values: evidence.estimates.iter().map(value).collect(),
            })
        };
        described.iter().filter_map(search).collect()
    }
}
