use serde::{Deserialize, Serialize};

/// Parameters of a piece that are values of a smooth function, one after the other: their second differences are normal with
/// mean zero and a standard deviation, and so is each of them about its nominal value (a penalised spline: Eilers, Marx,
/// *Flexible smoothing with B-splines and penalties*, Statistical Science 11, 1996). Every fit has this prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SmoothParameters {
    /// Names of the parameters, in order.
    pub parameters: Vec<String>,
    /// Standard deviation of second differences of neighbouring parameters, in their unit.
    pub roughness: f64,
    /// Standard deviation of each parameter about its nominal value, in its unit.
    pub deviation: f64,
}
