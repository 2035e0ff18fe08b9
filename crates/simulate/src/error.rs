//! Errors of simulation.

use std::path::PathBuf;

/// Why a simulation cannot be carried out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// No effect has this name.
    #[error("unknown effect `{name}`; the catalogue has {catalogue}; beyond the catalogue there are {beyond}")]
    UnknownEffect {
        /// The requested name.
        name: String,
        /// Names of the catalogued effects, comma separated.
        catalogue: String,
        /// Names of the uncatalogued effects, comma separated.
        beyond: String,
    },
    /// The size of an effect is not a number.
    #[error("effect `{name}`: size `{size}` is not a finite number in {unit}; write {name}=SIZE or {name}")]
    BadEffectSize {
        /// The effect.
        name: String,
        /// The given size.
        size: String,
        /// The unit of its size.
        unit: &'static str,
    },
    /// The text gives an effect no place and form, or the effect has none.
    #[error(
        "effect `{text}`: only effects on depth can be placed; write NAME=SIZE@of=true@on=depth, with `measured` for `true` and \
         `factor` or `inverse_depth` for `depth` where wanted"
    )]
    NoPlace {
        /// The text.
        text: String,
    },
    /// The effect cannot reach the requested size.
    #[error("effect `{name}`: size {size} {unit} cannot be reached with this camera: {reason}")]
    EffectTooLarge {
        /// The effect.
        name: &'static str,
        /// The requested size.
        size: f64,
        /// The unit of the size.
        unit: &'static str,
        /// The limit that it violates.
        reason: &'static str,
    },
    /// The effect cannot be planted in measured depth images.
    #[error("effect `{name}` cannot be planted in a measured depth image: {reason}")]
    NotPlantable {
        /// The effect.
        name: &'static str,
        /// Why.
        reason: &'static str,
    },
    /// No dataset kind has this name.
    #[error("unknown dataset kind `{name}`; known are {known}")]
    UnknownKind {
        /// The requested name.
        name: String,
        /// The known kinds, comma separated.
        known: String,
    },
    /// There is no camera of this number.
    #[error("unknown camera {number}; the published cameras are 1, 2, 3 and 4")]
    UnknownCamera {
        /// The requested number.
        number: usize,
    },
    /// The board does not fit into the image at any distance of the dataset kind.
    #[error(
        "frame {frame}: the board does not fit into the {width}x{height} image at {distance_mm:.0} mm; use a smaller \
         board or a wider lens"
    )]
    BoardDoesNotFit {
        /// The frame.
        frame: usize,
        /// Image width, px.
        width: usize,
        /// Image height, px.
        height: usize,
        /// The last distance tried, mm.
        distance_mm: f64,
    },
    /// A parameter of the simulation is unusable.
    #[error("{field} = {value} is not usable: expected {expected}")]
    BadParameter {
        /// The parameter.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Description of usable values.
        expected: &'static str,
    },
    /// An array does not have the size of the image.
    #[error("{what} has {got} values, the {width}x{height} image needs {need}")]
    SizeMismatch {
        /// The array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The length that is needed.
        need: usize,
        /// Image width, px.
        width: usize,
        /// Image height, px.
        height: usize,
    },
    /// The folder for a dataset already contains frames.
    #[error("{}: already holds frames; choose an empty folder", path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// A file could not be written.
    #[error("{}: cannot write the file: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// A PNG could not be encoded.
    #[error("{}: cannot encode the image: {source}", path.display())]
    Png {
        /// The file.
        path: PathBuf,
        /// The encoder's error.
        source: png::EncodingError,
    },
}

/// Refuses the first parameter whose value is not finite or does not pass; `expected` says what would.
pub(crate) fn check(
    parameters: impl IntoIterator<Item = (&'static str, f64)>,
    expected: &'static str,
    passes: impl Fn(f64) -> bool,
) -> Result<(), SimulateError> {
    let refused = parameters.into_iter().find(|(_, value)| !(value.is_finite() && passes(*value)));
    refused.map_or(Ok(()), |(field, value)| Err(SimulateError::BadParameter { field, value, expected }))
}

/// Refuses the first parameter that is not above 0.
pub(crate) fn positive(parameters: impl IntoIterator<Item = (&'static str, f64)>) -> Result<(), SimulateError> {
    check(parameters, "a positive number", |value| value > 0.0)
}

/// Refuses the first parameter that is below 0.
pub(crate) fn not_negative(parameters: impl IntoIterator<Item = (&'static str, f64)>) -> Result<(), SimulateError> {
    check(parameters, "zero or a positive number", |value| value >= 0.0)
}
