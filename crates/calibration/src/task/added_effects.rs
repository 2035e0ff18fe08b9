//! Effects that a camera is given in addition to those of its calibration.

use depthcal_formula::values;
use depthcal_model::{Camera, Register};

use super::error::TaskError;

/// The camera with further effects from files of formulas, with the values that these have for their parameters; `option` is what
/// the user calls the list.
///
/// # Errors
///
/// [`TaskError::Option`] where an effect is unknown, has no values, or is a part of the camera already.
pub fn with_effects(
    mut camera: Camera,
    option: &str,
    effects: &[String],
    register: &Register,
) -> Result<Camera, TaskError> {
    for text in effects {
        let spec = register.piece_spec(text).map_err(|e| TaskError::option(option, text, e))?;
        let mut block = register.make(&spec, None).map_err(|e| TaskError::option(option, text, e))?;
        let Some(values) = block.piece().and_then(|piece| values(&**piece)) else {
            let remedy = "give a file of formulas with a value of every parameter, parameters = { a = { unit = \"mm\", value = 2 } }";
            let problem = format!("its parameters have no values: {remedy}");
            return Err(TaskError::option(option, text, problem));
        };
        if camera.block(&spec.name).is_some() {
            return Err(TaskError::option(option, text, format!("the calibration has '{}' already", spec.name)));
        }
        block.theta = values;
        camera = camera.with_block(block);
    }
    Ok(camera)
}
