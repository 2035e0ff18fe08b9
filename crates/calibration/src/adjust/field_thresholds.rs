//! Thresholds of the rules that choose the smoothness of fields.

/// Thresholds of the smoothness prior of fields and of the search for its strength. Roughness and ridge are standard deviations
/// in units of a parameter's typical deviation ([`depthcal_model::Parameter::scale`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldThresholds {
    /// Roughness at the start of the search (0.3). Guards against a first adjustment that the prior does not determine, or
    /// that it keeps flat where the data have structure.
    pub first_roughness: f64,
    /// Ridge of a field without the projective depth model D (10). Guards against undetermined parameters; weak, because the
    /// field alone has to take up everything.
    pub ridge_alone: f64,
    /// Ridge of a field that is fitted jointly with D, where the search starts (3). Assigns to D, which is not penalised,
    /// whatever both could describe.
    pub ridge_with_projective: f64,
    /// Largest |ln| of the ratio of two roughnesses that count as equal (0.3, about a third). Guards against further
    /// adjustments for changes on which the errors of a fit hardly depend.
    pub settled_log_ratio: f64,
    /// Range of the search (1e-4 to 10): from a flat field to one that the prior does not constrain. Guards against systems of
    /// equations too badly scaled to solve.
    pub roughness_range: [f64; 2],
    /// Most cross-validation folds (10); with fewer frames than this each frame is a fold. Guards against a search whose time
    /// grows with the number of frames.
    pub most_folds: usize,
    /// Wilcoxon signed-rank statistic, in standard deviations, by which held-out frames must prefer the rough field to the flat
    /// one (2.5; fewer than eight frames cannot reach it). Guards against a few frames with errors of their own, which
    /// dominate a sum of squares.
    pub least_signed_rank: f64,
    /// Standard errors of the difference in held-out cost within which a smoother field predicts as well (1: the
    /// one-standard-error rule). Guards against roughness that the frames do not support.
    pub equal_standard_errors: f64,
}

impl Default for FieldThresholds {
    fn default() -> Self {
        Self {
            first_roughness: 0.3,
            ridge_alone: 10.0,
            ridge_with_projective: 3.0,
            settled_log_ratio: 0.3,
            roughness_range: [1e-4, 10.0],
            most_folds: 10,
            least_signed_rank: 2.5,
            equal_standard_errors: 1.0,
        }
    }
}
