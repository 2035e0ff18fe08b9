//! Sentences that a reader of a fit has to know before its numbers.

use depthcal_calibration::calibrate::CalibratedCamera;
use depthcal_calibration::camera_record::declarations;

use crate::diagnosis::sentences::declaration;
use crate::prior::prior_sentences;

/// Declarations that cannot be right, frames whose depth is another frame's, and what the prior did, in sentences; none where
/// there is nothing to say.
pub fn fit_sentences(result: &CalibratedCamera) -> Vec<String> {
    let mut sentences: Vec<String> =
        declarations(result).iter().map(|found| format!("Check the dataset file: {}.", declaration(found))).collect();
    if !result.foreign_depth.is_empty() {
        let names: Vec<&str> = result.foreign_depth.iter().map(|f| f.name.as_str()).collect();
        sentences.push(format!(
            "Left out, because their depth does not belong to their images: {}. Check whether depth images were exchanged, and whether all frames \
             show the same board.",
            names.join(", ")
        ));
    }
    sentences.extend(prior_sentences(result));
    sentences
}
