//! Rows of a table that belong to frames which were found without it.

use std::collections::BTreeMap;
use std::path::Path;

use super::error::DatasetError;
use super::frame::{Frame, Frames};
use super::frame_table::Row;
use super::pairing::Stray;

/// Gives the frames of every camera their rows. Frames without a row, and rows without a frame of any camera, become strays.
///
/// # Errors
/// [`DatasetError::Rows`] where no row belongs to a frame of a camera.
pub(super) fn assign_rows(table: &Path, rows: &[Row], cameras: &mut [Frames]) -> Result<(), DatasetError> {
    let name = table.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut has_frame = vec![false; rows.len()];
    let mut frames_without_row: Vec<Vec<Frame>> = Vec::new();
    for camera in cameras.iter_mut() {
        let rows_of_names = rows_of(rows, &camera.frames);
        let mut with = Vec::new();
        let mut without = Vec::new();
        for (mut frame, row) in std::mem::take(&mut camera.frames).into_iter().zip(rows_of_names) {
            let Some(row) = row else {
                without.push(frame);
                continue;
            };
            has_frame[row] = true;
            let time_s = frame.metadata.timestamp_s;
            frame.metadata = rows[row].metadata.clone();
            frame.metadata.timestamp_s = frame.metadata.timestamp_s.or(time_s);
            with.push(frame);
        }
        camera.frames = with;
        frames_without_row.push(without);
    }
    let lone_rows = || rows.iter().zip(&has_frame).filter(|(_, has)| !**has).map(|(row, _)| row.frame.clone());
    for (camera, without) in cameras.iter_mut().zip(frames_without_row) {
        if camera.frames.is_empty() {
            let frames_without_row = without.into_iter().map(|frame| frame.name).collect();
            let rows_without_frame = lone_rows().collect();
            return Err(DatasetError::Rows { path: table.to_owned(), rows_without_frame, frames_without_row });
        }
        let stray = |frame: Frame| Stray { name: frame.name, reason: format!("{name} has no row of it") };
        camera.strays.extend(without.into_iter().map(stray));
    }
    let stray = |row: String| Stray {
        name: format!("row {row}"),
        reason: format!("{name} has it, but there is no such frame"),
    };
    if let Some(first) = cameras.first_mut() {
        first.strays.extend(lone_rows().map(stray));
    }
    Ok(())
}

/// The row of every frame: a row names the frame, or one of its files with or without extension. Of several rows the last counts.
fn rows_of(rows: &[Row], frames: &[Frame]) -> Vec<Option<usize>> {
    let mut frames_of: BTreeMap<String, usize> = BTreeMap::new();
    for (index, frame) in frames.iter().enumerate() {
        frames_of.insert(frame.name.clone(), index);
        for path in [&frame.image, &frame.depth].into_iter().flatten() {
            let name = |part: Option<&std::ffi::OsStr>| part.map(|name| name.to_string_lossy().into_owned());
            for name in [name(path.file_name()), name(path.file_stem())].into_iter().flatten() {
                frames_of.entry(name).or_insert(index);
            }
        }
    }
    let frame_of = |row: &Row| {
        frames_of.get(&row.frame).or_else(|| frames_of.get(Path::new(&row.frame).file_stem()?.to_str()?)).copied()
    };
    let mut rows_of = vec![None; frames.len()];
    for (number, row) in rows.iter().enumerate() {
        if let Some(frame) = frame_of(row) {
            rows_of[frame] = Some(number);
        }
    }
    rows_of
}
