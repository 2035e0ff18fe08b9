use std::borrow::Cow;

/// A fitted number of a piece.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Short name, unique within the piece.
    pub name: Cow<'static, str>,
    /// Unit; `1` for none.
    pub unit: &'static str,
    /// Value at which the piece does nothing, or a neutral start where there is no such value.
    pub nominal: f64,
    /// Typical deviation from nominal, for plots and numerical differences.
    pub scale: f64,
    /// Meaning for a person with a camera and a board, as a sentence; empty where none is given.
    pub meaning: &'static str,
}

impl Parameter {
    /// A parameter from its name, unit, nominal value and typical deviation.
    pub const fn new(name: &'static str, unit: &'static str, nominal: f64, scale: f64) -> Self {
        Self { name: Cow::Borrowed(name), unit, nominal, scale, meaning: "" }
    }

    /// Sets its meaning, one sentence with a full stop.
    #[must_use]
    pub const fn meaning(mut self, meaning: &'static str) -> Self {
        self.meaning = meaning;
        self
    }
}
