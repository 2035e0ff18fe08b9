//! A board in `dataset.toml`.

use depthcal_model::{Pattern, Target};

use super::error::DatasetError;
use super::section::{Field, Section};
use super::suggest::nearest;

const KINDS: &[&str] = &["asymmetric-circles", "symmetric-circles", "chessboard", "charuco", "aprilgrid"];
/// Keys of `[board]`.
pub(super) const BOARD_KEYS: &[&str] =
    &["kind", "columns", "rows", "spacing_mm", "circle_diameter_mm", "marker_mm", "dictionary", "first_tag"];

const KIND: Field = Field {
    key: "kind",
    remedy: "write \"asymmetric-circles\", \"symmetric-circles\", \"chessboard\", \"charuco\" or \"aprilgrid\"",
};
const COLUMNS: Field = Field {
    key: "columns",
    remedy: "give the number of markers in a row (chessboard: inner corners, charuco: squares, aprilgrid: tags)",
};
const ROWS: Field = Field {
    key: "rows",
    remedy: "give the number of rows of markers (chessboard: inner corners, charuco: squares, aprilgrid: tags)",
};
const SPACING: Field = Field {
    key: "spacing_mm",
    remedy: "give the grid spacing in mm (asymmetric circles: the distance between neighbouring rows)",
};
const CIRCLE: Field = Field {
    key: "circle_diameter_mm",
    remedy: "give the diameter of a printed dot in mm, or leave it out: then it is measured in the images",
};
const MARKER: Field = Field {
    key: "marker_mm",
    remedy: "give the side of a marker, over its black border, in mm; it is smaller than spacing_mm",
};
const DICTIONARY: Field =
    Field { key: "dictionary", remedy: "give OpenCV's name of the dictionary, such as \"DICT_5X5_100\"" };

/// The board that a section declares.
///
/// # Errors
/// [`DatasetError`] with the line, the field and the remedy.
pub(super) fn board_from(board: &Section<'_>) -> Result<Target, DatasetError> {
    let kind = match board.string(KIND)? {
        Some(kind) => kind,
        None => return Err(board.missing(KIND)),
    };
    if !KINDS.contains(&kind) {
        return Err(DatasetError::UnknownKind {
            path: board.source.path.to_owned(),
            line: board.source.line(board.required(KIND)?.span().start),
            kind: kind.to_owned(),
            suggestion: nearest(kind, KINDS.iter().copied()),
            known: KINDS,
        });
    }
    let columns = board.count(COLUMNS, smallest(kind)..=1000)?;
    let rows = board.count(ROWS, smallest(kind)..=1000)?;
    // From microscope slides to painted walls. A spacing given in metres falls below.
    let spacing_mm = board.positive(SPACING, 0.1..=10_000.0)?;
    let length_below = |field: Field, limit: f64, what: &str| {
        let length = board.positive(field, 0.01..=10_000.0)?;
        if length < limit {
            Ok(length)
        } else {
            let problem = format!("is not smaller than {what}, {limit} mm");
            Err(board.fault(board.required(field)?, field, problem))
        }
    };
    // Without a declaration the diameter is measured in the images.
    let diameter_below = |limit: f64| match board.get(CIRCLE) {
        Some(_) => length_below(CIRCLE, limit, "the distance of neighbouring dots"),
        None => Ok(0.0),
    };
    let (pattern, used): (_, &[&str]) = match kind {
        "asymmetric-circles" => {
            // The nearest dot lies one spacing to the side and one down.
            let limit = spacing_mm * std::f64::consts::SQRT_2;
            let circle_diameter_mm = diameter_below(limit)?;
            (Pattern::AsymmetricCircles { circle_diameter_mm }, &["circle_diameter_mm"])
        }
        "symmetric-circles" => {
            let circle_diameter_mm = diameter_below(spacing_mm)?;
            (Pattern::SymmetricCircles { circle_diameter_mm }, &["circle_diameter_mm"])
        }
        "charuco" => {
            let marker_mm = length_below(MARKER, spacing_mm, "the square")?;
            let dictionary = board.string(DICTIONARY)?.ok_or_else(|| board.missing(DICTIONARY))?.to_owned();
            (Pattern::Charuco { marker_mm, dictionary }, &["marker_mm", "dictionary"])
        }
        "aprilgrid" => {
            let marker_mm = length_below(MARKER, spacing_mm, "the pitch of the tags")?;
            if let Some(family) = board.string(DICTIONARY)?
                && !family.to_lowercase().ends_with("36h11")
            {
                let problem = "is not the family of an aprilgrid here, 36h11";
                return Err(board.fault(board.required(DICTIONARY)?, DICTIONARY, problem));
            }
            (Pattern::Aprilgrid { marker_mm }, &["marker_mm", "dictionary"])
        }
        _ => (Pattern::Chessboard, &[]),
    };
    for field in [CIRCLE, MARKER, DICTIONARY] {
        if board.get(field).is_some() && !used.contains(&field.key) {
            let (path, section, key) = (board.source.path.display(), &board.name, field.key);
            tracing::warn!("{path}: `{section}.{key}` has no meaning for \"{kind}\" and is ignored");
        }
    }
    Ok(Target { pattern, columns, rows, spacing_mm })
}

/// Least number of columns and rows of a board that determines a pose.
fn smallest(kind: &str) -> usize {
    if kind == "aprilgrid" { 1 } else { 2 }
}
