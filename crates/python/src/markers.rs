//! Markers and images from numpy arrays.

use depthcal_calibration::observe::MarkerObservation;
use depthcal_io::{DepthFrame, DepthValues, GrayImage};
use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::failure::{Failure, input};

/// Markers of a frame: numbers (n), positions in px (n, 2), standard deviations in px (n) or none.
pub(crate) type MarkerArrays<'py> =
    (PyReadonlyArray1<'py, i64>, PyReadonlyArray2<'py, f64>, Option<PyReadonlyArray1<'py, f64>>);

/// Markers from arrays.
pub(crate) fn markers_of(
    frame: &str,
    (indices, pixels, stds): &MarkerArrays<'_>,
) -> Result<Vec<MarkerObservation>, Failure> {
    let (indices, positions) = (indices.as_array(), pixels.as_array());
    let n = indices.len();
    if positions.shape() != [n, 2] || stds.as_ref().is_some_and(|s| s.as_array().len() != n) {
        let shape = positions.shape();
        return Err(Failure::Input(format!(
            "frame '{frame}': {n} numbers of markers, but positions of the shape {shape:?}: give one row (u, v) per marker"
        )));
    }
    let of = |i: usize| {
        let index = usize::try_from(indices[i])
            .map_err(|_| input(format!("frame '{frame}': marker {} does not exist: numbers begin at 0", indices[i])))?;
        let std_px = stds.as_ref().map_or(1.0, |s| s.as_array()[i]);
        Ok(MarkerObservation { index, pixel: [positions[[i, 0]], positions[[i, 1]]], std_px })
    };
    (0..n).map(of).collect()
}

/// Width and height of an image array.
fn size_of(frame: &str, what: &str, shape: &[usize]) -> Result<(usize, usize), Failure> {
    match shape {
        [height, width] if *height > 0 && *width > 0 => Ok((*width, *height)),
        other => Err(Failure::Input(format!(
            "frame '{frame}': {what} has the shape {other:?}: give an array (height, width) of one channel"
        ))),
    }
}

/// A grey image from an array of uint8 or uint16.
pub(crate) fn gray_of(frame: &str, array: &Bound<'_, PyAny>) -> Result<GrayImage, Failure> {
    if let Ok(array) = array.cast::<PyArrayDyn<u8>>() {
        let (width, height) = size_of(frame, "the image", array.shape())?;
        let data = array.readonly().as_array().iter().map(|v| u16::from(*v)).collect();
        return Ok(GrayImage { width, height, data, bits: 8 });
    }
    if let Ok(array) = array.cast::<PyArrayDyn<u16>>() {
        let (width, height) = size_of(frame, "the image", array.shape())?;
        let data = array.readonly().as_array().iter().copied().collect();
        return Ok(GrayImage { width, height, data, bits: 16 });
    }
    Err(Failure::Input(format!("frame '{frame}': the image must be an array of uint8 or uint16")))
}

/// A depth image from an array of uint16 (steps) or float32 (units).
pub(crate) fn depth_of(frame: &str, array: &Bound<'_, PyAny>) -> Result<DepthFrame, Failure> {
    if let Ok(array) = array.cast::<PyArrayDyn<u16>>() {
        let (width, height) = size_of(frame, "the depth image", array.shape())?;
        let values = DepthValues::Steps(array.readonly().as_array().iter().copied().collect());
        return Ok(DepthFrame { width, height, values });
    }
    if let Ok(array) = array.cast::<PyArrayDyn<f32>>() {
        let (width, height) = size_of(frame, "the depth image", array.shape())?;
        let values = DepthValues::Float(array.readonly().as_array().iter().copied().collect());
        return Ok(DepthFrame { width, height, values });
    }
    Err(Failure::Input(format!("frame '{frame}': the depth image must be an array of uint16 steps or float32")))
}
