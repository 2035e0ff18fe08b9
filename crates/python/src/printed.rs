//! Boards to print.

use std::path::PathBuf;

use depthcal_io::{BoardFiles, Paper};
use pyo3::prelude::*;

use crate::dataset::target_of;
use crate::failure::input;
use crate::running::run;

/// Page and ruler, mm; the section `[board]`; the files.
type Printed = ([f64; 2], f64, String, [PathBuf; 2]);

/// Writes the board of a JSON text to print into `out`, .pdf or .svg, and its section for a dataset.toml into the same folder.
#[pyfunction]
#[pyo3(signature = (board, out, paper))]
pub(crate) fn write_board(py: Python<'_>, board: &str, out: PathBuf, paper: Option<String>) -> PyResult<Printed> {
    let target = target_of(board)?;
    let paper = paper.map(|paper| paper.parse::<Paper>()).transpose().map_err(input)?;
    run(py, None, move |_| {
        let BoardFiles { page_mm, ruler_mm, section, written } =
            depthcal_io::write_board(&target, paper, &out, &tag_cells).map_err(input)?;
        Ok((page_mm, ruler_mm, section, written))
    })
}

#[cfg(feature = "detect")]
fn tag_cells(dictionary: &str, id: usize) -> Result<Vec<Vec<bool>>, String> {
    depthcal_detect::tag_cells(dictionary, id).map_err(|error| error.to_string())
}

#[cfg(not(feature = "detect"))]
fn tag_cells(_: &str, _: usize) -> Result<Vec<Vec<bool>>, String> {
    Err("this package was built without the dictionaries of tags (feature 'detect')".into())
}
