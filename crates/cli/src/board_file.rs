//! Boards in files that have nothing else.

use std::fs;
use std::path::Path;

use depthcal_io::DatasetFile;
use depthcal_model::Target;

use super::failure::{Failure, input};

/// The section `[board]` of a file that may have nothing else.
pub(super) fn read_board(path: &Path) -> Result<Target, Failure> {
    let mut text = fs::read_to_string(path)
        .map_err(|error| Failure::Input(format!("{}: cannot read: {error}", path.display())))?;
    if !text.lines().any(|line| line.trim() == "[frames]") {
        text.push_str("\n[frames]\nimage = \"*\"\n");
    }
    Ok(DatasetFile::parse(path, &text).map_err(input)?.board)
}
