//! Errors of datasets.

use std::io;
use std::path::PathBuf;

use super::suggest::listed;

/// Why a dataset cannot be used. Every message names the file, the field and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// The folder has no `dataset.toml`, or there is no folder.
    #[error(
        "{path}: there is no such file: a dataset is a folder with a dataset.toml that declares [board], [frames] and \
         [depth]"
    )]
    NoDatasetFile {
        /// The file that was looked for.
        path: PathBuf,
    },
    /// The file declares several cameras where one is asked for.
    #[error(
        "{path}: this dataset has several cameras in sections [cameras.NAME], but this command works on one: give a dataset.toml that \
         declares that camera alone"
    )]
    SeveralCameras {
        /// The file.
        path: PathBuf,
    },
    /// A file or folder cannot be read.
    #[error("{path}: cannot read: {error}")]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The operating system's error.
        error: io::Error,
    },
    /// `dataset.toml` is not TOML.
    #[error("{path}:{line}: this is not TOML: {message}")]
    Toml {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The parser's message.
        message: String,
    },
    /// A key that its section does not have.
    #[error("{path}:{line}: unknown key `{key}`{}", match .suggestion {
        Some(known) => format!(": did you mean `{known}`?"),
        None => format!(": known here are {}; remove or rename it", listed(.known)),
    })]
    UnknownKey {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The key with its section, such as `board.colums`.
        key: String,
        /// The nearest known key with its section.
        suggestion: Option<String>,
        /// All keys that are known in the section.
        known: &'static [&'static str],
    },
    /// An unknown kind of board.
    #[error("{path}:{line}: unknown `board.kind` \"{kind}\": {}", match .suggestion {
        Some(known) => format!("did you mean \"{known}\"?"),
        None => format!("use one of {}", listed(.known)),
    })]
    UnknownKind {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The kind that was given.
        kind: String,
        /// The nearest known kind.
        suggestion: Option<&'static str>,
        /// All known kinds.
        known: &'static [&'static str],
    },
    /// A required field is absent.
    #[error("{path}: `{field}` is missing: {remedy}")]
    MissingField {
        /// The file.
        path: PathBuf,
        /// The field with its section.
        field: String,
        /// The remedy: what to write.
        remedy: &'static str,
    },
    /// A field of the wrong type, or out of its range.
    #[error("{path}:{line}: `{field}` = {value} {problem}: {remedy}")]
    Field {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The field with its section.
        field: String,
        /// The value as written.
        value: String,
        /// The problem, as a predicate: `is not a number`.
        problem: String,
        /// The remedy: what to write.
        remedy: &'static str,
    },
    /// A glob with wrong syntax.
    #[error("{path}: `{field}` = \"{pattern}\" is not a glob: {message}; write for example \"image/*.png\"")]
    Glob {
        /// The file.
        path: PathBuf,
        /// The field with its section.
        field: String,
        /// The glob.
        pattern: String,
        /// The glob parser's message.
        message: String,
    },
    /// A glob that matches no file.
    #[error(
        "{path}: `{field}` = \"{pattern}\" matches no file: {}",
        match .in_other_case {
            Some(file) => format!("{file} would match but for upper and lower case, which count: write the glob as the files are written"),
            None if .pattern.contains('\\') => format!("write / between folders, \"{}\"", .pattern.replace('\\', "/")),
            None => "give a glob relative to the folder of dataset.toml, such as \"image/*.png\"".to_owned(),
        }
    )]
    NoMatch {
        /// The file.
        path: PathBuf,
        /// The field with its section.
        field: String,
        /// The glob.
        pattern: String,
        /// A file that matches where upper and lower case do not count.
        in_other_case: Option<String>,
    },
    /// Two files of one kind with the same stem.
    #[error(
        "{path}: `{field}` matches both {first} and {second}, which have the same stem: move or rename one of them"
    )]
    DuplicateStem {
        /// The file.
        path: PathBuf,
        /// The field with its section.
        field: String,
        /// One file.
        first: PathBuf,
        /// The other file.
        second: PathBuf,
    },
    /// No image has a depth image.
    #[error(
        "{path}: no image pairs with any depth image:{}{}: give both files of a frame the same stem or number, name them in a table \
         with columns image and depth, or set `frames.within_s` where the names are times",
        unpaired(.images_without_depth, "images without depth"),
        unpaired(.depth_without_image, "depth without image")
    )]
    Unpaired {
        /// The file.
        path: PathBuf,
        /// Stems of images that have no depth image.
        images_without_depth: Vec<String>,
        /// Stems of depth images that have no image.
        depth_without_image: Vec<String>,
    },
    /// An image that is its own depth.
    #[error(
        "{path}: `{field}` finds {file} as image and as depth: give two globs that tell them apart, such as image = \"*_ir.png\" and depth = \
         \"*_depth.png\"; only an NPZ holds both, as the arrays `image` and `depth`"
    )]
    ImageIsDepth {
        /// The file `dataset.toml`.
        path: PathBuf,
        /// The section with both globs.
        field: String,
        /// A file that both find.
        file: PathBuf,
    },
    /// A file without a time where frames are paired by time.
    #[error(
        "{path}: `frames.within_s` pairs by time, but {file} has none in its name: list files and times in a text file, such as image = \
         \"rgb.txt\", or leave within_s out"
    )]
    NoTime {
        /// The file `dataset.toml`.
        path: PathBuf,
        /// The file without a time.
        file: PathBuf,
    },
    /// The table of frames is not valid CSV, or its header is wrong.
    #[error("{path}:{line}: {problem}")]
    Table {
        /// The table.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// The problem and its remedy.
        problem: String,
    },
    /// A cell that holds no finite number where one is required.
    #[error(
        "{path}:{line}: column `{column}` holds \"{value}\": write a finite number, or leave the cell empty where it \
         is not known"
    )]
    Cell {
        /// The table.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// Text of the cell.
        value: String,
    },
    /// A path that leads out of the dataset's folder.
    #[error(
        "{path}:{line}: {given} lies outside of the dataset's folder, where no file is read: move or copy the files there, or put a symbolic \
         link to their folder there"
    )]
    Outside {
        /// The table or list that names it.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// The path as written.
        given: String,
    },
    /// No row of the table belongs to a frame.
    #[error(
        "{path}: no row belongs to a frame:{}{}: write one row per frame, named by its file stem",
        unpaired(.rows_without_frame, "rows without a frame"),
        unpaired(.frames_without_row, "frames without a row")
    )]
    Rows {
        /// The table.
        path: PathBuf,
        /// Names in the table that are no frame.
        rows_without_frame: Vec<String>,
        /// Frames that have no row.
        frames_without_row: Vec<String>,
    },
}

fn unpaired(names: &[String], what: &str) -> String {
    if names.is_empty() { String::new() } else { format!(" {} {what} ({})", names.len(), listed(names)) }
}
