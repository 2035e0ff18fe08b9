//! The image files of `apply`: which there are, which belong together, and colour images.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use depthcal_io::{IMAGE_EXTENSIONS, RgbImage, read_rgb};

use crate::failure::{Failure, input};

/// A colour image of the size of a depth image.
pub(super) fn read_color(path: &Path, [width, height]: [usize; 2]) -> Result<RgbImage, Failure> {
    let image = read_rgb(path).map_err(input)?;
    if [image.width, image.height] != [width, height] {
        return Err(Failure::Input(format!(
            "{}: the colour image has {}×{} px, the depth {}×{}: register the colour to the depth first",
            path.display(),
            image.width,
            image.height,
            width,
            height
        )));
    }
    Ok(image)
}

/// Images and folders of images by the stems of their names.
pub(super) fn by_stem(paths: &[PathBuf]) -> Result<BTreeMap<String, PathBuf>, Failure> {
    let mut images = BTreeMap::new();
    for path in paths {
        let files = if path.is_dir() { images_in(path, IMAGE_EXTENSIONS)? } else { vec![path.clone()] };
        images.extend(files.into_iter().map(|path| (stem(&path), path)));
    }
    Ok(images)
}

/// The images of a folder in the order of their names. Hidden files are temporary or the operating system's.
pub(super) fn images_in(folder: &Path, extensions: &[&str]) -> Result<Vec<PathBuf>, Failure> {
    let unreadable = |error| Failure::Input(format!("{}: cannot read the folder: {error}", folder.display()));
    let mut images = Vec::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
        let known = path.extension().is_some_and(|e| extensions.iter().any(|known| e.eq_ignore_ascii_case(known)));
        if known && !hidden && path.is_file() {
            images.push(path);
        }
    }
    if images.is_empty() {
        let kinds = extensions.join(", ");
        return Err(Failure::Input(format!(
            "{}: the folder holds no images ({kinds}); check the path",
            folder.display()
        )));
    }
    images.sort();
    Ok(images)
}

/// A file's name without its extension: what depth, infrared and colour images of a frame have in common.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}
