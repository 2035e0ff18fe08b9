//! Units whose errors are far larger than those of the others, whatever their parameters say.

use depthcal_io::{FleetOutlier, FleetOutlierPart};
use depthcal_statistics::{median, normal_tail};

use crate::unit::Unit;

/// Least ratio of a large error to the median of the others.
const LEAST_RATIO: f64 = 2.0;
/// Least departure of its logarithm, in robust standard deviations of the others.
const LEAST_DEVIATIONS: f64 = 4.0;
/// Standard deviation of a normal distribution over its median absolute deviation.
const NORMAL_MAD: f64 = 1.4826;
/// Least standard deviation of logarithms: errors of equal cameras differ by a tenth by the captures alone.
const LEAST_SCATTER: f64 = 0.1;
/// Fewest other units that say what is usual.
const FEWEST: usize = 3;

/// An error of a unit.
type ErrorOf = fn(&Unit) -> Option<f64>;

/// The errors that are compared, by name.
const ERRORS: [(&str, ErrorOf); 2] =
    [("depth_rms_mm", |unit| unit.depth_rms_mm), ("reprojection_rms_px", |unit| unit.reprojection_rms_px)];

/// Units with errors far larger than those of the others, each for one error.
pub(crate) fn large_errors(units: &[Unit], tests: f64) -> Vec<FleetOutlier> {
    let mut outliers: Vec<FleetOutlier> = Vec::new();
    for (name, error) in ERRORS {
        let errors: Vec<Option<f64>> = units.iter().map(|unit| error(unit).filter(|e| *e > 0.0)).collect();
        for (unit, value) in errors.iter().enumerate().filter_map(|(i, e)| Some((i, (*e)?))) {
            let is_other = |(i, _): &(usize, &Option<f64>)| *i != unit;
            let mut others: Vec<f64> =
                errors.iter().enumerate().filter(is_other).filter_map(|(_, e)| e.map(f64::ln)).collect();
            if others.len() < FEWEST || outliers.iter().any(|o| o.unit == unit) {
                continue;
            }
            let middle = median(&mut others);
            let mut deviations: Vec<f64> = others.iter().map(|e| (e - middle).abs()).collect();
            let scatter = (NORMAL_MAD * median(&mut deviations)).max(LEAST_SCATTER);
            let standardized = (value.ln() - middle) / scatter;
            if value.ln() - middle < LEAST_RATIO.ln() || standardized < LEAST_DEVIATIONS {
                continue;
            }
            let part = FleetOutlierPart { parameter: name.to_owned(), value, expected: middle.exp(), standardized };
            outliers.push(FleetOutlier {
                unit,
                name: units[unit].name.clone(),
                within: "error".to_owned(),
                p_value: (normal_tail(standardized) * tests).min(1.0),
                parts: vec![part],
            });
        }
    }
    outliers
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::conditions::Conditions;
    use crate::random_effects::UnitEstimate;

    fn units(depth: &[f64], image: f64) -> Vec<Unit> {
        let unit = |(i, rms): (usize, &f64)| Unit {
            name: format!("unit{i}"),
            calibration: String::new(),
            digest: String::new(),
            size: [640, 480],
            frames: 20,
            depth_rms_mm: Some(*rms),
            reprojection_rms_px: Some(image),
            parameters: Vec::new(),
            estimate: UnitEstimate { value: DVector::zeros(0), covariance: DMatrix::zeros(0, 0) },
            conditions: Conditions::default(),
            effects: Vec::new(),
            scores: None,
        };
        depth.iter().enumerate().map(unit).collect()
    }

    #[test]
    fn one_unit_with_seven_times_the_error_is_an_outlier_and_scatter_is_none() {
        let outliers = large_errors(&units(&[1.02, 0.95, 7.64, 1.1, 0.98], 0.1), 5.0);
        assert_eq!(outliers.len(), 1);
        let part = &outliers[0].parts[0];
        assert_eq!(
            (outliers[0].unit, outliers[0].within.as_str(), part.parameter.as_str()),
            (2, "error", "depth_rms_mm")
        );
        assert!((part.expected - 1.0).abs() < 0.02 && outliers[0].p_value < 1e-10, "{part:?}");
        assert!(large_errors(&units(&[1.0, 1.5, 0.7, 1.9, 1.2], 0.1), 5.0).is_empty(), "scatter");
        assert!(large_errors(&units(&[1.0, 9.0, 1.0], 0.1), 5.0).is_empty(), "two others do not say what is usual");
    }
}
