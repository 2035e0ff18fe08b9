//! What can go wrong.

/// Why a board could not be looked for, or why its markers could not be refined. A board that is not in the image is
/// no error: [`detect`](crate::detect) then returns `None`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DetectError {
    /// The image's data do not have the size that its header says.
    #[error("the image claims {width} x {height} px but holds {got} values; read it again or repair its file")]
    ImageSize {
        /// Width in px.
        width: usize,
        /// Height in px.
        height: usize,
        /// Number of values.
        got: usize,
    },
    /// The board has too few markers to be found without doubt.
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
        /// The smallest board, in words.
        need: &'static str,
    },
    /// A length or an option is not usable.
    #[error("{field} = {value}: {remedy}")]
    Field {
        /// The field, as in `dataset.toml`.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        remedy: &'static str,
    },
    /// No ArUco dictionary has this name.
    #[error("board.dictionary = {name:?} is not a dictionary of OpenCV; use one like \"DICT_5X5_100\"")]
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
    /// The OpenCV that the program was built with lacks something.
    #[error("{feature} is not in the OpenCV {version} that this program was built with; {remedy}")]
    MissingFeature {
        /// What is missing.
        feature: &'static str,
        /// Version of OpenCV.
        version: &'static str,
        /// How to get it.
        remedy: &'static str,
    },
    /// A refinement was asked for a board that has no such markers.
    #[error("a {kind} board has no {markers} to refine; choose a board that has them or leave the refinement out")]
    WrongKind {
        /// Kind of board.
        kind: &'static str,
        /// What would have been refined.
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
        /// What was being done.
        operation: &'static str,
        /// OpenCV's message.
        source: opencv::Error,
    },
}

/// Names the operation in which OpenCV failed.
pub(crate) trait Context<T> {
    fn context(self, operation: &'static str) -> Result<T, DetectError>;
}

impl<T> Context<T> for Result<T, opencv::Error> {
    fn context(self, operation: &'static str) -> Result<T, DetectError> {
        self.map_err(|source| DetectError::OpenCv { operation, source })
    }
}
