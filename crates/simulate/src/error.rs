//! What can go wrong in a simulation.

use std::path::PathBuf;

/// Why a simulation could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// No effect has this name.
    #[error("unknown effect `{name}`; the catalogue has {catalogue}; beyond the catalogue there are {beyond}")]
    UnknownEffect {
        /// What was asked for.
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
        /// What was given as its size.
        size: String,
        /// The unit of its size.
        unit: &'static str,
    },
    /// The effect cannot be made as large as asked for.
    #[error("effect `{name}`: size {size} {unit} cannot be reached with this camera: {reason}")]
    EffectTooLarge {
        /// The effect.
        name: &'static str,
        /// The size that was asked for.
        size: f64,
        /// The unit of the size.
        unit: &'static str,
        /// What limits it.
        reason: &'static str,
    },
    /// The effect cannot be planted in depth images that were measured.
    #[error("effect `{name}` cannot be planted in a measured depth image: {reason}")]
    NotPlantable {
        /// The effect.
        name: &'static str,
        /// What it would need.
        reason: &'static str,
    },
    /// No dataset kind has this name.
    #[error("unknown dataset kind `{name}`; known are {known}")]
    UnknownKind {
        /// What was asked for.
        name: String,
        /// The known kinds, comma separated.
        known: String,
    },
    /// There is no camera of this number.
    #[error("unknown camera {number}; the published cameras are 1, 2, 3 and 4")]
    UnknownCamera {
        /// What was asked for.
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
        /// The distance that was tried last, mm.
        distance_mm: f64,
    },
    /// A number that describes the simulation makes no sense.
    #[error("{field} = {value} is not usable: {expected}")]
    BadParameter {
        /// Which one.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// An array does not have the size of the image.
    #[error("{what} has {got} values, the {width}x{height} image needs {need}")]
    SizeMismatch {
        /// Which array.
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
    /// The folder for a dataset has files in it that the dataset would be mixed with.
    #[error("{}: holds frames already; choose an empty folder", path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// A file could not be written.
    #[error("{}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A PNG could not be encoded.
    #[error("{}: {source}", path.display())]
    Png {
        /// The file.
        path: PathBuf,
        /// Why.
        source: png::EncodingError,
    },
}
