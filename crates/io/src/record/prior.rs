//! `prior.json`: what the units of a fleet say of the next one.

use serde::{Deserialize, Serialize};

use super::result_file::result_file;
use crate::file::{Fault, Versioned, read_versioned, write_versioned};

/// A normal prior of a camera's parameters, from other units of its type (empirical Bayes).
///
/// The file carries `"format": "depthcal-prior"` and `"version": 1` in addition to these fields.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Prior {
    /// Number of units that it comes from.
    pub units: usize,
    /// Width of the image in px.
    pub width: usize,
    /// Height of the image in px.
    pub height: usize,
    /// Effects that the units share, as given to `calibrate --with`: the next unit needs them in its model.
    pub with: Vec<String>,
    /// Names of the parameters, `piece.parameter`.
    pub parameters: Vec<String>,
    /// Mean μ of the units, in the parameters' units.
    pub mean: Vec<f64>,
    /// Covariance T between units.
    pub between_units: Vec<Vec<f64>>,
    /// Covariance of the mean.
    pub of_mean: Vec<Vec<f64>>,
    /// Covariance of a further unit about the mean: T with what is not known of it, and the covariance of the mean. This is what
    /// `calibrate --prior` uses.
    pub covariance: Vec<Vec<f64>>,
}

result_file!(Prior, "prior.json", read_versioned, write_versioned);

/// How a calibration used a prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct PriorUse {
    /// Number of units that it comes from.
    pub units: usize,
    /// The parameters that it was used for.
    pub parameters: Vec<UsedPriorParameter>,
    /// Squared distance (Mahalanobis) of the estimate from the prior's mean in the prior's covariance.
    pub distance_squared: f64,
    /// P(χ² > `distance_squared`) with as many degrees of freedom as parameters: small where this unit is not like the others.
    pub p_value: f64,
}

/// A parameter for which a prior was used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct UsedPriorParameter {
    /// Name, `piece.parameter`.
    pub name: String,
    /// Mean of the prior.
    pub mean: f64,
    /// Standard deviation of the prior.
    pub std_dev: f64,
    /// Share of the information on the parameter that comes from this unit's own data: 1 − (σ after / σ of the prior)².
    pub own_share: f64,
}

impl Versioned for Prior {
    const FORMAT: &'static str = "depthcal-prior";
    const VERSION: u32 = 1;

    fn check(&self) -> Result<(), Fault> {
        let n = self.parameters.len();
        if self.mean.len() != n {
            return Err(Fault::new("mean", format!("must have one number per parameter, {n}")));
        }
        let matrices =
            [("between_units", &self.between_units), ("of_mean", &self.of_mean), ("covariance", &self.covariance)];
        for (field, matrix) in matrices {
            if matrix.len() != n || matrix.iter().any(|row| row.len() != n) {
                return Err(Fault::new(field, format!("must be square with one row per parameter, {n}×{n}")));
            }
        }
        for (i, row) in self.covariance.iter().enumerate() {
            if !(row[i] > 0.0) {
                return Err(Fault::new(format!("covariance[{i}][{i}]"), "is a variance and must be above 0"));
            }
            for (k, value) in row.iter().enumerate().take(i) {
                let scale = (row[i] * self.covariance[k][k]).sqrt();
                if (value - self.covariance[k][i]).abs() > 1e-6 * scale || value.abs() > scale * (1.0 + 1e-9) {
                    let problem = "must equal its transposed element and be no larger than the variances allow";
                    return Err(Fault::new(format!("covariance[{i}][{k}]"), problem));
                }
            }
        }
        Ok(())
    }
}
