//! The ranking of models in sentences.

use depthcal_io::{ModelComparison, recommended};

/// The ranking of the listed models, best first, in sentences: first the one to use, with those that these frames cannot tell
/// from it.
pub(super) fn verdict(models: &[ModelComparison]) -> Vec<String> {
    let mut sentences = Vec::new();
    let Some((best, chosen)) = models.first().zip(recommended(models)) else {
        return vec!["No model could be fitted.".to_owned()];
    };
    let error = |m: &ModelComparison| m.held_out.dot_error_mm.or(m.held_out.depth_rms_mm);
    let ties: Vec<String> = models
        .iter()
        .filter(|m| m.failed.is_none() && !m.really_worse && m.model != chosen.model)
        .map(|m| format!("'{}'", m.model))
        .collect();
    let ties = match ties.is_empty() {
        true => String::new(),
        false => format!("; these frames cannot tell it from {}", ties.join(", ")),
    };
    if let Some(e) = error(chosen) {
        sentences.push(format!(
            "Use '{}': {:.2} mm ({:.2} to {:.2}) on data that it did not see{ties}.",
            chosen.model, e.mean, e.low, e.high
        ));
    }
    if best.model != chosen.model
        && let Some(e) = error(best)
    {
        sentences.push(format!(
            "'{}' has the smallest error, {:.2} mm, but {:.1} effective parameters instead of {:.1}.",
            best.model, e.mean, best.effective_parameters, chosen.effective_parameters
        ));
    }
    let worse: Vec<String> = models
        .iter()
        .filter(|m| m.really_worse)
        .filter_map(|m| {
            m.worse_than_best_mm.map(|d| format!("'{}' by {:.2} mm ({:.2} to {:.2})", m.model, d.mean, d.low, d.high))
        })
        .collect();
    if !worse.is_empty() {
        sentences.push(format!("Really worse than the best: {}.", worse.join("; ")));
    }
    for model in models {
        if let Some(reason) = &model.failed {
            sentences.push(format!("'{}' could not be fitted: {reason}.", model.model));
        }
    }
    sentences
}
