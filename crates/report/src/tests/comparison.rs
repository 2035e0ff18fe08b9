//! The report of a comparison.

use depthcal_io::{Comparison, Errors, Interval, LearningPoint, ModelComparison};

use super::super::Made;
use super::super::comparison::render_comparison;
use super::figure_ids;
use super::fixture::Fixture;
use depthcal_calibration::compare::tables::tables;

fn model(name: &str, error: f64) -> ModelComparison {
    let interval = |mean: f64| Some(Interval { mean, low: 0.9 * mean, high: 1.2 * mean });
    ModelComparison {
        model: name.parse().unwrap(),
        parameters: 13,
        effective_parameters: 12.5,
        held_out: Errors {
            dot_error_mm: interval(error),
            plane_error_mm: interval(2.0 * error),
            depth_rms_mm: interval(3.0 * error),
        },
        worse_than_best_mm: interval(error - 2.0),
        really_worse: error > 4.0,
        ..ModelComparison::default()
    }
}

/// Three models, one of which has no fit, and a learning curve.
pub(super) fn page() -> String {
    let point = |model: &str, frames: usize, error: f64| LearningPoint {
        model: model.parse().unwrap(),
        frames,
        fits: 3,
        failed: 0,
        reasons: Vec::new(),
        held_out: Errors { dot_error_mm: Some(error), plane_error_mm: None, depth_rms_mm: Some(error) },
    };
    let failed = ModelComparison {
        model: "bspline".parse().unwrap(),
        failed: Some("<too> few frames".to_owned()),
        ..ModelComparison::default()
    };
    let comparison = Comparison {
        train: "general1".to_owned(),
        verify: vec!["general2".to_owned()],
        models: vec![model("projective", 2.0), model("none", 9.0), failed],
        verdict: vec!["'projective' has the smallest error.".to_owned(), "Really worse: 'none'.".to_owned()],
        learning_curve: vec![
            point("projective", 4, 4.0),
            point("projective", 12, 2.5),
            point("none", 4, 12.0),
            point("none", 12, 9.0),
            LearningPoint { failed: 1, reasons: vec!["a map <folds>".to_owned()], ..point("multiplier", 4, 7.0) },
        ],
        ..Comparison::default()
    };
    let best = Fixture::simulated(&[]).calibrated;
    render_comparison(
        &comparison,
        &tables(&comparison),
        Some(&best),
        &depthcal_model::Register::builtin(),
        &Made { command_line: "depthcal compare captures".to_owned(), ..Made::default() },
    )
    .unwrap()
}

#[test]
fn a_comparison_has_ranking_learning_curve_and_the_winners_map() {
    let html = page();
    assert_eq!(figure_ids(&html), ["ranking", "learning-curve", "correction-map", "beyond-plane"]);
    assert!(html.contains("id=\"verdict-sentence\">&#39;projective&#39; has the smallest error."));
    assert!(html.contains("significantly worse") && html.contains("no fit: &lt;too&gt; few frames"));
    assert!(html.contains("Evaluated on general2."));
}
