//! Effects that units have with constants, a place or a form of their own, compared by what they do to depth: their parameters
//! mean different things.

use depthcal_io::{FleetOnDepth, FleetUnitOnDepth};
use depthcal_model::uncertainty::STEP;
use depthcal_model::{Camera, Context};
use depthcal_statistics::{Span, quantile, rms, weighted_chi_squared_tail};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::conditions::Conditions;
use crate::depth_effect::{Cell, DepthEffect, measured_mm};
use crate::unit::{EffectKey, Unit, UnitEffect};

/// Pixels at which effects are compared, along the image and across, …
const PIXELS: [usize; 2] = [5, 4];
/// … number of distances, in equal ratios from the nearest board to the farthest, …
const DISTANCES: usize = 5;
/// … cosines of the angle of incidence, …
const COSINES: [f64; 2] = [1.0, 0.7];
/// … and levels of amplitude, temperature and time, of which the first has to do where none of these is known.
const LEVELS: [Level; 3] = [
    Level { quantile: 0.5, of_reference: 1.0 },
    Level { quantile: 0.1, of_reference: 0.5 },
    Level { quantile: 0.9, of_reference: 2.0 },
];

/// Conditions of a cell.
struct Level {
    /// Quantile of the frames' temperatures and times.
    quantile: f64,
    /// Amplitude over the reference that the effects have on average.
    of_reference: f64,
}

/// The changes of depth at all cells by an effect, mm, less the part that the depth model can take, and how these change along
/// every direction of its uncertainty, by one standard deviation.
struct OnDepth<'a> {
    unit: &'a Unit,
    effect: &'a UnitEffect,
    values: Vec<f64>,
    changes: Vec<Vec<f64>>,
}

impl<'a> OnDepth<'a> {
    /// `None` where a cell has no value, or none changes: the effect depends on something that calibrations do not keep.
    fn of((unit, effect): (&'a Unit, &'a UnitEffect), cells: &[Cell]) -> Option<Self> {
        let DepthEffect { with, without, compensating, .. } = effect.on_depth.as_ref()?;
        let half_difference = |cameras: &[Camera; 2]| -> Vec<f64> {
            let [plus, minus] = cameras.each_ref().map(|camera| measured_mm(camera, cells));
            plus.iter().zip(minus).map(|(plus, minus)| 0.5 * (plus - minus)).collect()
        };
        let changes: Vec<Vec<f64>> = with.changed().iter().map(half_difference).collect();
        let values: Vec<f64> = measured_mm(&with.camera, cells)
            .iter()
            .zip(measured_mm(without, cells))
            .map(|(with, without)| with - without)
            .collect();
        let all = || values.iter().chain(changes.iter().flatten());
        let is_known = all().all(|value| value.is_finite()) && all().any(|value| *value != 0.0);
        if !is_known {
            return None;
        }
        let of_model = Span::of(compensating.iter().map(half_difference));
        let changes = changes.iter().map(|change| change.iter().map(|c| c / STEP).collect());
        let taken_off = |mut values: Vec<f64>| {
            of_model.take_off(&mut values);
            values
        };
        Some(Self { unit, effect, values: taken_off(values), changes: changes.map(taken_off).collect() })
    }
}

/// Effects that at least two units that are alike have, not all of them with the same constants.
pub(crate) fn on_depth(units: &[Unit], is_alike: &[bool], common: &[EffectKey]) -> Vec<FleetOnDepth> {
    let alike: Vec<&Unit> = units.iter().zip(is_alike).filter(|(_, alike)| **alike).map(|(unit, _)| unit).collect();
    let in_models = || alike.iter().flat_map(|unit| unit.effects.iter().filter(|e| e.in_model).map(|e| (*unit, e)));
    let mut names: Vec<&str> = Vec::new();
    for (_, effect) in in_models().filter(|(_, effect)| !common.contains(&effect.key)) {
        if !names.contains(&effect.key.name.as_str()) {
            names.push(&effect.key.name);
        }
    }
    let of_name = |name: &&str| -> Option<FleetOnDepth> {
        let members: Vec<(&Unit, &UnitEffect)> = in_models().filter(|(_, e)| e.key.name == **name).collect();
        let differ = members.iter().any(|(_, effect)| effect.key != members[0].1.key);
        if differ { compared(name, &members) } else { None }
    };
    names.iter().filter_map(of_name).collect()
}

/// The effects of a name compared; `None` where they depend on what calibrations do not keep.
fn compared(name: &str, members: &[(&Unit, &UnitEffect)]) -> Option<FleetOnDepth> {
    let cells = cells(members)?;
    let known: Vec<OnDepth<'_>> = members.iter().filter_map(|member| OnDepth::of(*member, &cells)).collect();
    if known.len() < 2 {
        return None;
    }
    let mean = |cell: usize| known.iter().map(|of_unit| of_unit.values[cell]).sum::<f64>() / known.len() as f64;
    Some(FleetOnDepth {
        effect: name.to_owned(),
        mean_mm: rms((0..cells.len()).map(mean)),
        units: (0..known.len()).into_par_iter().map(|place| against_others(&known, place)).collect(),
    })
}

/// The effect of one unit on depth, against the mean of the others.
fn against_others(all: &[OnDepth<'_>], place: usize) -> FleetUnitOnDepth {
    let OnDepth { unit, effect, values, .. } = &all[place];
    let of_others = 1.0 / (all.len() - 1) as f64;
    let weight = |other: usize| if other == place { 1.0 } else { -of_others };
    let difference: Vec<f64> =
        (0..values.len()).map(|i| all.iter().enumerate().map(|(k, each)| weight(k) * each.values[i]).sum()).collect();
    let changes: Vec<Vec<f64>> = all
        .iter()
        .enumerate()
        .flat_map(|(k, each)| each.changes.iter().map(move |change| change.iter().map(|c| weight(k) * c).collect()))
        .collect();
    let changes = DMatrix::from_fn(values.len(), changes.len(), |cell, k| changes[k][cell]);
    // Of the products of cells and of directions the smaller matrix: their traces are the same.
    let gram =
        if changes.ncols() < changes.nrows() { changes.tr_mul(&changes) } else { &changes * changes.transpose() };
    let gram = gram / values.len() as f64;
    let square = &gram * &gram;
    let traces = [gram.trace(), square.trace(), square.dot(&gram)];
    let difference_mm = rms(difference);
    let p_value = match traces[0] > 0.0 {
        true => weighted_chi_squared_tail(difference_mm * difference_mm, traces),
        // Of parameters that all are held.
        false => f64::from(difference_mm == 0.0),
    };
    FleetUnitOnDepth {
        name: unit.name.clone(),
        with: effect.with.clone(),
        size_mm: rms(values.iter().copied()),
        difference_mm,
        of_noise_mm: traces[0].sqrt(),
        p_value,
    }
}

/// The cells at which the effects of some units are compared; `None` where no unit has a board in front of it.
fn cells(members: &[(&Unit, &UnitEffect)]) -> Option<Vec<Cell>> {
    let of_all = |values: fn(&Conditions) -> &Vec<f64>| -> Vec<f64> {
        members.iter().flat_map(|(unit, _)| values(&unit.conditions).iter().copied()).collect()
    };
    let distances = of_all(|conditions| &conditions.distances_mm);
    let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
    let farthest = distances.iter().copied().fold(0.0, f64::max);
    if nearest > farthest {
        return None;
    }
    let (temperatures, times) = (of_all(|c| &c.temperatures_c), of_all(|c| &c.times_s));
    let quantile_or = |unknown: f64, values: &[f64], q: f64| {
        if values.is_empty() { unknown } else { quantile(values.iter().copied(), q) }
    };
    let references =
        members.iter().filter_map(|(_, effect)| effect.on_depth.as_ref()?.reference_amplitude).map(f64::ln);
    let amplitude = match references.clone().count() {
        0 => f64::NAN,
        n => (references.sum::<f64>() / n as f64).exp(),
    };
    let is_same = amplitude.is_nan() && temperatures.is_empty() && times.is_empty();
    let levels = if is_same { &LEVELS[..1] } else { &LEVELS[..] };
    let [width, height] = members[0].0.size;
    let mut cells = Vec::new();
    for place in 0..PIXELS[0] * PIXELS[1] {
        let (column, row) = (place % PIXELS[0], place / PIXELS[0]);
        let along = |i: usize, n: usize, size: usize| (i as f64 + 0.5) / n as f64 * size as f64 - 0.5;
        let pixel = [along(column, PIXELS[0], width), along(row, PIXELS[1], height)];
        for distance in 0..DISTANCES {
            let share = distance as f64 / (DISTANCES - 1) as f64;
            for (Level { quantile: q, of_reference }, cos_incidence) in
                levels.iter().flat_map(|level| COSINES.map(|cosine| (level, cosine)))
            {
                let context = Context {
                    pixel,
                    amplitude: of_reference * amplitude,
                    temperature_c: quantile_or(f64::NAN, &temperatures, *q),
                    time_s: quantile_or(0.0, &times, *q),
                    ..Context::default()
                };
                cells.push(Cell { context, cos_incidence, depth_mm: nearest * (farthest / nearest).powf(share) });
            }
        }
    }
    Some(cells)
}

#[cfg(test)]
mod tests {
    use depthcal_model::uncertainty::UncertainCamera;
    use depthcal_model::{Block, Options, Placement, Register};
    use nalgebra::DVector;

    use super::*;
    use crate::conditions::Conditions;
    use crate::random_effects::UnitEstimate;

    /// A unit with an effect of some constants, whose first parameter is `size` and known to `std_dev`.
    fn unit(number: usize, name: &str, constant: (&str, f64), size: f64, std_dev: f64) -> Unit {
        let options = Options::from([(constant.0.to_owned(), constant.1)]);
        let piece = Register::builtin().placed_piece(name, &options, Placement::default()).unwrap();
        let mut block = Block::new(piece);
        block.theta[0] = size;
        let pinhole = [500.0, 500.0, 319.5, 239.5, 0.0];
        let without = Camera::new(640, 480, pinhole, vec![]);
        let camera = Camera::new(640, 480, pinhole, vec![block]);
        let with = UncertainCamera::new(camera, &[5], &DMatrix::from_element(1, 1, std_dev * std_dev));
        let reference_amplitude = (constant.0 == "reference").then_some(constant.1);
        let on_depth = Some(DepthEffect { with, without, compensating: Vec::new(), reference_amplitude });
        let key = EffectKey { name: name.to_owned(), options, of: Default::default(), on: None, formula: None };
        Unit {
            name: format!("unit{number}"),
            calibration: String::new(),
            digest: String::new(),
            size: [640, 480],
            frames: 20,
            depth_rms_mm: None,
            reprojection_rms_px: None,
            parameters: Vec::new(),
            estimate: UnitEstimate { value: DVector::zeros(0), covariance: DMatrix::zeros(0, 0) },
            conditions: Conditions { distances_mm: vec![600.0, 1200.0, 2400.0], ..Conditions::default() },
            effects: vec![UnitEffect {
                key,
                with: name.to_owned(),
                names: Vec::new(),
                nominal: Vec::new(),
                in_model: true,
                scatter: None,
                square_mm2: None,
                on_depth,
            }],
            scores: None,
        }
    }

    fn compared(units: &[Unit]) -> Vec<FleetOnDepth> {
        on_depth(units, &vec![true; units.len()], &[])
    }

    /// Other periods that do nearly the same, and one that does not.
    #[test]
    fn units_with_periods_of_their_own_are_compared_by_their_effect_on_depth() {
        let periods = [4000.0, 4003.0, 3998.0, 4001.0, 2100.0];
        let units: Vec<Unit> = periods
            .iter()
            .enumerate()
            .map(|(i, period)| unit(i, "cyclic_depth", ("period_mm", *period), 3.0, 0.05))
            .collect();
        let alike = &compared(&units[..4])[0];
        assert!(alike.units.iter().all(|u| u.p_value > 0.01 && u.difference_mm < 0.1), "{alike:?}");
        // The mean square of a wave is half that of its amplitude; the distances are few.
        assert!((alike.mean_mm / (3.0 / 2.0_f64.sqrt()) - 1.0).abs() < 0.3, "{}", alike.mean_mm);
        let with_other = &compared(&units)[0];
        let worst = with_other.units.iter().max_by(|a, b| a.difference_mm.total_cmp(&b.difference_mm)).unwrap();
        assert_eq!(worst.name, "unit4");
        assert!(worst.p_value < 1e-10 && worst.difference_mm > 1.0, "{worst:?}");
    }

    /// Units that differ by their noise alone scatter by as much as noise gives.
    #[test]
    fn noise_gives_the_scatter_of_units_that_differ_by_noise() {
        let units: Vec<Unit> = [2.0, 2.4, 1.6, 2.4, 1.6]
            .iter()
            .enumerate()
            .map(|(i, size)| unit(i, "cyclic_depth", ("period_mm", 4000.0 + 0.01 * i as f64), *size, 0.4))
            .collect();
        let record = &compared(&units)[0];
        for of_unit in &record.units[1..] {
            assert!((of_unit.difference_mm / of_unit.of_noise_mm - 1.0).abs() < 0.2, "{of_unit:?}");
            assert!(of_unit.p_value > 0.1, "{of_unit:?}");
        }
    }

    #[test]
    fn held_effects_have_a_p_value() {
        let units: Vec<Unit> =
            (0..3).map(|i| unit(i, "cyclic_depth", ("period_mm", 4000.0 + i as f64), 3.0, 0.0)).collect();
        assert!(compared(&units)[0].units.iter().all(|u| u.p_value == 0.0 && u.of_noise_mm == 0.0));
    }

    #[test]
    fn effects_of_the_amplitude_refer_to_the_references_of_the_units() {
        let units: Vec<Unit> = [900.0, 1100.0]
            .iter()
            .enumerate()
            .map(|(i, r)| unit(i, "reflectivity_bias", ("reference", *r), 1e-3, 1e-5))
            .collect();
        let record = &compared(&units)[0];
        assert!(record.mean_mm > 0.0 && record.units.iter().all(|u| u.difference_mm > 0.0), "{record:?}");
    }

    /// Of a wave so long that it is a line over all distances nothing is left where the depth model has a scale and an offset.
    #[test]
    fn the_part_that_the_depth_model_can_take_is_no_effect() {
        let units = |compensated: bool| -> Vec<Unit> {
            let with_model = |i: usize| {
                let mut unit = unit(i, "cyclic_depth", ("period_mm", 2e6 + i as f64), 3.0, 0.05);
                let on_depth = unit.effects[0].on_depth.as_mut().unwrap();
                let scaled = |name: &str, value: f64| {
                    let mut block = Register::builtin().block(name, None).unwrap();
                    block.theta[0] = value;
                    on_depth.without.clone().with_block(block)
                };
                let pair = |name: &str, size: f64| [scaled(name, size), scaled(name, -size)];
                let compensating = vec![pair("range_offset", 1.0), pair("quadratic_depth", 1e-7)];
                on_depth.compensating = if compensated { compensating } else { Vec::new() };
                unit
            };
            (0..3).map(with_model).collect()
        };
        let [alone, compensated] = [false, true].map(|has| compared(&units(has))[0].mean_mm);
        // The wave is one of range, and the depth model's terms are of depth.
        assert!(compensated < 0.1 * alone, "{compensated} of {alone}");
    }

    #[test]
    fn equal_constants_and_effects_of_unknown_quantities_are_not_compared() {
        let same: Vec<Unit> = (0..3).map(|i| unit(i, "cyclic_depth", ("period_mm", 4000.0), 3.0, 0.1)).collect();
        assert!(compared(&same).is_empty());
        let unknown: Vec<Unit> =
            (0..3).map(|i| unit(i, "temperature_drift", ("reference_c", 20.0 + i as f64), 0.1, 0.01)).collect();
        assert!(compared(&unknown).is_empty());
    }
}
