//! A dataset of several cameras on one rigid body.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use depthcal_model::Target;

use super::candidate::Candidate;
use super::declaration::{DATASET_FILE, FramesSection};
use super::error::DatasetError;
use super::folder::{Dataset, folder_name, root_of};
use super::frame_table::{self, FrameMetadata, FrameTable};
use super::frames::{Frame, Frames, find_frames};
use super::inside::{file_in, within};
use super::natural;
use super::pairing::{self, Pairing, Stray};
use super::rig_declaration::{CameraSection, RigFile, declares_cameras};
use super::text::read_text;

/// Captures of a board by several cameras, described by a `dataset.toml` with sections `[cameras.NAME]`.
#[derive(Debug, Clone, PartialEq)]
pub struct RigDataset {
    /// The folder.
    pub root: PathBuf,
    /// The folder's name.
    pub name: String,
    /// The board.
    pub target: Target,
    /// The cameras, each as a dataset of its own whose frames have the names of the rig's frames; the first is the reference.
    pub cameras: Vec<RigMember>,
    /// How files of different cameras were paired.
    pub pairing: Pairing,
}

/// A camera of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct RigMember {
    /// The camera's name.
    pub name: String,
    /// Its frames. Frames that this camera missed are not among them.
    pub dataset: Dataset,
}

impl RigMember {
    /// Whether it has images.
    pub fn has_images(&self) -> bool {
        self.dataset.frames.iter().any(|frame| frame.image.is_some())
    }
}

impl RigDataset {
    /// Whether the dataset in the folder `path`, or described by the file `path`, declares several cameras.
    pub fn is_rig(path: impl AsRef<Path>) -> bool {
        let file = root_of(path.as_ref()).join(DATASET_FILE);
        read_text(&file).is_ok_and(|text| declares_cameras(&file, &text))
    }

    /// Opens the dataset in the folder `path`, or the one whose `dataset.toml` is `path`. Image files are listed, not read.
    ///
    /// # Errors
    /// [`DatasetError`] with the file, the field and the remedy.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, DatasetError> {
        let root = root_of(path.as_ref());
        let file = root.join(DATASET_FILE);
        let declared = RigFile::read(&file)?;
        let table_path = declared.metadata.as_ref().map(|name| file_in(root, name));
        let table = table_path.as_deref().map(frame_table::read).transpose()?;
        let of_table = table.as_ref().is_some_and(|table| {
            declared.cameras.iter().any(|c| table.columns.iter().any(|name| is_column_of(name, &c.name)))
        });
        let (mut by_camera, pairing) = if let (true, Some(table), Some(path)) = (of_table, &table, &table_path) {
            (tabled(root, path, table, &declared)?, Pairing::Table)
        } else {
            matched(root, &file, &declared)?
        };
        if let (false, Some(table)) = (of_table, table) {
            give_rows(table, &mut by_camera);
        }
        let mut cameras = Vec::new();
        for (section, mut listing) in declared.cameras.into_iter().zip(by_camera) {
            let has_depth = listing.frames.iter().any(|frame| frame.depth.is_some());
            if has_depth && section.unit_mm.is_none() {
                return Err(DatasetError::MissingField {
                    path: file,
                    field: "cameras.NAME.unit_mm",
                    remedy: "give the millimetres per step of every camera's depth images; they are never guessed",
                });
            }
            listing.frames.sort_by(|a, b| natural::compare(&a.name, &b.name));
            listing.lists.extend(table_path.clone());
            let dataset = Dataset {
                root: root.to_owned(),
                name: format!("{}/{}", folder_name(root), section.name),
                target: declared.board.clone(),
                frames: listing.frames,
                depth_unit_mm: section.unit_mm,
                camera: section.camera,
                metadata: table_path.clone(),
                pairing: listing.pairing,
                strays: listing.strays,
                lists: listing.lists,
            };
            dataset.check_intrinsics()?;
            cameras.push(RigMember { name: section.name, dataset });
        }
        Ok(Self { name: folder_name(root), root: root.to_owned(), target: declared.board, cameras, pairing })
    }
}

fn is_column_of(column: &str, camera: &str) -> bool {
    column.strip_prefix(camera).is_some_and(|kind| matches!(kind, ".image" | ".depth"))
}

/// The frames of every camera where the table names their files.
fn tabled(root: &Path, path: &Path, table: &FrameTable, declared: &RigFile) -> Result<Vec<Frames>, DatasetError> {
    let folder = path.parent().unwrap_or(root);
    let mut by_camera: Vec<Frames> = declared.cameras.iter().map(|_| empty(Pairing::Table)).collect();
    for row in &table.rows {
        // Columns of files are no quantities of the frame.
        let files = |name: &str| declared.cameras.iter().any(|c| is_column_of(name, &c.name));
        let mut metadata = row.metadata.clone();
        metadata.other.retain(|name, _| !files(name));
        for (camera, listing) in declared.cameras.iter().zip(&mut by_camera) {
            let file = |kind: &str| {
                let given = row.metadata.other.get(&format!("{}.{kind}", camera.name));
                let outside = |given: &String| DatasetError::Outside {
                    path: path.to_owned(),
                    line: row.line,
                    given: given.clone(),
                };
                let inside = |given| within(root, folder, Path::new(given)).ok_or_else(|| outside(given));
                given.map(inside).transpose().map(|path| path.map(|path| root.join(path)))
            };
            let (image, depth) = (file("image")?, file("depth")?);
            if let Some(missing) = [&image, &depth].into_iter().flatten().find(|file| !file.is_file()) {
                let reason = format!("there is no file {}", missing.display());
                listing.strays.push(Stray { name: format!("row {}", row.frame), reason });
            } else if image.is_some() || depth.is_some() {
                listing.frames.push(Frame { name: row.frame.clone(), image, depth, metadata: metadata.clone() });
            }
        }
    }
    for (camera, listing) in declared.cameras.iter().zip(&by_camera) {
        if listing.frames.is_empty() {
            let problem = format!(
                "no row names a file of the camera {}: fill a column {}.image or {}.depth with paths relative to this table's folder",
                camera.name, camera.name, camera.name
            );
            return Err(DatasetError::Table { path: path.to_owned(), line: 1, problem });
        }
    }
    Ok(by_camera)
}

fn empty(pairing: Pairing) -> Frames {
    Frames { frames: Vec::new(), pairing, strays: Vec::new(), lists: Vec::new() }
}

/// The frames of every camera, found by its globs or lists, with common names.
fn matched(root: &Path, file: &Path, declared: &RigFile) -> Result<(Vec<Frames>, Pairing), DatasetError> {
    let frames_of = |camera: &CameraSection| {
        let section = FramesSection {
            image: camera.image.clone(),
            depth: camera.depth.clone(),
            within_s: declared.within_s,
            ..FramesSection::default()
        };
        find_frames(root, file, &section)
    };
    let mut by_camera = declared.cameras.iter().map(frames_of).collect::<Result<Vec<_>, _>>()?;
    let mut pairing = declared.within_s.map_or(Pairing::Stem, |within_s| Pairing::Time { within_s });
    let (first, others) = match by_camera.split_first_mut() {
        Some(split) => split,
        None => return Ok((by_camera, pairing)),
    };
    // The frames that some camera has, with their times.
    let mut known: Vec<Candidate> = first.frames.iter().map(candidate).collect();
    for (camera, listing) in declared.cameras.iter().skip(1).zip(others) {
        let theirs: Vec<Candidate> = listing.frames.iter().map(candidate).collect();
        let pairs = match declared.within_s {
            Some(within_s) => {
                let no_time = |timeless| DatasetError::NoTime { path: file.to_owned(), file: timeless };
                pairing::by_time(&known, &theirs, within_s).map_err(no_time)?
            }
            None => {
                let (rule, pairs) = pairing::by_name(&known, &theirs);
                if rule != Pairing::Stem {
                    pairing = rule;
                }
                pairs
            }
        };
        let names: BTreeMap<usize, String> =
            pairs.into_iter().map(|(_, k, number)| (number, known[k].stem())).collect();
        for (number, frame) in listing.frames.iter_mut().enumerate() {
            match names.get(&number) {
                Some(name) => frame.name.clone_from(name),
                None => {
                    if known.iter().any(|k| k.stem() == frame.name) {
                        frame.name = format!("{}_{}", camera.name, frame.name);
                    }
                    known.push(Candidate { path: named(&frame.name), time_s: theirs[number].time_s() });
                }
            }
        }
    }
    Ok((by_camera, pairing))
}

/// A path whose stem is the name, dots included.
fn named(name: &str) -> PathBuf {
    PathBuf::from(format!("{name}.frame"))
}

fn candidate(frame: &Frame) -> Candidate {
    Candidate { path: named(&frame.name), time_s: frame.metadata.timestamp_s }
}

/// Gives frames the rows of their names. Frames without a row keep their own times.
fn give_rows(table: FrameTable, by_camera: &mut [Frames]) {
    let rows: BTreeMap<String, FrameMetadata> = table.rows.into_iter().map(|row| (row.frame, row.metadata)).collect();
    for frame in by_camera.iter_mut().flat_map(|listing| &mut listing.frames) {
        if let Some(row) = rows.get(&frame.name) {
            let own_time = frame.metadata.timestamp_s;
            frame.metadata = row.clone();
            frame.metadata.timestamp_s = frame.metadata.timestamp_s.or(own_time);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const BOARD: &str = "[board]\nkind = \"chessboard\"\ncolumns = 9\nrows = 6\nspacing_mm = 20\n";

    fn opened(declaration: &str, files: &[&str], table: Option<&str>) -> Result<RigDataset, DatasetError> {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        if let Some(table) = table {
            fs::write(folder.path().join("frames.csv"), table).unwrap();
        }
        fs::write(folder.path().join(DATASET_FILE), format!("{BOARD}{declaration}")).unwrap();
        RigDataset::open(folder.path())
    }

    fn names(rig: &RigDataset, camera: usize) -> Vec<&str> {
        rig.cameras[camera].dataset.frames.iter().map(|f| f.name.as_str()).collect()
    }

    const TWO: &str =
        "[cameras.ir]\nimage = \"ir/*.png\"\ndepth = \"d/*.png\"\nunit_mm = 1\n[cameras.rgb]\nimage = \"rgb/*.png\"\n";

    #[test]
    fn frames_that_a_camera_missed_count_for_the_others() {
        let files = ["ir/1.png", "ir/2.png", "d/1.png", "d/2.png", "rgb/2.png", "rgb/3.png"];
        let rig = opened(TWO, &files, None).unwrap();
        assert_eq!((names(&rig, 0), names(&rig, 1)), (vec!["1", "2"], vec!["2", "3"]));
        assert!(rig.cameras.iter().all(RigMember::has_images));
        assert_eq!(rig.cameras[0].dataset.depth_unit_mm, Some(1.0));
    }

    #[test]
    fn frames_are_matched_by_numbers_by_times_and_by_tables() {
        let files = ["ir/ir_1.png", "ir/ir_2.png", "d/d_1.png", "d/d_2.png", "rgb/rgb_02.png"];
        let rig = opened(TWO, &files, None).unwrap();
        assert_eq!(names(&rig, 1), vec![names(&rig, 0)[1]]);
        let files = ["ir/1.00.png", "ir/2.00.png", "d/1.001.png", "d/2.001.png", "rgb/2.012.png", "rgb/2.5.png"];
        let timed = format!("{TWO}[frames]\nwithin_s = 0.02\n");
        let rig = opened(&timed, &files, None).unwrap();
        assert_eq!((names(&rig, 0), names(&rig, 1)), (vec!["1.00", "2.00"], vec!["2.00", "2.5"]));
        let table = "frame,timestamp_s,ir.image,ir.depth,rgb.image\na,1,ir/x.png,d/x.png,\nb,2,,,rgb/y.png\n";
        let tabled = format!("{TWO}[frames]\nmetadata = \"frames.csv\"\n");
        let rig = opened(&tabled, &["ir/x.png", "d/x.png", "rgb/y.png"], Some(table)).unwrap();
        assert_eq!((names(&rig, 0), names(&rig, 1)), (vec!["a"], vec!["b"]));
        let metadata = &rig.cameras[1].dataset.frames[0].metadata;
        assert!(metadata.timestamp_s == Some(2.0) && metadata.other.is_empty());
        let lacking = opened(&tabled, &["ir/x.png", "d/x.png"], Some("frame,ir.image\na,ir/x.png\n")).unwrap_err();
        assert!(lacking.to_string().contains("rgb.image"), "{lacking}");
    }

    #[test]
    fn commands_of_one_camera_say_what_they_met() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(DATASET_FILE), format!("{BOARD}{TWO}")).unwrap();
        assert!(RigDataset::is_rig(folder.path()));
        let error = Dataset::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("several cameras"), "{error}");
    }
}
