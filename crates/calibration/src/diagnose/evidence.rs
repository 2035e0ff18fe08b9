//! The evidence for one candidate in the residuals of a fit.

use depthcal_model::{Block, PieceSpec};
use depthcal_solver::score::Score;
use depthcal_statistics::mean_to_standard_error;

use super::free_functions::Along;

/// The evidence for one candidate: score test, gains on held-out frames, expected and detectable size.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// Name of the effect or of the free function.
    pub name: String,
    /// Its specification, with the constant; the name alone for free functions.
    pub spec: PieceSpec,
    /// Value of the constant, where it was searched.
    pub value: Option<f64>,
    /// The spec with those parameters held that the data do not determine; `None` where they determine all.
    pub reduced: Option<PieceSpec>,
    /// Covariate of a free function; `None` for effects.
    pub along: Option<Along>,
    /// The score test.
    pub score: Score,
    /// p-value, corrected for the number of variants that were searched.
    pub p_value: f64,
    /// Gain of every frame: fall of its cost ½ Σ r² when the candidate is estimated from all other frames.
    pub gains: Vec<f64>,
    /// Expected size: root mean square over the observations of the effect that the score test predicts, without what fitted
    /// parameters take up of it, mm.
    pub expected_size_mm: f64,
    /// Size that these captures show with the power and at the level of [`super::Thresholds`], mm; NaN for free functions.
    pub minimal_detectable_mm: f64,
    /// The candidate at its expected parameters.
    pub block: Block,
    /// Number of the candidate in the linearisation.
    pub index: usize,
}

impl Evidence {
    /// Sum of the gains.
    pub fn gain(&self) -> f64 {
        self.gains.iter().sum()
    }

    /// Mean over standard error of the frames' gains.
    pub fn t(&self) -> f64 {
        mean_to_standard_error(&self.gains)
    }
}

/// Differences a − b of the gains of every frame.
pub(super) fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}
