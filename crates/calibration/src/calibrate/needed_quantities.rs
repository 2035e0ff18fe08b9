//! Whether frames have the quantities that the effects of a model depend on.

use depthcal_model::{Covariate, Quantities, Quantity};
use tracing::warn;

use super::camera_options::CameraOptions;
use super::error::CalibrateError;
use crate::observe::CameraFrames;

/// Refuses effects of quantities that no frame has, and warns of frames that lack one.
pub(super) fn check_quantities(capture: &CameraFrames, options: &CameraOptions) -> Result<(), CalibrateError> {
    let known = Quantities::names_of(capture.frames.iter().map(|frame| &frame.quantities));
    for effect in &options.effects {
        let block = options.register.make(effect, None)?;
        let needs = block.piece().map(|piece| piece.needs()).unwrap_or_default();
        for quantity in needs.iter().filter_map(quantity) {
            if !known.contains(&quantity) {
                return Err(CalibrateError::UnknownQuantity {
                    effect: effect.name.clone(),
                    column: quantity.name().to_owned(),
                    dataset: capture.name.clone(),
                    known: in_words(known.iter().copied()),
                });
            }
            let lacking = capture.frames.iter().filter(|frame| frame.quantities.value(quantity).is_nan());
            let names: Vec<&str> = lacking.map(|frame| frame.name.as_str()).collect();
            if let Some(first) = names.first() {
                warn!(
                    "{} of {} frames of {} have no {} (the first is {first}): {} does nothing there",
                    names.len(),
                    capture.frames.len(),
                    capture.name,
                    quantity.name(),
                    effect.name
                );
            }
        }
    }
    Ok(())
}

fn quantity(covariate: &Covariate) -> Option<Quantity> {
    match covariate {
        Covariate::Quantity(quantity) => Some(*quantity),
        _ => None,
    }
}

fn in_words(known: impl Iterator<Item = Quantity>) -> String {
    let names: Vec<&str> = known.map(Quantity::name).collect();
    match names.is_empty() {
        true => "which has no column whose name ends in a unit".to_owned(),
        false => format!("or write one of {}", names.join(", ")),
    }
}
