//! Names of effects and free functions in words.

use depthcal_model::Register;

/// The meaning of a parameter of a piece; `None` where the register does not know it. Nodes of fields, `a[3,4]`, have the
/// meaning of their field.
pub(super) fn meaning(register: &Register, piece: &str, parameter: &str) -> Option<&'static str> {
    let field = |name: &str| name.split('[').next().map(str::to_owned);
    let piece = register.find(piece)?;
    let parameter = piece.parameters().iter().find(|p| field(&p.name) == field(parameter))?;
    (!parameter.meaning.is_empty()).then_some(parameter.meaning)
}

/// What an effect is, in plain words that follow a name and a colon.
pub(super) fn summary(register: &Register, effect: &str) -> &'static str {
    register.find(effect).map(|piece| piece.summary()).filter(|s| !s.is_empty()).unwrap_or("an effect of your own")
}

/// The quantity that a free function of the diagnosis depends on.
pub(super) fn free_function(name: &str) -> &str {
    match name {
        "map" | "free_map" => "the position in the image",
        "map of depth" => "the position in the image (in depth)",
        "columns" => "the image column",
        "rows" => "the image row",
        "board" => "the position on the board",
        "depth" => "the distance",
        "amplitude" => "the infrared amplitude",
        "incidence" => "the angle of incidence",
        "time" => "the time",
        "temperature" => "the temperature",
        other => other,
    }
}
