//! Errors of detection and refinement.

/// Why an image could not be searched for a board, or why markers could not be refined. A board that is not in the
/// image is no error: [`detect`](crate::detect()) then returns `None`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DetectError {
    /// The number of the image's values is not its width times its height.
    #[error("the image claims {width} x {height} px but holds {got} values; read it again or repair its file")]
    ImageSize {
        /// Width in px.
        width: usize,
        /// Height in px.
        height: usize,
        /// Number of values.
        got: usize,
    },
    /// The board has too few markers to be found unambiguously.
    #[error(
        "a {kind} board of {columns} x {rows} is too small: need at least {need}; check board.columns and board.rows"
    )]
    BoardTooSmall {
        /// Kind of board, as in `dataset.toml`.
        kind: &'static str,
        /// Columns.
        columns: usize,
        /// Rows.
        rows: usize,
        /// The smallest usable board, such as `3 x 3 inner corners`.
        need: &'static str,
    },
    /// A length is not usable.
    #[error("{field} = {value}: {remedy}")]
    Field {
        /// The field, as in `dataset.toml`.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Constraint that the value violates.
        remedy: &'static str,
    },
    /// No ArUco dictionary has this name.
    #[error("board.dictionary = {name:?} is no dictionary; use one like \"DICT_5X5_100\"")]
    UnknownDictionary {
        /// The name.
        name: String,
    },
    /// The dictionary has fewer markers than the board.
    #[error(
        "the board has {need} tags but {dictionary} only {got}; check board.columns, board.rows and board.dictionary"
    )]
    DictionaryTooSmall {
        /// Name of the dictionary.
        dictionary: String,
        /// Tags on the board.
        need: usize,
        /// Tags in the dictionary.
        got: usize,
    },
    /// A detector was asked for that this program was built without.
    #[error(
        "the program was built without OpenCV; build it with the feature `{feature}`, or use the built-in detector"
    )]
    MissingFeature {
        /// The missing feature of this crate.
        feature: &'static str,
    },
    /// The OpenCV that the program was built with lacks a module.
    #[error("{module} is not in the OpenCV {version} that this program was built with; {remedy}")]
    MissingModule {
        /// The missing module, by its function.
        module: &'static str,
        /// Version of OpenCV.
        version: &'static str,
        /// How to get it.
        remedy: &'static str,
    },
    /// The board has no markers of the kind to be refined.
    #[error("a {kind} board has no {markers} to refine; choose a board that has them or leave the refinement out")]
    WrongKind {
        /// Kind of board.
        kind: &'static str,
        /// The markers that were to be refined.
        markers: &'static str,
    },
    /// A marker's index is not on the board.
    #[error("marker {index} is not on the board, which has {len}; detect with the same board that is refined")]
    MarkerIndex {
        /// The index.
        index: usize,
        /// Number of markers of the board.
        len: usize,
    },
    /// OpenCV failed.
    #[error("OpenCV failed in {operation}: {source}")]
    OpenCv {
        /// OpenCV's function.
        operation: &'static str,
        /// OpenCV's error.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}
