//! `dataset.toml`: the declaration of a dataset.

use std::path::Path;

use depthcal_model::Target;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::board::BOARD_KEYS;
use super::boards::Boards;
use super::camera_hint::{CAMERA_KEYS, CameraHint, camera_from};
use super::error::DatasetError;
use super::extrinsics::{EXPECTED, EXTRINSICS, extrinsics_from};
use super::inside::within;
use super::section::{Field, Keys, Section, Source};
use super::text::read_text;
use crate::image::Disparity;

/// Name of the file that makes a folder a dataset.
pub const DATASET_FILE: &str = "dataset.toml";

/// Name of the camera that sections `[frames]`, `[depth]` and `[camera]` declare.
pub const CAMERA: &str = "camera";

/// The contents of `dataset.toml`.
///
/// One camera is declared in sections `[frames]`, `[depth]` and `[camera]`, several in sections `[cameras.NAME]`: the first form
/// is short for one camera of the name [`CAMERA`].
#[derive(Debug, Clone, PartialEq)]
pub struct DatasetFile {
    /// The board, or several; the diameter of dots is 0 where it is not declared.
    pub board: Target,
    /// Name of a table with one row per frame (frame,timestamp_s,temperature_c,…), and with the files of every frame where it has
    /// columns `image` and `depth`, of several cameras `NAME.image` and `NAME.depth`.
    pub metadata: Option<String>,
    /// Name of a list of pairs with lines `time image time depth`, as TUM's `associate.py` writes it; of one camera.
    pub associations: Option<String>,
    /// Images and depth, and files of different cameras, are one frame where their times are nearest and at most this far apart,
    /// s; times are from lists or file names.
    pub within_s: Option<f64>,
    /// The cameras in the order of the file; the first is the reference. There is at least one.
    pub cameras: Vec<CameraSection>,
}

/// The kinds of files of a frame, by the keys of their globs and the names of their columns.
pub(super) const FILES: [&str; 2] = ["image", "depth"];

/// The declaration of a camera. Globs are relative to the dataset's folder. At least one of `image` and `depth` is given, or the
/// dataset has `associations` or `metadata`.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraSection {
    /// The camera's name.
    pub name: String,
    /// Glob of the images, or a list of them with times (`rgb.txt`).
    pub image: Option<String>,
    /// Glob of the depth images, or a list of them with times; they are paired with the images by their names.
    pub depth: Option<String>,
    /// Millimetres per step of the depth image, or per unit where it holds floating-point numbers: 1000 for metres. Required
    /// where there is depth.
    pub unit_mm: Option<f64>,
    /// Inverse depth of the disparities that the depth images hold in place of depth; then there is no `unit_mm`.
    pub disparity: Option<Disparity>,
    /// Intrinsics, as start values or constants, and the lens.
    pub camera: Option<CameraHint>,
    /// Known extrinsics, which no fit changes: the three rows of (R | t) that map the reference's coordinates to this camera's,
    /// mm.
    pub camera_from_rig: Option<[f64; 12]>,
    /// Expected extrinsics in the same form, such as those of the factory: a fit is held against them.
    pub expected_from_rig: Option<[f64; 12]>,
}

impl Default for CameraSection {
    fn default() -> Self {
        Self {
            name: CAMERA.to_owned(),
            image: None,
            depth: None,
            unit_mm: None,
            disparity: None,
            camera: None,
            camera_from_rig: None,
            expected_from_rig: None,
        }
    }
}

const SHORT: Keys = &[
    ("", &["board", "boards", "frames", "depth", "camera"]),
    ("board", BOARD_KEYS),
    ("frames", &["image", "depth", "metadata", "associations", "within_s"]),
    ("depth", &["unit_mm", "kind", "disparity"]),
    ("camera", CAMERA_KEYS),
];
const LONG: Keys = &[
    ("", &["board", "boards", "frames", "cameras"]),
    ("board", BOARD_KEYS),
    ("frames", &["metadata", "within_s"]),
    ("cameras.NAME", MEMBER_KEYS),
];
const MEMBER_KEYS: &[&str] = &[
    "image",
    "depth",
    "unit_mm",
    "kind",
    "disparity",
    "fx",
    "fy",
    "cx",
    "cy",
    "skew",
    "distortion",
    "intrinsics",
    "lens",
    "fixed",
    "technology",
    "camera_from_rig",
    "expected_from_rig",
];

const FRAMES: Field = Field {
    key: "frames",
    remedy: "declare the captures in a section [frames], such as image = \"image/*.png\", or those of several cameras in sections [cameras.NAME]",
};
const IMAGE: Field = Field { key: "image", remedy: "give a glob such as \"image/*.png\"" };
const DEPTH_GLOB: Field = Field { key: "depth", remedy: "give a glob such as \"depth/*.png\"" };
const METADATA: Field = Field { key: "metadata", remedy: "give the name of a table, such as \"frames.csv\"" };
const ASSOCIATIONS: Field =
    Field { key: "associations", remedy: "give the name of a list of pairs, such as \"associations.txt\"" };
const WITHIN: Field = Field {
    key: "within_s",
    remedy: "give the largest difference in time of the files of one frame in seconds, such as 0.02",
};
const DEPTH: Field = Field { key: "depth", remedy: "declare the depth unit in a section [depth]: unit_mm = 1.0" };
const UNIT: Field = Field {
    key: "unit_mm",
    remedy: "give the millimetres per step of the depth image, such as unit_mm = 1.0 for depth in mm; it is required where there is depth, \
             never guessed (1000.0 for floating-point depth in metres)",
};
const KIND: Field = Field {
    key: "kind",
    remedy: "write kind = \"disparity\" with disparity = [a, b], where 1/z = a + b d in 1/mm, or leave it out for depth",
};
const DISPARITY: Field = Field {
    key: "disparity",
    remedy: "give [a, b] of 1/z = a + b d in 1/mm, in place of unit_mm; for the raw disparity of a Kinect 1 \
             disparity = [3.1365e-3, -2.8736e-6]",
};
const CAMERA_FIELD: Field = Field {
    key: "camera",
    remedy: "declare intrinsics in a section [camera]: fx, fy, cx, cy in px, or intrinsics = \"FILE\"",
};
const CAMERAS: Field = Field {
    key: "cameras",
    remedy: "declare every camera in a section of its own, [cameras.NAME], with image, depth or both",
};

impl DatasetFile {
    /// Reads a `dataset.toml`.
    ///
    /// # Errors
    /// [`DatasetError`] with the file, the line, the field and the remedy.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, DatasetError> {
        Self::read_file(path.as_ref())
    }

    fn read_file(path: &Path) -> Result<Self, DatasetError> {
        Self::parse(path, &read_text(path)?)
    }

    /// Parses the text of a `dataset.toml`; `path` only names its source in errors.
    ///
    /// # Errors
    /// As [`DatasetFile::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, DatasetError> {
        let source = Source { path, text: text.strip_prefix('\u{feff}').unwrap_or(text) };
        let root = source.parse()?;
        let cameras = root.get(CAMERAS.key);
        let keys = if cameras.is_some() { LONG } else { SHORT };
        source.deny_unknown(&root, "", keys_of("", keys), keys)?;
        let boards = Boards::of(source, &root, keys)?;
        let frames = source.section(&root, FRAMES, keys_of("frames", keys), keys)?;
        let cameras = match (cameras, &frames) {
            (Some(value), _) => Cameras::Long(members(source, value, keys)?),
            (None, Some(frames)) => Cameras::Short {
                frames,
                depth: source.section(&root, DEPTH, keys_of("depth", keys), keys)?,
                camera: source.section(&root, CAMERA_FIELD, CAMERA_KEYS, keys)?,
            },
            (None, None) => return Err(source.missing(FRAMES)),
        };
        let board = boards.target()?;
        let mut file = match &frames {
            Some(frames) => frames_from(frames, board)?,
            None => Self { board, metadata: None, associations: None, within_s: None, cameras: Vec::new() },
        };
        file.cameras = cameras.sections()?;
        file.check_cameras(source)?;
        Ok(file)
    }

    /// Checks that every camera has files, and a unit where it has depth.
    fn check_cameras(&self, source: Source<'_>) -> Result<(), DatasetError> {
        if self.cameras.is_empty() {
            return Err(source.missing(CAMERAS));
        }
        for camera in &self.cameras {
            let has_files = camera.image.is_some() || camera.depth.is_some();
            if !has_files && self.metadata.is_none() && self.associations.is_none() {
                return Err(camera.files_missing(source.path));
            }
            if (camera.depth.is_some() || self.associations.is_some()) && !camera.has_unit() {
                return Err(camera.unit_missing(source.path));
            }
        }
        Ok(())
    }

    /// Whether it declares one camera without a name of its own, in sections `[frames]`, `[depth]` and `[camera]`.
    pub fn is_short(&self) -> bool {
        matches!(self.cameras.as_slice(), [only] if only.name == CAMERA)
    }
}

impl CameraSection {
    /// Whether it says what the numbers in its depth images mean.
    pub(super) fn has_unit(&self) -> bool {
        self.unit_mm.is_some() || self.disparity.is_some()
    }

    /// Name of the field `image`, `depth` or `unit_mm` with its section.
    pub(super) fn field(&self, key: &str) -> String {
        match (self.name.as_str(), key) {
            (CAMERA, "unit_mm") => format!("depth.{key}"),
            (CAMERA, _) => format!("frames.{key}"),
            (name, _) => format!("cameras.{name}.{key}"),
        }
    }

    /// Name of the column of files `image` or `depth` in the table.
    pub(super) fn column(&self, kind: &str) -> String {
        if self.name == CAMERA { kind.to_owned() } else { format!("{}.{kind}", self.name) }
    }

    /// The error of a file at `path` whose frames of this camera have depth but no unit.
    pub(super) fn unit_missing(&self, path: &Path) -> DatasetError {
        self.missing(UNIT, path)
    }

    /// The error of a file at `path` that declares no frames of this camera: its table has no columns of files, and there is no
    /// glob.
    pub(super) fn files_missing(&self, path: &Path) -> DatasetError {
        self.missing(IMAGE, path)
    }

    fn missing(&self, field: Field, path: &Path) -> DatasetError {
        DatasetError::MissingField { path: path.to_owned(), field: self.field(field.key), remedy: field.remedy }
    }
}

fn keys_of(section: &str, keys: Keys) -> &'static [&'static str] {
    keys.iter().find(|(name, _)| *name == section).map_or(&[], |(_, keys)| keys)
}

/// The sections of cameras, whose keys are known.
enum Cameras<'a> {
    Short { frames: &'a Section<'a>, depth: Option<Section<'a>>, camera: Option<Section<'a>> },
    Long(Vec<(String, Section<'a>)>),
}

impl Cameras<'_> {
    fn sections(&self) -> Result<Vec<CameraSection>, DatasetError> {
        let unit = |depth: &Section<'_>| depth.positive(UNIT, 0.002..=1000.0);
        let unit_if_any = |depth: &Section<'_>| depth.get(UNIT).map(|_| unit(depth)).transpose();
        match self {
            Self::Short { frames, depth, camera } => {
                let disparity = depth.as_ref().map(disparity_from).transpose()?.flatten();
                let unit_mm = depth.as_ref().filter(|_| disparity.is_none()).map(unit).transpose()?;
                Ok(vec![CameraSection {
                    name: CAMERA.to_owned(),
                    image: path_of(frames, IMAGE)?,
                    depth: path_of(frames, DEPTH_GLOB)?,
                    unit_mm,
                    disparity,
                    camera: camera.as_ref().map(camera_from).transpose()?,
                    camera_from_rig: None,
                    expected_from_rig: None,
                }])
            }
            Self::Long(members) => {
                let camera = |(number, (name, section)): (usize, &(String, Section<'_>))| {
                    let declares = CAMERA_KEYS.iter().any(|key| section.table.contains_key(*key));
                    Ok(CameraSection {
                        name: name.clone(),
                        image: path_of(section, IMAGE)?,
                        depth: path_of(section, DEPTH_GLOB)?,
                        unit_mm: unit_if_any(section)?,
                        disparity: disparity_from(section)?,
                        camera: declares.then(|| camera_from(section)).transpose()?,
                        camera_from_rig: extrinsics_from(section, EXTRINSICS, number == 0)?,
                        expected_from_rig: extrinsics_from(section, EXPECTED, number == 0)?,
                    })
                };
                members.iter().enumerate().map(camera).collect()
            }
        }
    }
}

/// How the numbers of depth images become inverse depth, where they are disparities.
fn disparity_from(section: &Section<'_>) -> Result<Option<Disparity>, DatasetError> {
    let kind = section.string(KIND)?;
    if let Some(other) = kind.filter(|kind| !["depth", "disparity"].contains(kind)) {
        return Err(section.fault(section.required(KIND)?, KIND, format!("is {other:?}")));
    }
    if kind != Some("disparity") && section.get(DISPARITY).is_none() {
        return Ok(None);
    }
    let value = section.required(DISPARITY)?;
    if kind == Some("depth") || section.get(UNIT).is_some() {
        return Err(section.fault(
            value,
            DISPARITY,
            "stands beside unit_mm or kind = \"depth\": one of them is too many",
        ));
    }
    match section.numbers(DISPARITY, 10.0)?.as_deref() {
        Some([a, b]) if *b != 0.0 => Ok(Some(Disparity([*a, *b]))),
        _ => Err(section.fault(value, DISPARITY, "is not two numbers, of which the second is not 0")),
    }
}

/// The sections `[cameras.NAME]` in the order of the file, of which the first is the reference.
fn members<'a>(
    source: Source<'a>,
    value: &'a Spanned<DeValue<'a>>,
    keys: Keys,
) -> Result<Vec<(String, Section<'a>)>, DatasetError> {
    let wrong = |problem: String| Err(source.field_error(value, CAMERAS.key, CAMERAS.remedy, problem));
    let Some(table) = value.get_ref().as_table() else { return wrong("is not a section".to_owned()) };
    let table: &'a DeTable<'a> = table;
    let mut members: Vec<_> = table.iter().collect();
    members.sort_by_key(|(name, _)| name.span().start);
    let mut sections = Vec::new();
    for (name, value) in members {
        let name: &str = name.get_ref();
        if name.is_empty() || !name.chars().all(|c| c.is_alphanumeric() || matches!(c, '_' | '-')) {
            return wrong(format!("[cameras.{name:?}] has a name with other characters than letters, digits, - and _"));
        }
        let section = source.subsection(value, format!("cameras.{name}"), CAMERAS, MEMBER_KEYS, keys)?;
        sections.push((name.to_owned(), section));
    }
    Ok(sections)
}

/// The declaration with what `[frames]` says of all cameras, without cameras.
fn frames_from(frames: &Section<'_>, board: Target) -> Result<DatasetFile, DatasetError> {
    let associations = path_of(frames, ASSOCIATIONS)?;
    if associations.is_some() && [IMAGE, DEPTH_GLOB, WITHIN].iter().any(|field| frames.get(*field).is_some()) {
        let problem = "names the files of every frame itself, which image, depth and within_s would contradict";
        return Err(frames.fault(frames.required(ASSOCIATIONS)?, ASSOCIATIONS, problem));
    }
    Ok(DatasetFile {
        board,
        metadata: path_of(frames, METADATA)?,
        associations,
        // An hour: slower scenes than that have names.
        within_s: frames.get(WITHIN).map(|_| frames.positive(WITHIN, 0.0..=3600.0)).transpose()?,
        cameras: Vec::new(),
    })
}

/// A glob or the name of a file in the dataset's folder.
///
/// # Errors
/// [`DatasetError::Field`] where it leads out of the folder.
fn path_of(section: &Section<'_>, field: Field) -> Result<Option<String>, DatasetError> {
    let Some(given) = section.string(field)? else { return Ok(None) };
    let root = section.source.path.parent().unwrap_or(Path::new(""));
    if within(root, root, Path::new(given)).is_none() {
        let problem =
            "leads out of the dataset's folder, where no file is read (a symbolic link in the folder is followed)";
        return Err(section.fault(section.required(field)?, field, problem));
    }
    Ok(Some(given.to_owned()))
}

#[cfg(test)]
mod tests;
