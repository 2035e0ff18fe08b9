//! The merit of candidates, by which they are selected.

use depthcal_statistics::mean_to_standard_error;

use super::evidence::Evidence;
use super::examination::Examination;
use super::thresholds::Thresholds;

/// Merit of a candidate: its gain on held-out frames, but at most half its score statistic less its rank, which is the gain
/// that the statistic predicts. The gain is noisy where few frames carry it; the statistic assumes that residuals of a frame
/// are independent.
pub fn merit(evidence: &Evidence) -> f64 {
    evidence.gain().min(0.5 * evidence.score.statistic - evidence.score.rank as f64)
}

/// Merit of an effect for comparison with other effects: less a penalty per parameter as in the Bayesian information criterion
/// (Schwarz 1978) with frames as observations, so that of similar effects the simpler one wins.
pub(super) fn penalized_merit(examination: &Examination, effect: usize) -> f64 {
    let evidence = &examination.evidence[effect];
    let frames = examination.linearization.cluster_count().max(2) as f64;
    merit(evidence) - evidence.score.rank as f64 * (frames.ln() - 1.0)
}

/// Whether a candidate is significant: by its p-value, corrected for the number of `tests`, and by gains on more than one
/// frame.
pub(super) fn significant(p_value: f64, tests: usize, gains: &[f64], thresholds: &Thresholds) -> bool {
    p_value * (tests as f64) < thresholds.level
        && gains.iter().sum::<f64>() > 0.0
        && mean_to_standard_error(gains) > thresholds.least_gain_t
}
