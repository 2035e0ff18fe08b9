//! Models, effects and free functions in words.

use depthcal_calibration::calibrate::CalibratedCamera;
use depthcal_model::Register;

/// The depth model of a calibration in words: its pieces with the constants that they were given.
pub(super) fn model_words(c: &CalibratedCamera) -> String {
    let piece = |name: &str| c.camera.blocks().iter().find(|block| block.name() == name)?.piece();
    let words = c.model.pieces.iter().map(|spec| spec.words(piece(&spec.name).map(|piece| piece.as_ref())));
    let words: Vec<String> = words.collect();
    if words.is_empty() { c.model.to_string() } else { words.join(" + ") }
}

/// The meaning of a parameter of a piece; `None` where the register does not know it. Nodes of fields, `a[3,4]`, have the
/// meaning of their field.
pub(super) fn meaning(register: &Register, piece: &str, parameter: &str) -> Option<&'static str> {
    let field = |name: &str| name.split('[').next().map(str::to_owned);
    let piece = register.find(piece)?;
    let parameter = piece.parameters().iter().find(|p| field(&p.name) == field(parameter))?;
    (!parameter.meaning.is_empty()).then_some(parameter.meaning)
}

/// Description of an effect in plain words that follow a name and a colon.
pub(super) fn summary(register: &Register, effect: &str) -> &'static str {
    register.find(effect).map(|piece| piece.summary()).filter(|s| !s.is_empty()).unwrap_or("an effect of your own")
}
