//! The frames of a dataset: files found by globs, lists and tables, paired, and given their rows of the table.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::candidate::Candidate;
use super::declaration::{FramesSection, files_missing};
use super::error::DatasetError;
use super::frame_table::{self, FrameMetadata, FrameTable, Row};
use super::inside::{file_in, within};
use super::natural;
use super::pairing::{self, Pairing, Stray};
use super::time_list::{is_list, read_associations, read_list};

/// One capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Name of the frame: the common part of the stems of its files, or its name in the table that names its files.
    pub name: String,
    /// The image; `None` where the dataset declares none.
    pub image: Option<PathBuf>,
    /// The depth image; `None` where the dataset declares none.
    pub depth: Option<PathBuf>,
    /// Its row in the table of frames.
    pub metadata: FrameMetadata,
}

/// The frames of a dataset in natural order of their names, and what belongs to none.
#[derive(Debug, Default)]
pub(crate) struct Frames {
    pub frames: Vec<Frame>,
    pub pairing: Pairing,
    pub strays: Vec<Stray>,
    /// Tables and lists that were read.
    pub lists: Vec<PathBuf>,
}

/// Finds the frames that `[frames]` of `file`, the `dataset.toml` in the folder `root`, declares.
pub(crate) fn find_frames(root: &Path, file: &Path, section: &FramesSection) -> Result<Frames, DatasetError> {
    let table_path = section.metadata.as_ref().map(|name| file_in(root, name));
    let table = table_path.as_deref().map(frame_table::read).transpose()?;
    let mut listing = match (&section.associations, table) {
        (Some(list), table) => {
            let mut listing = associated(root, &file_in(root, list))?;
            if let (Some(path), Some(table)) = (&table_path, table) {
                assign_rows(path, table.rows, &mut listing)?;
            }
            listing
        }
        (None, Some(table)) if table.has_images || table.has_depth => tabled(root, file, section, table)?,
        (None, table) => {
            if section.image.is_none() && section.depth.is_none() {
                return Err(files_missing(file));
            }
            let mut listing = globbed(root, file, section)?;
            if let (Some(path), Some(table)) = (&table_path, table) {
                assign_rows(path, table.rows, &mut listing)?;
            }
            listing
        }
    };
    listing.lists.extend(table_path);
    listing.frames.sort_by(|a, b| natural::compare(&a.name, &b.name));
    listing.strays.sort_by(|a, b| natural::compare(&a.name, &b.name));
    Ok(listing)
}

/// Frames whose files are found by globs or lists.
fn globbed(root: &Path, file: &Path, section: &FramesSection) -> Result<Frames, DatasetError> {
    let mut listing = Frames::default();
    let mut find = |field, pattern: &Option<String>| -> Result<Option<Vec<Candidate>>, DatasetError> {
        let Some(pattern) = pattern else { return Ok(None) };
        if !is_list(pattern) {
            return find_files(root, file, field, pattern).map(Some);
        }
        let list = file_in(root, pattern);
        let (files, missing): (Vec<_>, Vec<_>) = read_list(root, &list)?.into_iter().partition(|f| f.path.is_file());
        listing.strays.extend(
            missing
                .iter()
                .map(|f| Stray::file(root, &f.path, format!("{pattern} lists it, but there is no such file"))),
        );
        listing.lists.push(list);
        Ok(Some(files))
    };
    let images = find("frames.image", &section.image)?;
    let depth = find("frames.depth", &section.depth)?;
    // TUM's tool allows 20 ms where nothing else is said.
    let lists = !listing.lists.is_empty() && section.image.is_some() && section.depth.is_some();
    let within_s = section.within_s.or(lists.then_some(0.02));
    let (Some(images), Some(depth)) = (&images, &depth) else {
        let are_images = images.is_some();
        let single = images.or(depth).unwrap_or_default();
        // Two files of one stem would be two frames of one name.
        refuse_duplicates(file, if are_images { "frames.image" } else { "frames.depth" }, &single)?;
        listing.frames = single
            .into_iter()
            .map(|candidate| {
                let (image, depth) = if are_images { (Some(&candidate), None) } else { (None, Some(&candidate)) };
                frame(candidate.stem(), image, depth, candidate.time_s)
            })
            .collect();
        return Ok(listing);
    };
    let (pairing, pairs) = match within_s {
        Some(within_s) => {
            let no_time = |timeless| DatasetError::NoTime { path: file.to_owned(), file: timeless };
            (Pairing::Time { within_s }, pairing::by_time(images, depth, within_s).map_err(no_time)?)
        }
        None => {
            refuse_duplicates(file, "frames.image", images)?;
            refuse_duplicates(file, "frames.depth", depth)?;
            pairing::by_name(images, depth)
        }
    };
    let left = |files: &[Candidate], used: BTreeSet<usize>| -> Vec<PathBuf> {
        (0..files.len()).filter(|i| !used.contains(i)).map(|i| files[i].path.clone()).collect()
    };
    let lone_images = left(images, pairs.iter().map(|pair| pair.1).collect());
    let lone_depth = left(depth, pairs.iter().map(|pair| pair.2).collect());
    if pairs.is_empty() {
        let names = |files: &[PathBuf]| {
            files.iter().map(|f| f.file_name().unwrap_or_default().to_string_lossy().into_owned()).collect()
        };
        return Err(DatasetError::Unpaired {
            path: file.to_owned(),
            images_without_depth: names(&lone_images),
            depth_without_image: names(&lone_depth),
        });
    }
    listing.strays.extend(lone_images.iter().map(|path| Stray::file(root, path, "no depth image pairs with it")));
    listing.strays.extend(lone_depth.iter().map(|path| Stray::file(root, path, "no image pairs with it")));
    let timed = within_s.is_some();
    listing.frames = pairs
        .into_iter()
        .map(|(name, i, d)| {
            let time_s = if timed { images[i].time_s() } else { None };
            frame(name, Some(&images[i]), Some(&depth[d]), time_s)
        })
        .collect();
    listing.pairing = pairing;
    Ok(listing)
}

fn frame(name: String, image: Option<&Candidate>, depth: Option<&Candidate>, timestamp_s: Option<f64>) -> Frame {
    let path = |file: Option<&Candidate>| file.map(|file| file.path.clone());
    let metadata = FrameMetadata { timestamp_s, ..FrameMetadata::default() };
    Frame { name, image: path(image), depth: path(depth), metadata }
}

/// Frames of TUM's associations.
fn associated(root: &Path, list: &Path) -> Result<Frames, DatasetError> {
    let mut listing = Frames { pairing: Pairing::Table, lists: vec![list.to_owned()], ..Frames::default() };
    let mut names = BTreeSet::new();
    for (image, depth) in read_associations(root, list)? {
        if let Some(missing) = [&image, &depth].into_iter().find(|file| !file.path.is_file()) {
            listing.strays.push(Stray::file(
                root,
                &missing.path,
                "the list of pairs names it, but there is no such file",
            ));
            continue;
        }
        let name = image.stem();
        if !names.insert(name.clone()) {
            listing.strays.push(Stray::file(
                root,
                &depth.path,
                format!("the image {name} has another depth image already"),
            ));
            continue;
        }
        listing.frames.push(frame(name, Some(&image), Some(&depth), image.time_s));
    }
    if listing.frames.is_empty() {
        let problem = "none of the files that it names exists: write paths relative to this list's folder";
        return Err(DatasetError::Table { path: list.to_owned(), line: 1, problem: problem.into() });
    }
    Ok(listing)
}

/// Frames whose files a table names. Files that the globs find besides are strays.
fn tabled(root: &Path, file: &Path, section: &FramesSection, table: FrameTable) -> Result<Frames, DatasetError> {
    let mut listing = Frames { pairing: Pairing::Table, ..Frames::default() };
    let Some(table_path) = section.metadata.as_ref().map(|name| file_in(root, name)) else { return Ok(listing) };
    let folder = table_path.parent().unwrap_or(root);
    // A kind without a column of its own is found by its glob, by the frame's name.
    let by_glob = |has: bool, field, pattern: &Option<String>| -> Result<BTreeMap<String, PathBuf>, DatasetError> {
        let files = match pattern {
            Some(pattern) if !has && !is_list(pattern) => find_files(root, file, field, pattern)?,
            _ => Vec::new(),
        };
        // Of several files of one stem the first counts.
        Ok(files.into_iter().rev().map(|file| (file.stem(), file.path)).collect())
    };
    let images = by_glob(table.has_images, "frames.image", &section.image)?;
    let depth = by_glob(table.has_depth, "frames.depth", &section.depth)?;
    let wants_image = table.has_images || section.image.is_some();
    let wants_depth = table.has_depth || section.depth.is_some();
    for row in table.rows {
        let file_of = |cell: &Option<String>, has: bool, files: &BTreeMap<String, PathBuf>| match cell {
            Some(given) if has => {
                let outside =
                    || DatasetError::Outside { path: table_path.clone(), line: row.line, given: given.clone() };
                within(root, folder, Path::new(given)).map(|path| Some(root.join(path))).ok_or_else(outside)
            }
            _ if has => Ok(None),
            _ => Ok(files.get(&row.frame).cloned()),
        };
        let (image, depth) =
            (file_of(&row.image, table.has_images, &images)?, file_of(&row.depth, table.has_depth, &depth)?);
        let lacks = |wants: bool, file: &Option<PathBuf>, what: &str| {
            let problem = match file {
                None => format!("it names no {what}"),
                Some(path) if !path.is_file() => {
                    format!("there is no file {}", path.strip_prefix(root).unwrap_or(path).display())
                }
                Some(_) => return None,
            };
            wants.then_some(problem)
        };
        match lacks(wants_image, &image, "image").or_else(|| lacks(wants_depth, &depth, "depth image")) {
            Some(reason) => listing.strays.push(Stray { name: format!("row {}", row.frame), reason }),
            None => listing.frames.push(Frame { name: row.frame, image, depth, metadata: row.metadata }),
        }
    }
    if listing.frames.is_empty() {
        let reason =
            listing.strays.first().map_or_else(String::new, |stray| format!(" ({}: {})", stray.name, stray.reason));
        let problem = format!("no row names the files of a frame{reason}: write paths relative to this table's folder");
        return Err(DatasetError::Table { path: table_path, line: 1, problem });
    }
    for (pattern, field) in [(&section.image, "frames.image"), (&section.depth, "frames.depth")] {
        let Some(pattern) = pattern.as_ref().filter(|pattern| !is_list(pattern)) else { continue };
        let used: BTreeSet<&PathBuf> = listing.frames.iter().flat_map(|f| f.image.iter().chain(&f.depth)).collect();
        let lone: Vec<Candidate> =
            find_files(root, file, field, pattern)?.into_iter().filter(|file| !used.contains(&file.path)).collect();
        let reason = "no row of the table names it";
        listing.strays.extend(lone.iter().map(|candidate| Stray::file(root, &candidate.path, reason)));
    }
    Ok(listing)
}

/// Files that match the glob, in natural order.
fn find_files(root: &Path, file: &Path, field: &'static str, pattern: &str) -> Result<Vec<Candidate>, DatasetError> {
    let glob_error =
        |message| DatasetError::Glob { path: file.to_owned(), field, pattern: pattern.to_owned(), message };
    let Some(folder) = root.to_str() else {
        return Err(glob_error("the folder's own name is not UTF-8, which no glob can match; rename it".into()));
    };
    let inside = within(root, root, Path::new(pattern));
    let Some(inside) = inside.as_deref().and_then(Path::to_str) else {
        return Err(glob_error("it leads out of the dataset's folder".into()));
    };
    let full = format!("{}/{inside}", glob::Pattern::escape(folder));
    // Hidden files are temporary or the operating system's; `*` must not match a `/`.
    let options =
        glob::MatchOptions { case_sensitive: true, require_literal_separator: true, require_literal_leading_dot: true };
    let paths = glob::glob_with(&full, options).map_err(|error| glob_error(error.to_string()))?;

    let mut files = Vec::new();
    for path in paths {
        let path = path.map_err(|error| DatasetError::Read { path: error.path().to_owned(), error: error.into() })?;
        if path.is_file() {
            files.push(Candidate { path, time_s: None });
        }
    }
    if files.is_empty() {
        return Err(DatasetError::NoMatch { path: file.to_owned(), field, pattern: pattern.to_owned() });
    }
    files.sort_by(|a, b| natural::compare(&a.stem(), &b.stem()));
    Ok(files)
}

fn refuse_duplicates(file: &Path, field: &'static str, files: &[Candidate]) -> Result<(), DatasetError> {
    let mut stems = BTreeMap::new();
    for candidate in files {
        if let Some(first) = stems.insert(candidate.stem(), candidate.path.clone()) {
            let second = candidate.path.clone();
            return Err(DatasetError::DuplicateStem { path: file.to_owned(), field, first, second });
        }
    }
    Ok(())
}

/// Gives frames their rows. Frames without a row, and rows without a frame, become strays.
fn assign_rows(table: &Path, rows: Vec<Row>, listing: &mut Frames) -> Result<(), DatasetError> {
    // A row names the frame, or one of its files with or without extension.
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    for (index, frame) in listing.frames.iter().enumerate() {
        places.insert(frame.name.clone(), index);
        for path in [&frame.image, &frame.depth].into_iter().flatten() {
            let name = |part: Option<&std::ffi::OsStr>| part.map(|name| name.to_string_lossy().into_owned());
            for name in [name(path.file_name()), name(path.file_stem())].into_iter().flatten() {
                places.entry(name).or_insert(index);
            }
        }
    }
    let place = |row: &Row| places.get(&row.frame).or_else(|| places.get(Path::new(&row.frame).file_stem()?.to_str()?));
    let mut has_row = vec![false; listing.frames.len()];
    let mut rows_without_frame = Vec::new();
    for row in rows {
        match place(&row) {
            Some(&index) => {
                has_row[index] = true;
                let own_time = listing.frames[index].metadata.timestamp_s;
                listing.frames[index].metadata = row.metadata;
                let timestamp = &mut listing.frames[index].metadata.timestamp_s;
                *timestamp = timestamp.or(own_time);
            }
            None => rows_without_frame.push(row.frame),
        }
    }
    let name = table.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut has = has_row.iter();
    let (frames, without): (Vec<_>, Vec<_>) =
        std::mem::take(&mut listing.frames).into_iter().partition(|_| has.next().is_some_and(|has| *has));
    if frames.is_empty() {
        let frames_without_row = without.into_iter().map(|frame| frame.name).collect();
        return Err(DatasetError::Rows { path: table.to_owned(), rows_without_frame, frames_without_row });
    }
    listing.frames = frames;
    listing.strays.extend(
        without.into_iter().map(|frame| Stray { name: frame.name, reason: format!("{name} has no row of it") }),
    );
    let of_row = |row: String| Stray {
        name: format!("row {row}"),
        reason: format!("{name} has it, but there is no such frame"),
    };
    listing.strays.extend(rows_without_frame.into_iter().map(of_row));
    Ok(())
}
