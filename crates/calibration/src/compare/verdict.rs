//! The ranking of models in sentences.

use depthcal_io::ModelComparison;

/// The ranking of the listed models, best first, in sentences.
pub(super) fn verdict(models: &[ModelComparison]) -> Vec<String> {
    let mut sentences = Vec::new();
    let Some(best) = models.first().filter(|m| m.failed.is_none()) else {
        return vec!["No model could be fitted.".to_owned()];
    };
    let error = |m: &ModelComparison| m.held_out.dot_error_mm.or(m.held_out.depth_rms_mm);
    if let Some(e) = error(best) {
        sentences.push(format!(
            "'{}' has the smallest error on data that it did not see: {:.2} mm ({:.2} to {:.2}).",
            best.model, e.mean, e.low, e.high
        ));
    }
    let equal: Vec<&ModelComparison> = models.iter().filter(|m| m.failed.is_none() && !m.really_worse).collect();
    if equal.len() > 1 {
        let names: Vec<String> = equal.iter().map(|m| format!("'{}'", m.model)).collect();
        sentences.push(format!("These frames cannot tell apart: {}.", names.join(", ")));
    }
    // Effective numbers within one parameter of the least count as equal; among these the model with the fewest parameters.
    let least = equal.iter().map(|m| m.effective_parameters).fold(f64::INFINITY, f64::min);
    let simplest = equal.iter().filter(|m| m.effective_parameters < least + 1.0).min_by_key(|m| m.parameters);
    if let Some(simplest) = simplest {
        sentences.push(format!(
            "The simplest of them is '{}' with {:.1} effective parameters; use it unless another reason speaks for more.",
            simplest.model, simplest.effective_parameters
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
