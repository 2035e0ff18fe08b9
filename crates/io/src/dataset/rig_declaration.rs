//! The declaration of a rig in `dataset.toml`: sections `[cameras.NAME]`.

use std::path::Path;

use depthcal_model::Target;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::boards::{BOARDS, boards_of};
use super::camera_hint::CameraHint;
use super::declaration::{CAMERA_KEYS, camera_from, path_of};
use super::error::DatasetError;
use super::section::{Field, Section, Source};
use super::text::{CAMERAS, read_text};

/// The contents of a `dataset.toml` that declares several cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct RigFile {
    /// The board, or several; the diameter of dots is 0 where it is not declared.
    pub board: Target,
    /// Name of a table with one row per frame, and with the files of every frame where it has columns `NAME.image`, `NAME.depth`.
    pub metadata: Option<String>,
    /// Files of different cameras, and images and depth, are one frame where their times are at most this far apart, s.
    pub within_s: Option<f64>,
    /// The cameras in the order of the file; the first is the reference.
    pub cameras: Vec<CameraSection>,
}

/// `[cameras.NAME]`. At least one of `image` and `depth` is given, or the table names the files.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraSection {
    /// The camera's name.
    pub name: String,
    /// Glob of its images, or a list of them with times.
    pub image: Option<String>,
    /// Glob of its depth images, or a list of them with times.
    pub depth: Option<String>,
    /// Millimetres per step of its depth images; required where there is depth.
    pub unit_mm: Option<f64>,
    /// Intrinsics, as start values or constants, and the lens.
    pub camera: Option<CameraHint>,
}

const RIG_SECTIONS: &[&str] = &["board", BOARDS, "frames", CAMERAS];
const RIG_FRAMES_KEYS: &[&str] = &["metadata", "within_s"];
const MEMBER_KEYS: &[&str] =
    &["image", "depth", "unit_mm", "fx", "fy", "cx", "cy", "skew", "distortion", "intrinsics", "lens", "fixed"];

const SECTION: Field = Field {
    name: "cameras",
    remedy: "declare every camera in a section of its own, [cameras.NAME], with image, depth or both",
};
const IMAGE: Field = Field { name: "cameras.NAME.image", remedy: "give a glob such as \"colour/*.png\"" };
const DEPTH: Field = Field { name: "cameras.NAME.depth", remedy: "give a glob such as \"depth/*.png\"" };
const UNIT: Field = Field {
    name: "cameras.NAME.unit_mm",
    remedy: "give the millimetres per step of this camera's depth images, such as unit_mm = 1.0; it is required where there is \
             depth, never guessed",
};
const METADATA: Field = Field { name: "frames.metadata", remedy: "give the name of a table, such as \"frames.csv\"" };
const WITHIN: Field = Field {
    name: "frames.within_s",
    remedy: "give the largest difference in time of the files of one frame in seconds, such as 0.02",
};

impl RigFile {
    /// Reads a `dataset.toml`.
    ///
    /// # Errors
    /// [`DatasetError`] with the file, the line, the field and the remedy.
    pub fn read(path: &Path) -> Result<Self, DatasetError> {
        Self::parse(path, &read_text(path)?)
    }

    /// Parses the text of a `dataset.toml`; `path` only names its source in errors.
    ///
    /// # Errors
    /// As [`RigFile::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, DatasetError> {
        let source = Source { path, text: text.strip_prefix('\u{feff}').unwrap_or(text) };
        let root = source.parse()?;
        source.deny_unknown(&root, "", RIG_SECTIONS, &[])?;
        let board = boards_of(source, &root)?;
        let frames = match root.get("frames") {
            Some(value) => Some(section(source, value, "frames.", RIG_FRAMES_KEYS)?),
            None => None,
        };
        let (mut metadata, mut within_s) = (None, None);
        if let Some(frames) = &frames {
            metadata = path_of(frames, METADATA)?;
            within_s = frames.get(WITHIN).map(|_| frames.positive(WITHIN, 0.0..=3600.0)).transpose()?;
        }
        let value = root.get(CAMERAS).ok_or_else(|| source.missing(SECTION))?;
        let table = value.get_ref().as_table().ok_or_else(|| source.field_error(value, SECTION, "is not a section"))?;
        let mut members: Vec<_> = table.iter().collect();
        // The first camera of the file is the reference.
        members.sort_by_key(|(name, _)| name.span().start);
        let cameras = members.into_iter().map(|(name, value)| {
            member(source, name.get_ref(), value).and_then(|camera| match (&camera.image, &camera.depth, &metadata) {
                (None, None, None) => Err(source.field_error(value, IMAGE, "is missing, and so is depth")),
                _ => Ok(camera),
            })
        });
        let cameras = cameras.collect::<Result<Vec<_>, _>>()?;
        if cameras.is_empty() {
            return Err(source.missing(SECTION));
        }
        Ok(Self { board, metadata, within_s, cameras })
    }
}

/// Whether a `dataset.toml` declares cameras of a rig. Files that are not TOML do not.
pub(crate) fn declares_cameras(path: &Path, text: &str) -> bool {
    let source = Source { path, text: text.strip_prefix('\u{feff}').unwrap_or(text) };
    source.parse().is_ok_and(|root| root.contains_key(CAMERAS))
}

fn section<'a>(
    source: Source<'a>,
    value: &'a Spanned<DeValue<'a>>,
    name: &str,
    known: &'static [&'static str],
) -> Result<Section<'a>, DatasetError> {
    let Some(table) = value.get_ref().as_table() else {
        return Err(source.field_error(value, SECTION, "is not a section"));
    };
    source.deny_unknown(table, name, known, &[])?;
    Ok(Section { source, table })
}

fn member<'a>(source: Source<'a>, name: &str, value: &'a Spanned<DeValue<'a>>) -> Result<CameraSection, DatasetError> {
    let usable = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-');
    if name.is_empty() || !name.chars().all(usable) {
        let problem = format!("[cameras.{name:?}] has a name with other characters than letters, digits, - and _");
        return Err(source.field_error(value, SECTION, problem));
    }
    let member: Section<'a> = section(source, value, &format!("cameras.{name}."), MEMBER_KEYS)?;
    let (image, depth) = (path_of(&member, IMAGE)?, path_of(&member, DEPTH)?);
    let unit_mm = member.get(UNIT).map(|_| member.positive(UNIT, 0.002..=1000.0)).transpose()?;
    if depth.is_some() && unit_mm.is_none() {
        return Err(source.field_error(value, UNIT, format!("is missing in [cameras.{name}]")));
    }
    let table: &DeTable<'_> = member.table;
    let declares = CAMERA_KEYS.iter().any(|key| table.contains_key(*key));
    let camera = declares.then(|| camera_from(&member)).transpose()?;
    Ok(CameraSection { name: name.to_owned(), image, depth, unit_mm, camera })
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOARD: &str = "[board]\nkind = \"chessboard\"\ncolumns = 9\nrows = 6\nspacing_mm = 20\n";

    fn parsed(sections: &str) -> Result<RigFile, DatasetError> {
        RigFile::parse(Path::new("set/dataset.toml"), &format!("{BOARD}{sections}"))
    }

    #[test]
    fn the_first_camera_of_the_file_is_the_first() {
        let rig = parsed(
            "[cameras.zed]\nimage = \"z/*.png\"\n[cameras.azure]\ndepth = \"a/*.png\"\nunit_mm = 0.5\nfx = 500\nfy = 500\ncx = 1\ncy = 2\n\
             [frames]\nwithin_s = 0.02\n",
        )
        .unwrap();
        let names: Vec<&str> = rig.cameras.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["zed", "azure"]);
        assert_eq!((rig.within_s, rig.cameras[1].unit_mm), (Some(0.02), Some(0.5)));
        assert!(rig.cameras[0].camera.is_none() && rig.cameras[1].camera.as_ref().unwrap().numbers.is_some());
    }

    #[test]
    fn faults_have_line_and_remedy() {
        let complaint = |sections: &str| parsed(sections).unwrap_err().to_string();
        let unit = complaint("[cameras.a]\ndepth = \"a/*.png\"\n");
        assert!(unit.contains("unit_mm") && unit.contains("cameras.a") && unit.contains("never guessed"), "{unit}");
        let files = complaint("[cameras.a]\nlens = \"none\"\n");
        assert!(files.contains("image") && files.contains("depth"), "{files}");
        let key = complaint("[cameras.a]\nimages = \"a/*.png\"\n");
        assert!(key.contains(":7") && key.contains("cameras.a.image"), "{key}");
        assert!(complaint("").contains("[cameras.NAME]"));
        assert!(complaint("[depth]\nunit_mm = 1\n[cameras.a]\nimage = \"*\"\n").contains("depth"));
    }

    fn with_boards(boards: &str) -> Result<RigFile, DatasetError> {
        RigFile::parse(Path::new("set/dataset.toml"), &format!("{boards}[cameras.a]\nimage = \"*.png\"\n"))
    }

    fn tags(name: &str, first_tag: usize) -> String {
        format!(
            "[boards.{name}]\nkind = \"aprilgrid\"\ncolumns = 6\nrows = 5\nspacing_mm = 39\nmarker_mm = 30\nfirst_tag = {first_tag}\n"
        )
    }

    #[test]
    fn several_boards_are_told_apart_by_the_numbers_of_their_tags() {
        let board = with_boards(&(tags("wall", 0) + &tags("floor", 30))).unwrap().board;
        let names: Vec<(String, usize, std::ops::Range<usize>)> =
            board.parts().iter().map(|p| (p.name.to_owned(), p.first_tag, p.markers.clone())).collect();
        assert_eq!(names, [("wall".to_owned(), 0, 0..120), ("floor".to_owned(), 30, 120..240)]);
    }

    #[test]
    fn boards_that_look_alike_are_refused() {
        let complaint = |boards: &str| with_boards(boards).unwrap_err().to_string();
        let same = complaint(&(tags("wall", 0) + &tags("floor", 29)));
        assert!(same.contains("floor") && same.contains("wall") && same.contains("first_tag"), "{same}");
        let plain = "[boards.wall]\nkind = \"chessboard\"\ncolumns = 9\nrows = 6\nspacing_mm = 20\n";
        assert!(complaint(plain).contains("without tags"));
        let both =
            format!("[board]\nkind = \"chessboard\"\ncolumns = 9\nrows = 6\nspacing_mm = 20\n{}", tags("wall", 0));
        assert!(complaint(&both).contains("and so is board"));
        assert!(complaint("[boards]\n").contains("no section"));
    }
}
