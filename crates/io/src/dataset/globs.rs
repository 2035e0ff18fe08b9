//! Files that globs and lists find, paired to frames.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::candidate::Candidate;
use super::declaration::CameraSection;
use super::error::DatasetError;
use super::frame::{Frames, frame};
use super::inside::{file_in, within};
use super::natural;
use super::pairing::{self, Pairing, Stray};
use super::time_list::{is_list, read_list};

/// Frames whose files are found by a camera's globs or lists.
pub(super) fn globbed(
    root: &Path,
    file: &Path,
    camera: &CameraSection,
    within_s: Option<f64>,
) -> Result<Frames, DatasetError> {
    if camera.image.is_none() && camera.depth.is_none() {
        return Err(camera.files_missing(file));
    }
    let mut frames = Frames::default();
    let images = candidates(root, file, (camera, "image", &camera.image), &mut frames)?;
    let depth = candidates(root, file, (camera, "depth", &camera.depth), &mut frames)?;
    match (images, depth) {
        (Some(images), Some(depth)) => {
            // TUM's tool allows 20 ms where nothing else is said.
            let within_s = within_s.or((!frames.lists.is_empty()).then_some(0.02));
            add_pairs(root, file, camera, [&images, &depth], within_s, &mut frames)?;
        }
        (images, depth) => {
            let are_images = images.is_some();
            let files = images.or(depth).unwrap_or_default();
            // Two files of one stem would be two frames of one name.
            refuse_duplicates(file, &camera.field(if are_images { "image" } else { "depth" }), &files)?;
            let single = |candidate: &Candidate| {
                let (image, depth) = if are_images { (Some(candidate), None) } else { (None, Some(candidate)) };
                frame(candidate.stem(), image, depth, candidate.time_s)
            };
            frames.frames = files.iter().map(single).collect();
        }
    }
    Ok(frames)
}

/// The files of a camera's glob or list `pattern` of the kind `key`; `None` without a pattern. A list, and the files that it
/// names but that do not exist, are added to `frames`.
fn candidates(
    root: &Path,
    file: &Path,
    (camera, key, pattern): (&CameraSection, &str, &Option<String>),
    frames: &mut Frames,
) -> Result<Option<Vec<Candidate>>, DatasetError> {
    let Some(pattern) = pattern else { return Ok(None) };
    if !is_list(pattern) {
        return find_files(root, file, &camera.field(key), pattern).map(Some);
    }
    let list = file_in(root, pattern);
    let (files, missing): (Vec<_>, Vec<_>) = read_list(root, &list)?.into_iter().partition(|f| f.path.is_file());
    let stray = |f: &Candidate| Stray::file(root, &f.path, format!("{pattern} lists it, but there is no such file"));
    frames.strays.extend(missing.iter().map(stray));
    frames.lists.push(list);
    Ok(Some(files))
}

/// Pairs images with depth images, by time where `within_s` is given and else by name, and adds pairs and lone files to `frames`.
///
/// # Errors
/// [`DatasetError::Unpaired`] if nothing pairs, [`DatasetError::ImageIsDepth`] where an image would be its own depth, files
/// without a time, and names that occur twice.
fn add_pairs(
    root: &Path,
    file: &Path,
    camera: &CameraSection,
    [images, depth]: [&[Candidate]; 2],
    within_s: Option<f64>,
    frames: &mut Frames,
) -> Result<(), DatasetError> {
    let (pairing, pairs) = match within_s {
        Some(within_s) => {
            let no_time = |untimed| DatasetError::NoTime { path: file.to_owned(), file: untimed };
            (Pairing::Time { within_s }, pairing::by_time(images, depth, within_s).map_err(no_time)?)
        }
        None => {
            refuse_duplicates(file, &camera.field("image"), images)?;
            refuse_duplicates(file, &camera.field("depth"), depth)?;
            pairing::by_name(images, depth)
        }
    };
    let holds_one = |file: &Path| file.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("npz"));
    if let Some((_, i, _)) =
        pairs.iter().find(|(_, i, d)| images[*i].path == depth[*d].path && holds_one(&images[*i].path))
    {
        let (path, file, field) = (file.to_owned(), images[*i].path.clone(), camera.field("depth"));
        return Err(DatasetError::ImageIsDepth { path, field, file });
    }
    let lone_images = unpaired(images, pairs.iter().map(|pair| pair.1).collect());
    let lone_depth = unpaired(depth, pairs.iter().map(|pair| pair.2).collect());
    if pairs.is_empty() {
        let names = |paths: &[&Path]| {
            paths.iter().map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned()).collect()
        };
        return Err(DatasetError::Unpaired {
            path: file.to_owned(),
            images_without_depth: names(&lone_images),
            depth_without_image: names(&lone_depth),
        });
    }
    frames.strays.extend(lone_images.iter().map(|path| Stray::file(root, path, "no depth image pairs with it")));
    frames.strays.extend(lone_depth.iter().map(|path| Stray::file(root, path, "no image pairs with it")));
    let paired = |(name, i, d): (String, usize, usize)| {
        let time_s = if within_s.is_some() { images[i].time_s() } else { None };
        frame(name, Some(&images[i]), Some(&depth[d]), time_s)
    };
    frames.frames = pairs.into_iter().map(paired).collect();
    frames.pairing = pairing;
    Ok(())
}

/// Paths of the files whose positions are not in `paired`.
fn unpaired(files: &[Candidate], paired: BTreeSet<usize>) -> Vec<&Path> {
    (0..files.len()).filter(|i| !paired.contains(i)).map(|i| files[i].path.as_path()).collect()
}

/// Files that match the glob, in natural order.
pub(super) fn find_files(root: &Path, file: &Path, field: &str, pattern: &str) -> Result<Vec<Candidate>, DatasetError> {
    let glob_error = |message| DatasetError::Glob {
        path: file.to_owned(),
        field: field.to_owned(),
        pattern: pattern.to_owned(),
        message,
    };
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
        return Err(DatasetError::NoMatch {
            path: file.to_owned(),
            field: field.to_owned(),
            pattern: pattern.to_owned(),
            in_other_case: in_other_case(root, &full, options),
        });
    }
    files.sort_by(|a, b| natural::compare(&a.stem(), &b.stem()));
    Ok(files)
}

/// A file, as its path in the dataset's folder, that matches a glob where upper and lower case do not count.
fn in_other_case(root: &Path, full: &str, options: glob::MatchOptions) -> Option<String> {
    let options = glob::MatchOptions { case_sensitive: false, ..options };
    let mut paths = glob::glob_with(full, options).ok()?.flatten().filter(|path| path.is_file());
    paths.next().map(|path| path.strip_prefix(root).unwrap_or(&path).display().to_string())
}

fn refuse_duplicates(file: &Path, field: &str, files: &[Candidate]) -> Result<(), DatasetError> {
    let mut stems = BTreeMap::new();
    for candidate in files {
        if let Some(first) = stems.insert(candidate.stem(), candidate.path.clone()) {
            let second = candidate.path.clone();
            return Err(DatasetError::DuplicateStem { path: file.to_owned(), field: field.to_owned(), first, second });
        }
    }
    Ok(())
}
