//! `dataset.toml`: the declaration of a dataset.

use std::path::Path;

use depthcal_model::{Pattern, Target};
use serde::Serialize;
use toml::de::DeTable;

use super::camera_hint::{CameraHint, IntrinsicNumbers};
use super::error::DatasetError;
use super::inside::within;
use super::section::{Field, Section, Source};
use super::suggest::nearest;
use super::text::{CAMERAS, read_text};
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

/// `[frames]`: globs relative to the dataset's folder. At least one of `image`, `depth`, `associations` and `metadata` (a table
/// with a column `image` or `depth`) is given.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FramesSection {
    /// Glob of the images, or a list of them with times (`rgb.txt`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image: Option<String>,
    /// Glob of the depth images, or a list of them with times; they are paired with the images by their names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth: Option<String>,
    /// Name of a table with one row per frame (frame,timestamp_s,temperature_c,…), and with the files of every frame where it has
    /// columns image and depth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metadata: Option<String>,
    /// Name of a list of pairs with lines `time image time depth`, as TUM's `associate.py` writes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub associations: Option<String>,
    /// Pairs images and depth by nearest time, at most this far apart, s; times are from lists or file names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub within_s: Option<f64>,
}

/// `[depth]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DepthSection {
    /// Millimetres per step of the depth image, or per unit where it holds floating-point numbers: 1000 for metres.
    pub unit_mm: f64,
}

const KINDS: &[&str] = &["asymmetric-circles", "symmetric-circles", "chessboard", "charuco", "aprilgrid"];

const SECTIONS: &[&str] = &["board", "frames", "depth", "camera"];
const BOARD_KEYS: &[&str] = &["kind", "columns", "rows", "spacing_mm", "circle_diameter_mm", "marker_mm", "dictionary"];
const FRAMES_KEYS: &[&str] = &["image", "depth", "metadata", "associations", "within_s"];
const DEPTH_KEYS: &[&str] = &["unit_mm"];
pub(crate) const CAMERA_KEYS: &[&str] = &["fx", "fy", "cx", "cy", "skew", "distortion", "intrinsics", "lens", "fixed"];

pub(crate) const BOARD: Field =
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
const ASSOCIATIONS: Field =
    Field { name: "frames.associations", remedy: "give the name of a list of pairs, such as \"associations.txt\"" };
const WITHIN: Field = Field {
    name: "frames.within_s",
    remedy: "give the largest difference in time of an image and its depth image in seconds, such as 0.02",
};
const DEPTH: Field = Field { name: "depth", remedy: "declare the depth unit in a section [depth]: unit_mm = 1.0" };
const UNIT: Field = Field {
    name: "depth.unit_mm",
    remedy: "give the millimetres per step of the depth image in [depth], such as unit_mm = 1.0 for depth in mm; it is \
             required where there is depth, never guessed (1000.0 for floating-point depth in metres)",
};
const CAMERA: Field = Field {
    name: "camera",
    remedy: "declare intrinsics in a section [camera]: fx, fy, cx, cy in px, or intrinsics = \"FILE\"",
};
const FX: Field = Field { name: "camera.fx", remedy: "give the focal length in x, in px" };
const FY: Field = Field { name: "camera.fy", remedy: "give the focal length in y, in px" };
const CX: Field = Field { name: "camera.cx", remedy: "give the column of the principal point, in px" };
const CY: Field = Field { name: "camera.cy", remedy: "give the row of the principal point, in px" };
const SKEW: Field = Field { name: "camera.skew", remedy: "give the skew in px, normally 0" };
const DISTORTION: Field = Field {
    name: "camera.distortion",
    remedy: "give OpenCV's coefficients [k1, k2, p1, p2, k3, …], 4, 5, 8, 12 or 14 of them; with lens = \"kannala-brandt\" [k1, k2, k3, k4]",
};
const INTRINSICS: Field = Field {
    name: "camera.intrinsics",
    remedy: "give a camera file of OpenCV, ROS, Kalibr, mrcal or COLMAP, relative to the dataset, and no numbers beside it",
};
const LENS: Field = Field {
    name: "camera.lens",
    remedy: "give a lens model as --lens takes it, such as \"brown-conrady\", \"opencv8\", \"kannala-brandt\" or \"auto\"",
};
const FIXED: Field =
    Field { name: "camera.fixed", remedy: "write true to hold these values, false to start from them" };

impl DatasetFile {
    /// Reads a `dataset.toml`.
    ///
    /// # Errors
    /// [`DatasetError`] with the file, the line, the field and the remedy.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, DatasetError> {
        let path = path.as_ref();
        Self::parse(path, &read_text(path)?)
    }

    /// Parses the text of a `dataset.toml`; `path` only names its source in errors.
    ///
    /// # Errors
    /// As [`DatasetFile::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, DatasetError> {
        let source = Source { path, text: text.strip_prefix('\u{feff}').unwrap_or(text) };
        let root = source.parse()?;
        if root.contains_key(CAMERAS) {
            return Err(DatasetError::SeveralCameras { path: path.to_owned() });
        }
        source.deny_unknown(&root, "", SECTIONS, &all_fields())?;
        let board = board_section(source, &root)?;
        let frames = section(source, &root, FRAMES, FRAMES_KEYS)?.ok_or_else(|| source.missing(FRAMES))?;
        let depth = section(source, &root, DEPTH, DEPTH_KEYS)?;
        let camera = section(source, &root, CAMERA, CAMERA_KEYS)?;

        let file = DatasetFile {
            board: board_from(&board)?,
            frames: frames_from(&frames)?,
            depth: depth.map(|depth| depth_from(&depth)).transpose()?,
            camera: camera.map(|camera| camera_from(&camera)).transpose()?,
        };
        if (file.frames.depth.is_some() || file.frames.associations.is_some()) && file.depth.is_none() {
            return Err(source.missing(UNIT));
        }
        Ok(file)
    }

    /// The text of the file.
    ///
    /// # Errors
    /// The serialiser's message, where a value has no TOML.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// Writes the file atomically.
    ///
    /// # Errors
    /// [`FileError::Invalid`] when [`DatasetFile::read`] would refuse the contents; [`FileError::Write`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        let path = path.as_ref();
        let invalid = |problem| FileError::Invalid { path: path.to_owned(), field: ".".into(), problem };
        let text = self.to_toml().map_err(|error| invalid(error.to_string()))?;
        // A file that could not be read back is not written.
        Self::parse(path, &text).map_err(|error| invalid(format!("would not be accepted on reading: {error}")))?;
        write_atomically(path, |writer| writer.write_all(text.as_bytes()))
    }
}

/// The error of a file at `path` whose frames have depth but no unit.
pub(crate) fn unit_missing(path: &Path) -> DatasetError {
    DatasetError::MissingField { path: path.to_owned(), field: UNIT.name, remedy: UNIT.remedy }
}

/// The error of a file at `path` that declares no frames: its table has no columns of files, and there is no glob.
pub(crate) fn files_missing(path: &Path) -> DatasetError {
    DatasetError::MissingField { path: path.to_owned(), field: IMAGE.name, remedy: IMAGE.remedy }
}

/// All fields with their sections, for suggestions across sections.
fn all_fields() -> Vec<&'static str> {
    [
        KIND,
        COLUMNS,
        ROWS,
        SPACING,
        CIRCLE,
        MARKER,
        DICTIONARY,
        IMAGE,
        METADATA,
        ASSOCIATIONS,
        WITHIN,
        UNIT,
        FX,
        FY,
        CX,
        CY,
        SKEW,
        DISTORTION,
        INTRINSICS,
        LENS,
        FIXED,
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

/// The section of the board, which every file has.
pub(crate) fn board_section<'a>(source: Source<'a>, root: &'a DeTable<'a>) -> Result<Section<'a>, DatasetError> {
    section(source, root, BOARD, BOARD_KEYS)?.ok_or_else(|| source.missing(BOARD))
}

pub(crate) fn board_from(board: &Section<'_>) -> Result<Target, DatasetError> {
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
    let glob = |field| path_of(frames, field);
    let section = FramesSection {
        image: glob(IMAGE)?,
        depth: glob(DEPTH_GLOB)?,
        metadata: glob(METADATA)?,
        associations: glob(ASSOCIATIONS)?,
        // An hour: slower scenes than that have names.
        within_s: frames.get(WITHIN).map(|_| frames.positive(WITHIN, 0.0..=3600.0)).transpose()?,
    };
    let FramesSection { image, depth, metadata, associations, .. } = &section;
    if [image, depth, metadata, associations].iter().all(|field| field.is_none()) {
        return Err(frames.source.missing(IMAGE));
    }
    if associations.is_some() && (image.is_some() || depth.is_some() || section.within_s.is_some()) {
        let problem = "names the files of every frame itself, which image, depth and within_s would contradict";
        return Err(frames.source.field_error(frames.required(ASSOCIATIONS)?, ASSOCIATIONS, problem));
    }
    Ok(section)
}

/// A glob or the name of a file in the dataset's folder.
///
/// # Errors
/// [`DatasetError::Field`] where it leads out of the folder.
pub(crate) fn path_of(section: &Section<'_>, field: Field) -> Result<Option<String>, DatasetError> {
    let Some(given) = section.string(field)? else { return Ok(None) };
    let root = section.source.path.parent().unwrap_or(Path::new(""));
    if within(root, root, Path::new(given)).is_none() {
        let problem =
            "leads out of the dataset's folder, where no file is read (a symbolic link in the folder is followed)";
        return Err(section.source.field_error(section.required(field)?, field, problem));
    }
    Ok(Some(given.to_owned()))
}

fn depth_from(depth: &Section<'_>) -> Result<DepthSection, DatasetError> {
    // The usual mistake is 0.001, metres per step instead of millimetres. 1000 is for floating-point metres; whole steps have a
    // lower limit, see `DepthFrame::check_unit`.
    Ok(DepthSection { unit_mm: depth.positive(UNIT, 0.002..=1000.0)? })
}

pub(crate) fn camera_from(camera: &Section<'_>) -> Result<CameraHint, DatasetError> {
    let text = |field| Ok::<_, DatasetError>(camera.string(field)?.map(str::to_owned));
    let (intrinsics, lens) = (text(INTRINSICS)?, text(LENS)?);
    let given = [FX, FY, CX, CY, SKEW, DISTORTION].into_iter().find(|field| camera.get(*field).is_some());
    if let (Some(_), Some(field)) = (&intrinsics, given) {
        let problem = "stands beside `intrinsics`: one of them is too many";
        return Err(camera.source.field_error(camera.required(field)?, INTRINSICS, problem));
    }
    // A section of a lens or a file alone has no numbers; one of neither lacks them.
    let needs_numbers = given.is_some() || (intrinsics.is_none() && lens.is_none());
    let numbers = needs_numbers.then(|| numbers_from(camera, lens.as_deref())).transpose()?;
    Ok(CameraHint { numbers, intrinsics, lens, fixed: camera.boolean(FIXED)?.unwrap_or(false) })
}

fn numbers_from(camera: &Section<'_>, lens: Option<&str>) -> Result<IntrinsicNumbers, DatasetError> {
    const FAR: f64 = 100_000.0;
    let principal = |field| camera.bounded(field, FAR)?.ok_or_else(|| camera.source.missing(field));
    let distortion = camera.numbers(DISTORTION, 1000.0)?.unwrap_or_default();
    let counts: &[usize] = if lens.is_some_and(is_fisheye) { &[0, 4] } else { &[0, 4, 5, 8, 12, 14] };
    if !counts.contains(&distortion.len()) {
        let expected = if counts.len() == 2 { "4" } else { "4, 5, 8, 12 or 14" };
        let problem = format!("has {} numbers, expected {expected}", distortion.len());
        return Err(camera.source.field_error(camera.required(DISTORTION)?, DISTORTION, problem));
    }
    Ok(IntrinsicNumbers {
        fx: camera.positive(FX, 1.0..=FAR)?,
        fy: camera.positive(FY, 1.0..=FAR)?,
        cx: principal(CX)?,
        cy: principal(CY)?,
        skew: camera.bounded(SKEW, FAR)?.unwrap_or(0.0),
        distortion,
    })
}

fn is_fisheye(lens: &str) -> bool {
    lens.replace('-', "_") == "kannala_brandt"
}

#[cfg(test)]
mod tests;
