//! Frames whose files a table or a list of pairs names.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::candidate::Candidate;
use super::declaration::{CameraSection, FILES};
use super::error::DatasetError;
use super::frame::{Frame, Frames, frame};
use super::frame_table::{FrameTable, Row};
use super::globs::find_files;
use super::inside::within;
use super::pairing::{Pairing, Stray};
use super::time_list::{is_list, read_associations};

/// Frames of TUM's associations.
pub(super) fn associated(root: &Path, list: &Path) -> Result<Frames, DatasetError> {
    let mut camera_frames = Frames { pairing: Pairing::Table, lists: vec![list.to_owned()], ..Frames::default() };
    let mut names = BTreeSet::new();
    for (image, depth) in read_associations(root, list)? {
        if let Some(missing) = [&image, &depth].into_iter().find(|file| !file.path.is_file()) {
            camera_frames.strays.push(Stray::file(
                root,
                &missing.path,
                "the list of pairs names it, but there is no such file",
            ));
            continue;
        }
        let name = image.stem();
        if !names.insert(name.clone()) {
            camera_frames.strays.push(Stray::file(
                root,
                &depth.path,
                format!("the image {name} has another depth image already"),
            ));
            continue;
        }
        camera_frames.frames.push(frame(name, Some(&image), Some(&depth), image.time_s));
    }
    if camera_frames.frames.is_empty() {
        let problem = "none of the files that it names exists: write paths relative to this list's folder";
        return Err(DatasetError::Table { path: list.to_owned(), line: 1, problem: problem.into() });
    }
    Ok(camera_frames)
}

/// Frames of a camera whose files a table names. Files that its globs find besides are strays.
pub(super) fn tabled(
    [root, file, path]: [&Path; 3],
    camera: &CameraSection,
    table: &FrameTable,
    is_only: bool,
) -> Result<Frames, DatasetError> {
    let mut camera_frames = Frames { pairing: Pairing::Table, ..Frames::default() };
    let image = Kind { key: "image", words: "image", glob: &camera.image };
    let depth = Kind { key: "depth", words: "depth image", glob: &camera.depth };
    let find = |kind: &Kind<'_>| kind.found_by_glob([root, file], camera, table);
    let (images, depths) = (find(&image)?, find(&depth)?);
    for row in &table.rows {
        let named = |kind: &Kind<'_>, files| kind.file([root, path], camera, table, row, files);
        let (image_file, depth_file) = (named(&image, &images)?, named(&depth, &depths)?);
        let lacks = |kind: &Kind<'_>, file: &Option<PathBuf>| {
            let problem = match file {
                None => format!("it names no {}", kind.words),
                Some(path) if !path.is_file() => {
                    format!("there is no file {}", path.strip_prefix(root).unwrap_or(path).display())
                }
                Some(_) => return None,
            };
            kind.is_wanted(camera, table).then_some(problem)
        };
        match lacks(&image, &image_file).or_else(|| lacks(&depth, &depth_file)) {
            // A frame that this camera missed, and another has.
            Some(_) if !is_only && image_file.is_none() && depth_file.is_none() => {}
            Some(reason) => camera_frames.strays.push(Stray { name: format!("row {}", row.frame), reason }),
            None => camera_frames.frames.push(Frame {
                name: row.frame.clone(),
                image: image_file,
                depth: depth_file,
                metadata: row.metadata.clone(),
            }),
        }
    }
    if camera_frames.frames.is_empty() {
        let reason = camera_frames
            .strays
            .first()
            .map_or_else(String::new, |stray| format!(" ({}: {})", stray.name, stray.reason));
        let [image, depth] = FILES.map(|kind| camera.column(kind));
        let problem = format!(
            "no row names the files of a frame in `{image}` or `{depth}`{reason}: write paths relative to this table's folder"
        );
        return Err(DatasetError::Table { path: path.to_owned(), line: 1, problem });
    }
    for (pattern, key) in [(&camera.image, "image"), (&camera.depth, "depth")] {
        let Some(pattern) = pattern.as_ref().filter(|pattern| !is_list(pattern)) else { continue };
        let used: BTreeSet<&PathBuf> =
            camera_frames.frames.iter().flat_map(|f| f.image.iter().chain(&f.depth)).collect();
        let lone: Vec<Candidate> = find_files(root, file, &camera.field(key), pattern)?
            .into_iter()
            .filter(|file| !used.contains(&file.path))
            .collect();
        let reason = "no row of the table names it";
        camera_frames.strays.extend(lone.iter().map(|candidate| Stray::file(root, &candidate.path, reason)));
    }
    Ok(camera_frames)
}

/// Images or depth images in a table.
struct Kind<'a> {
    key: &'static str,
    words: &'static str,
    glob: &'a Option<String>,
}

impl Kind<'_> {
    fn has_column(&self, camera: &CameraSection, table: &FrameTable) -> bool {
        table.files.contains(&camera.column(self.key))
    }

    /// Whether a frame has to have such a file.
    fn is_wanted(&self, camera: &CameraSection, table: &FrameTable) -> bool {
        self.has_column(camera, table) || self.glob.is_some()
    }

    /// Files by their stems: a kind without a column of its own is found by its glob, by the frame's name.
    fn found_by_glob(
        &self,
        [root, file]: [&Path; 2],
        camera: &CameraSection,
        table: &FrameTable,
    ) -> Result<BTreeMap<String, PathBuf>, DatasetError> {
        let files = match self.glob {
            Some(pattern) if !self.has_column(camera, table) && !is_list(pattern) => {
                find_files(root, file, &camera.field(self.key), pattern)?
            }
            _ => Vec::new(),
        };
        // Of several files of one stem the first counts.
        Ok(files.into_iter().rev().map(|file| (file.stem(), file.path)).collect())
    }

    /// The file of a row of the table at `path`.
    fn file(
        &self,
        [root, path]: [&Path; 2],
        camera: &CameraSection,
        table: &FrameTable,
        row: &Row,
        files: &BTreeMap<String, PathBuf>,
    ) -> Result<Option<PathBuf>, DatasetError> {
        if !self.has_column(camera, table) {
            return Ok(files.get(&row.frame).cloned());
        }
        let Some(given) = row.files.get(&camera.column(self.key)) else { return Ok(None) };
        let outside = || DatasetError::Outside { path: path.to_owned(), line: row.line, given: given.clone() };
        let folder = path.parent().unwrap_or(root);
        within(root, folder, Path::new(given)).map(|path| Some(root.join(path))).ok_or_else(outside)
    }
}
