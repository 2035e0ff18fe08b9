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
    /// The file is no text.
    #[error("{}: is binary, not text: {remedy}", path.display())]
    Binary {
        /// The file.
        path: PathBuf,
        /// How it becomes text.
        remedy: &'static str,
    },
    /// The text is none of the formats.
    #[error("{}: is none of the camera files that are read, it has {}: {hint}", path.display(), shown_keys(keys))]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// Its keys.
        keys: Vec<String>,
        /// The remedy.
        hint: &'static str,
    },
    /// A camera matrix, or focal lengths, without a lens that is known.
    #[error(
        "{}: no lens is recognised beside `{pinhole}`, only {}: call the coefficients `distortion_coefficients`, or write \
         `distortion_coefficients: [0, 0, 0, 0, 0]` for a camera without distortion",
        path.display(),
        shown_keys(keys)
    )]
    NoLens {
        /// The file.
        path: PathBuf,
        /// The field of the matrix or of a focal length.
        pinhole: String,
        /// The other keys of the mapping.
        keys: Vec<String>,
    },
    /// The text is no valid YAML, JSON or XML.
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
    #[error("{}: has several cameras: write {}#NAME with one of {}", path.display(), path.display(), some(cameras))]
    SeveralCameras {
        /// The file.
        path: PathBuf,
        /// Their names.
        cameras: Vec<String>,
    },
    /// There is no camera of the name that was given.
    #[error("{}: has no camera '{name}', but {}", path.display(), some(cameras))]
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
    #[error("unknown format \"{name}\": use one of {known}")]
    UnknownFormat {
        /// Names of the formats.
        known: String,
        /// The name that was given.
        name: String,
    },
}

/// Most names that an error lists.
const LISTED: usize = 12;

/// Names for an error, the first of many.
fn some(names: &[String]) -> String {
    let more = names.len().saturating_sub(LISTED);
    let shown = |name: &String| if name.is_empty() { "one without a name (leave #NAME out)" } else { name }.to_owned();
    let shown = names[..names.len() - more].iter().map(shown).collect::<Vec<_>>().join(", ");
    if more > 0 { format!("{shown} and {more} more") } else { shown }
}

/// Keys for an error.
fn shown_keys(keys: &[String]) -> String {
    if keys.is_empty() { "no keys".to_owned() } else { format!("the keys {}", some(keys)) }
}
