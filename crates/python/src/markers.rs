//! Markers from arrays.

use depthcal_calibration::observe::MarkerObservation;
use pyo3::prelude::*;

use crate::arrays::{numbers, whole_numbers};
use crate::failure::{Failure, input};

/// Markers of a frame: numbers (n) or none where all markers of the board were found, positions in px (n, 2), standard
/// deviations in px (n) or none. None where the board was not found.
pub(crate) type MarkerArrays<'py> = Option<(Option<Bound<'py, PyAny>>, Bound<'py, PyAny>, Option<Bound<'py, PyAny>>)>;

/// Number of markers that are given without numbers, and are therefore all of the board; `None` where numbers are given.
pub(crate) fn count_without_numbers(given: &MarkerArrays<'_>) -> PyResult<Option<usize>> {
    match given {
        Some((None, pixels, _)) => Ok(Some(numbers("markers", pixels)?.slice()?.len() / 2)),
        _ => Ok(None),
    }
}

/// Refuses markers without numbers that are not all of the board.
pub(crate) fn check_all(frame: &str, count: Option<usize>, board: usize) -> Result<(), Failure> {
    match count {
        Some(count) if count != board && count > 0 => Err(input(format!(
            "frame '{frame}': corners has {count} markers, but the board has {board}: give all of them in the board's order, or \
             (ids, corners) where only some were found"
        ))),
        _ => Ok(()),
    }
}

/// Refuses markers outside the image.
pub(crate) fn check_inside(
    frame: &str,
    markers: &[MarkerObservation],
    (width, height): (usize, usize),
) -> Result<(), Failure> {
    let inside = |pixel: [f64; 2]| {
        let within = |place: f64, size: usize| (-0.5..=size as f64 - 0.5).contains(&place);
        within(pixel[0], width) && within(pixel[1], height)
    };
    match markers.iter().find(|marker| !inside(marker.pixel)) {
        Some(MarkerObservation { index, pixel: [u, v], .. }) => Err(input(format!(
            "frame '{frame}': marker {index} is at ({u:.1}, {v:.1}), outside the image, {width} × {height} px: give (u, v), the column \
             before the row, of images of this size"
        ))),
        None => Ok(()),
    }
}

/// Markers from arrays. Arrays may have further axes of length 1, as OpenCV's have.
pub(crate) fn markers_of(frame: &str, given: &MarkerArrays<'_>) -> Result<Vec<MarkerObservation>, Failure> {
    let Some((indices, pixels, stds)) = given else { return Ok(Vec::new()) };
    let pixels = numbers(&format!("frame '{frame}': markers"), pixels)?;
    let (positions, odd) = pixels.slice()?.as_chunks::<2>();
    let (shape, n) = (pixels.shape(), positions.len());
    if n == 0 && odd.is_empty() {
        return Ok(Vec::new());
    }
    if shape.last() != Some(&2) || shape.len() < 2 {
        return Err(input(format!(
            "frame '{frame}': markers have the shape {shape:?}: give (u, v) in px, an array (n, 2) or (n, 1, 2)"
        )));
    }
    let indices = match indices {
        Some(indices) => whole_numbers(&format!("frame '{frame}': numbers of markers"), indices)?,
        None => (0..n as i64).collect(),
    };
    let stds = stds.as_ref().map(|stds| numbers(&format!("frame '{frame}': standard deviations"), stds)).transpose()?;
    let stds = stds.as_ref().map(|stds| stds.slice()).transpose()?;
    if indices.len() != n {
        let given = indices.len();
        return Err(input(format!(
            "frame '{frame}': {given} numbers of markers, but positions of the shape {shape:?}: give one row (u, v) per marker"
        )));
    }
    if let Some(given) = stds.map(<[f64]>::len).filter(|given| *given != n) {
        return Err(input(format!("frame '{frame}': {given} standard deviations of {n} markers: give one per marker")));
    }
    let marker = |(i, (index, pixel)): (usize, (&i64, &[f64; 2]))| {
        let index = usize::try_from(*index)
            .map_err(|_| input(format!("frame '{frame}': marker {index} does not exist: numbers begin at 0")))?;
        Ok(MarkerObservation { index, pixel: *pixel, std_px: stds.map_or(1.0, |stds| stds[i]) })
    };
    indices.iter().zip(positions).enumerate().map(marker).collect()
}
