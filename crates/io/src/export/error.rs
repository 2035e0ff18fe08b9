//! Errors of exports.

/// Why a camera cannot be exported.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The calibration has no pinhole, or the pinhole lacks a parameter.
    #[error("the calibration has no parameter `pinhole.{parameter}`: export needs a pinhole camera; calibrate anew")]
    NoPinhole {
        /// The parameter that is missing.
        parameter: &'static str,
    },
    /// A number that is not finite, or a size or focal length that is not positive.
    #[error("the camera's `{field}` is {value}: export needs finite numbers, and a size and focal lengths above 0")]
    Value {
        /// The field.
        field: String,
        /// Its value.
        value: f64,
    },
    /// An unknown format.
    #[error("unknown format \"{name}\": use opencv, ros, kalibr or mrcal")]
    UnknownFormat {
        /// The name that was given.
        name: String,
    },
}
