//! Errors of reading and writing cameras.

use std::path::PathBuf;

/// Why a camera cannot be read from a file of another program.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraFileError {
    /// The file cannot be read.
    #[error("cannot read {}: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's words.
        reason: String,
    },
    /// The text is none of the formats.
    #[error(
        "{}: is none of the formats that are read: OpenCV's YAML, ROS camera_info, Kalibr's camchain, mrcal's .cameramodel, COLMAP's \
         cameras.txt",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The text is no valid YAML.
    #[error("{}: {reason}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line and fault.
        reason: String,
    },
    /// A field is missing or has a wrong value.
    #[error("{}: `{field}` {problem}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The field.
        field: String,
        /// The fault, and what is expected.
        problem: String,
    },
    /// A model that is not known here.
    #[error("{}: the camera model {model} is not supported; {known} are", path.display())]
    Model {
        /// The file.
        path: PathBuf,
        /// The model.
        model: String,
        /// Models of this format that are read.
        known: &'static str,
    },
    /// Several cameras, none of which was named.
    #[error("{}: has several cameras: write {}#NAME with one of {}", path.display(), path.display(), cameras.join(", "))]
    SeveralCameras {
        /// The file.
        path: PathBuf,
        /// Their names.
        cameras: Vec<String>,
    },
    /// There is no camera of the name that was given.
    #[error("{}: has no camera '{name}', but {}", path.display(), cameras.join(", "))]
    NoSuchCamera {
        /// The file.
        path: PathBuf,
        /// The name given.
        name: String,
        /// Names of its cameras.
        cameras: Vec<String>,
    },
}

/// Why a camera cannot be exported.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A number that is not finite, or a size or focal length that is not positive.
    #[error("the camera's `{field}` is {value}: export needs finite numbers, and a size and focal lengths above 0")]
    Value {
        /// The field.
        field: String,
        /// Its value.
        value: f64,
    },
    /// An unknown format.
    #[error("unknown format \"{name}\": use opencv, ros, kalibr, mrcal or colmap")]
    UnknownFormat {
        /// The name that was given.
        name: String,
    },
}
