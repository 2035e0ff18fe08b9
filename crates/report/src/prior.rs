//! The influence of a prior on a fit, in words.

use depthcal_calibration::calibrate::CalibratedCamera;
use depthcal_calibration::camera_record::prior_use;

use crate::format::{count, number, p_equals, percent};

/// p-value below which a camera is said to be unlike the units of its prior.
const UNLIKE_THE_OTHERS: f64 = 0.001;

/// The influence of the prior on a fit, in sentences; none without a prior.
pub fn prior_sentences(result: &CalibratedCamera) -> Vec<String> {
    let Some(prior) = &result.prior else { return Vec::new() };
    let Some(used) = prior_use(result) else {
        return vec!["The prior concerns no parameter of this model: it was not used.".to_owned()];
    };
    let mut sentences = vec![format!(
        "A prior from {} was used for {}. In its terms this camera is {} standard deviations from the mean of the others in all ({}).",
        count(used.units, "unit"),
        count(used.parameters.len(), "parameter"),
        number(used.distance_squared.sqrt()),
        p_equals(used.p_value)
    )];
    if used.p_value < UNLIKE_THE_OTHERS {
        sentences.push(
            "This camera is not like the others: calibrate it with more frames and without the prior, and compare."
                .to_owned(),
        );
    }
    let unused: Vec<&str> = prior
        .names
        .iter()
        .filter(|name| used.parameters.iter().all(|p| p.name != **name))
        .map(String::as_str)
        .collect();
    if !unused.is_empty() {
        sentences.push(format!("The prior also names {}, which are not fitted here.", unused.join(", ")));
    }
    let shares: Vec<String> =
        used.parameters.iter().map(|p| format!("{} {}", p.name, percent(100.0 * p.own_share))).collect();
    sentences.push(format!("Information from this camera's own frames: {}.", shares.join(", ")));
    sentences
}
