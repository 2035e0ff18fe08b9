use serde::{Deserialize, Serialize};

/// Parameters of a piece that are values of a smooth function, one after the other: their second differences are normal with
/// mean zero and a standard deviation, and so is each of them about its nominal value (a penalised spline: Eilers, Marx,
/// *Flexible smoothing with B-splines and penalties*, Statistical Science 11, 1996). Every fit has this prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SmoothParameters {
    /// Names of the parameters, in order.
    pub parameters: Vec<String>,
    /// Of a function of two covariates, the number of parameters in a row of values; all others follow row by row, and second
    /// differences are those along rows and columns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub per_row: Option<usize>,
    /// Standard deviation of second differences of neighbouring parameters, in their unit.
    pub roughness: f64,
    /// Standard deviation of each parameter about its nominal value, in its unit.
    pub deviation: f64,
}

impl SmoothParameters {
    /// Places, among these parameters, of every three neighbours along a row or a column.
    pub fn neighbours(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let count = self.parameters.len();
        let per_row = self.per_row.unwrap_or(count).max(1);
        let along_row = (0..count).filter(move |i| i % per_row + 2 < per_row).map(|i| [i, i + 1, i + 2]);
        let along_column = (0..count.saturating_sub(2 * per_row)).map(move |i| [i, i + per_row, i + 2 * per_row]);
        along_row.chain(along_column)
    }
}
