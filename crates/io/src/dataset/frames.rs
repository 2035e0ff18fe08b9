//! The frames of every camera of a dataset: files found by globs, lists and tables, paired, and given their rows of the table.

use std::path::Path;

use super::common_names::give_common_names;
use super::declaration::{DatasetFile, FILES};
use super::error::DatasetError;
use super::frame::Frames;
use super::frame_table;
use super::globs::globbed;
use super::inside::file_in;
use super::natural;
use super::rows::assign_rows;
use super::tabled::{associated, tabled};

/// Finds the frames that `file`, the `dataset.toml` in the folder `root`, declares, in the order of its cameras.
pub(super) fn find_frames(root: &Path, file: &Path, declared: &DatasetFile) -> Result<Vec<Frames>, DatasetError> {
    let cameras = declared.cameras.as_slice();
    let columns: Vec<String> = cameras.iter().flat_map(|camera| FILES.map(|kind| camera.column(kind))).collect();
    let table_path = declared.metadata.as_ref().map(|name| file_in(root, name));
    let table = table_path.as_deref().map(|path| frame_table::read(path, &columns)).transpose()?;
    let table = table_path.as_deref().zip(table);
    let mut frames = match (&declared.associations, &table) {
        (Some(list), _) => vec![associated(root, &file_in(root, list))?],
        (None, Some((path, table))) if !table.files.is_empty() => {
            let is_only = cameras.len() == 1;
            let find = |camera| tabled([root, file, path], camera, table, is_only);
            cameras.iter().map(find).collect::<Result<Vec<_>, _>>()?
        }
        (None, _) => {
            let find = |camera| globbed(root, file, camera, declared.within_s);
            let mut frames = cameras.iter().map(find).collect::<Result<Vec<_>, _>>()?;
            give_common_names(file, cameras, &mut frames, declared.within_s)?;
            frames
        }
    };
    if let Some((path, table)) = &table
        && (table.files.is_empty() || declared.associations.is_some())
    {
        assign_rows(path, &table.rows, &mut frames)?;
    }
    for camera in &mut frames {
        camera.lists.extend(table_path.clone());
        camera.frames.sort_by(|a, b| natural::compare(&a.name, &b.name));
        camera.strays.sort_by(|a, b| natural::compare(&a.name, &b.name));
    }
    Ok(frames)
}
