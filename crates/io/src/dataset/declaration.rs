//! `dataset.toml`: the declaration of a dataset.

use std::fs;
use std::io;
use std::path::Path;

use depthcal_model::{Pattern, Target};
use serde::Serialize;
use toml::de::DeTable;

use super::camera_hint::CameraHint;
use super::error::DatasetError;
use super::section::{Field, Section, Source};
use super::suggest::nearest;
use crate::file::{FileError, write_atomically};

/// Name of the file that makes a folder a dataset.
pub const DATASET_FILE: &str = "dataset.toml";

/// The contents of `dataset.toml`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DatasetFile {
    /// The board; the diameter of its dots is 0 where it is not declared.
    pub board: Target,
    /// Where the frames are.
    pub frames: FramesSection,
    /// Unit of the depth images; required where `frames.depth` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth: Option<DepthSection>,
    /// Intrinsics, as start values or constants.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraHint>,
}

/// `[frames]`: globs relative to the dataset's folder. At least one of `image` and `depth` is given.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct FramesSection {
    /// Glob of the images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image: Option<String>,
    /// Glob of the depth images, paired with the images by file stem.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth: Option<String>,
    /// Name of a table with one row per frame (frame,timestamp_s,temperature_c,…).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metadata: Option<String>,
}

/// `[depth]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DepthSection {
    /// Millimetres per step of the 16-bit depth image.
    pub unit_mm: f64,
}

const KINDS: &[&str] = &["asymmetric-circles", "symmetric-circles", "chessboard", "charuco", "aprilgrid"];

const SECTIONS: &[&str] = &["board", "frames", "depth", "camera"];
const BOARD_KEYS: &[&str] = &["kind", "columns", "rows", "spacing_mm", "circle_diameter_mm", "marker_mm", "dictionary"];
const FRAMES_KEYS: &[&str] = &["image", "depth", "metadata"];
const DEPTH_KEYS: &[&str] = &["unit_mm"];
const CAMERA_KEYS: &[&str] = &["fx", "fy", "cx", "cy", "skew", "distortion", "fixed"];

const BOARD: Field =
    Field { name: "board", remedy: "declare the board in a section [board] with kind, columns, rows, spacing_mm" };
const KIND: Field = Field {
    name: "board.kind",
    remedy: "write \"asymmetric-circles\", \"symmetric-circles\", \"chessboard\", \"charuco\" or \"aprilgrid\"",
};
const COLUMNS: Field = Field {
    name: "board.columns",
    remedy: "give the number of markers in a row (chessboard: inner corners, charuco: squares, aprilgrid: tags)",
};
const ROWS: Field = Field {
    name: "board.rows",
    remedy: "give the number of rows of markers (chessboard: inner corners, charuco: squares, aprilgrid: tags)",
};
const SPACING: Field = Field {
    name: "board.spacing_mm",
    remedy: "give the grid spacing in mm (asymmetric circles: the distance between neighbouring rows)",
};
const CIRCLE: Field = Field {
    name: "board.circle_diameter_mm",
    remedy: "give the diameter of a printed dot in mm, or leave it out: then it is measured in the images",
};
const MARKER: Field = Field {
    name: "board.marker_mm",
    remedy: "give the side of a marker, over its black border, in mm; it is smaller than spacing_mm",
};
const DICTIONARY: Field =
    Field { name: "board.dictionary", remedy: "give OpenCV's name of the dictionary, such as \"DICT_5X5_100\"" };
const FRAMES: Field =
    Field { name: "frames", remedy: "declare the captures in a section [frames], such as image = \"image/*.png\"" };
const IMAGE: Field = Field { name: "frames.image", remedy: "give a glob such as \"image/*.png\"" };
const DEPTH_GLOB: Field = Field { name: "frames.depth", remedy: "give a glob such as \"depth/*.png\"" };
const METADATA: Field = Field { name: "frames.metadata", remedy: "give the name of a table, such as \"frames.csv\"" };
const DEPTH: Field = Field { name: "depth", remedy: "declare the depth unit in a section [depth]: unit_mm = 1.0" };
const UNIT: Field = Field {
    name: "depth.unit_mm",
    remedy: "give the millimetres per step of the depth image in [depth], such as unit_mm = 1.0 for depth in mm; it is \
             required where there is depth, never guessed",
};
const CAMERA: Field =
    Field { name: "camera", remedy: "declare intrinsics in a section [camera]: fx, fy, cx, cy in px" };
const FX: Field = Field { name: "camera.fx", remedy: "give the focal length in x, in px" };
const FY: Field = Field { name: "camera.fy", remedy: "give the focal length in y, in px" };
const CX: Field = Field { name: "camera.cx", remedy: "give the column of the principal point, in px" };
const CY: Field = Field { name: "camera.cy", remedy: "give the row of the principal point, in px" };
const SKEW: Field = Field { name: "camera.skew", remedy: "give the skew in px, normally 0" };
const DISTORTION: Field =
    Field { name: "camera.distortion", remedy: "give Brown-Conrady coefficients [k1, k2, p1, p2, k3]" };
const FIXED: Field =
    Field { name: "camera.fixed", remedy: "write true to hold these values, false to start from them" };

impl DatasetFile {
    /// Reads a `dataset.toml`.
    ///
    /// # Errors
    /// [`DatasetError`] with the file, the line, the field and the remedy.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, DatasetError> {
        let path = path.as_ref();
        let text = fs::read_to_string(path).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
                DatasetError::NoDatasetFile { path: path.to_owned() }
            }
            _ => DatasetError::Read { path: path.to_owned(), error },
        })?;
        Self::parse(path, &text)
    }

    /// Parses the text of a `dataset.toml`; `path` only names its source in errors.
    ///
    /// # Errors
    /// As [`DatasetFile::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, DatasetError> {
        let source = Source { path, text: text.strip_prefix('\u{feff}').unwrap_or(text) };
        let root = source.parse()?;
        source.deny_unknown(&root, "", SECTIONS, &all_fields())?;
        let board = section(source, &root, BOARD, BOARD_KEYS)?.ok_or_else(|| source.missing(BOARD))?;
        let frames = section(source, &root, FRAMES, FRAMES_KEYS)?.ok_or_else(|| source.missing(FRAMES))?;
        let depth = section(source, &root, DEPTH, DEPTH_KEYS)?;
        let camera = section(source, &root, CAMERA, CAMERA_KEYS)?;

        let file = DatasetFile {
            board: board_from(&board)?,
            frames: frames_from(&frames)?,
            depth: depth.map(|depth| depth_from(&depth)).transpose()?,
            camera: camera.map(|camera| camera_from(&camera)).transpose()?,
        };
        if file.frames.depth.is_some() && file.depth.is_none() {
            return Err(source.missing(UNIT));
        }
        Ok(file)
    }

    /// Writes the file atomically.
    ///
    /// # Errors
    /// [`FileError::Invalid`] when [`DatasetFile::read`] would refuse the contents; [`FileError::Write`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        let path = path.as_ref();
        let invalid = |problem| FileError::Invalid { path: path.to_owned(), field: ".".into(), problem };
        let text = toml::to_string(self).map_err(|error| invalid(error.to_string()))?;
        // A file that could not be read back is not written.
        Self::parse(path, &text).map_err(|error| invalid(format!("would not be accepted on reading: {error}")))?;
        write_atomically(path, |writer| writer.write_all(text.as_bytes()))
    }
}

/// All fields with their sections, for suggestions across sections.
fn all_fields() -> Vec<&'static str> {
    [
        KIND, COLUMNS, ROWS, SPACING, CIRCLE, MARKER, DICTIONARY, IMAGE, METADATA, UNIT, FX, FY, CX, CY, SKEW,
        DISTORTION, FIXED,
    ]
    .map(|field| field.name)
    .to_vec()
}

fn section<'a>(
    source: Source<'a>,
    root: &'a DeTable<'a>,
    field: Field,
    known: &'static [&'static str],
) -> Result<Option<Section<'a>>, DatasetError> {
    let Some(value) = root.get(field.name) else { return Ok(None) };
    let Some(table) = value.get_ref().as_table() else {
        return Err(source.field_error(value, field, "is not a section"));
    };
    source.deny_unknown(table, &format!("{}.", field.name), known, &all_fields())?;
    Ok(Some(Section { source, table }))
}

fn board_from(board: &Section<'_>) -> Result<Target, DatasetError> {
    let kind = match board.string(KIND)? {
        Some(kind) => kind,
        None => return Err(board.source.missing(KIND)),
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
            Err(board.source.field_error(board.required(field)?, field, problem))
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
            let dictionary = board.string(DICTIONARY)?.ok_or_else(|| board.source.missing(DICTIONARY))?.to_owned();
            (Pattern::Charuco { marker_mm, dictionary }, &["marker_mm", "dictionary"])
        }
        "aprilgrid" => {
            let marker_mm = length_below(MARKER, spacing_mm, "the pitch of the tags")?;
            if let Some(family) = board.string(DICTIONARY)?
                && !family.to_lowercase().ends_with("36h11")
            {
                let problem = "is not the family of an aprilgrid here, 36h11";
                return Err(board.source.field_error(board.required(DICTIONARY)?, DICTIONARY, problem));
            }
            (Pattern::Aprilgrid { marker_mm }, &["marker_mm", "dictionary"])
        }
        _ => (Pattern::Chessboard, &[]),
    };
    for field in [CIRCLE, MARKER, DICTIONARY] {
        if board.get(field).is_some() && !used.iter().any(|key| field.name.ends_with(key)) {
            tracing::warn!(
                "{}: `{}` has no meaning for \"{kind}\" and is ignored",
                board.source.path.display(),
                field.name
            );
        }
    }
    Ok(Target { pattern, columns, rows, spacing_mm })
}

/// Least number of columns and rows of a board that determines a pose.
fn smallest(kind: &str) -> usize {
    if kind == "aprilgrid" { 1 } else { 2 }
}

fn frames_from(frames: &Section<'_>) -> Result<FramesSection, DatasetError> {
    let glob = |field| Ok::<_, DatasetError>(frames.string(field)?.map(str::to_owned));
    let section = FramesSection { image: glob(IMAGE)?, depth: glob(DEPTH_GLOB)?, metadata: glob(METADATA)? };
    if section.image.is_none() && section.depth.is_none() {
        return Err(frames.source.missing(IMAGE));
    }
    Ok(section)
}

fn depth_from(depth: &Section<'_>) -> Result<DepthSection, DatasetError> {
    // The usual mistake is 0.001, metres per step instead of millimetres.
    Ok(DepthSection { unit_mm: depth.positive(UNIT, 0.002..=50.0)? })
}

fn camera_from(camera: &Section<'_>) -> Result<CameraHint, DatasetError> {
    const FAR: f64 = 100_000.0;
    let principal = |field| camera.bounded(field, FAR)?.ok_or_else(|| camera.source.missing(field));
    let mut distortion = [0.0; 5];
    if let Some(given) = camera.numbers(DISTORTION, 1000.0)? {
        if given.len() != 4 && given.len() != 5 {
            let problem = format!("has {} numbers, expected 4 or 5", given.len());
            return Err(camera.source.field_error(camera.required(DISTORTION)?, DISTORTION, problem));
        }
        distortion[..given.len()].copy_from_slice(&given);
    }
    Ok(CameraHint {
        fx: camera.positive(FX, 1.0..=FAR)?,
        fy: camera.positive(FY, 1.0..=FAR)?,
        cx: principal(CX)?,
        cy: principal(CY)?,
        skew: camera.bounded(SKEW, FAR)?.unwrap_or(0.0),
        distortion,
        fixed: camera.boolean(FIXED)?.unwrap_or(false),
    })
}

#[cfg(test)]
mod tests;
