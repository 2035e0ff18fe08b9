//! Images of callers: depth in units, and infrared or grey images.

use std::path::Path;

use depthcal_io::{DepthFrame, DepthValues, GrayImage};
use pyo3::prelude::*;

use crate::arrays::{Values, array_of, exactly, type_name};
use crate::failure::{Failure, input};

/// Depth in units: whole steps, or floating-point numbers.
#[derive(Debug)]
pub(crate) enum Depth<'py> {
    Steps(Values<'py, u16>),
    Float(Values<'py, f32>),
}

impl<'py> Depth<'py> {
    pub fn new(what: &str, given: &Bound<'py, PyAny>) -> Result<Self, Failure> {
        let array = array_of(what, given)?;
        if let Some(steps) = exactly(what, array)? {
            return Ok(Self::Steps(steps));
        }
        if let Some(float) = exactly(what, array)? {
            return Ok(Self::Float(float));
        }
        let given = type_name(given);
        Err(input(format!(
            "{what} is {given}: give an array of uint16 (whole steps of unit_mm) or float32 (units of unit_mm)"
        )))
    }

    pub fn shape(&self) -> &[usize] {
        match self {
            Self::Steps(steps) => steps.shape(),
            Self::Float(float) => float.shape(),
        }
    }

    /// A copy of its values, row by row.
    pub fn to_values(&self) -> Result<DepthValues, Failure> {
        Ok(match self {
            Self::Steps(steps) => DepthValues::Steps(steps.slice()?.to_vec()),
            Self::Float(float) => DepthValues::Float(float.slice()?.to_vec()),
        })
    }

    /// Refuses a unit that is no length, and one that whole steps cannot have.
    pub fn check_unit(&self, what: &str, unit_mm: f64) -> Result<(), Failure> {
        if !(unit_mm.is_finite() && unit_mm > 0.0) {
            return Err(input(format!(
                "unit_mm is {unit_mm}: give the millimetres per unit of depth, a number above 0"
            )));
        }
        // The rule of depth in files, which asks for the type of values alone.
        let values = match self {
            Self::Steps(_) => DepthValues::Steps(Vec::new()),
            Self::Float(_) => DepthValues::Float(Vec::new()),
        };
        DepthFrame { width: 0, height: 0, values }.check_unit(Path::new(what), unit_mm).map_err(input)
    }
}

/// Width and height of an image's array.
fn size_of(what: &str, shape: &[usize]) -> Result<(usize, usize), Failure> {
    match shape {
        [height, width] if *height > 0 && *width > 0 => Ok((*width, *height)),
        other => Err(input(format!("{what} has the shape {other:?}: give an array (height, width) of one channel"))),
    }
}

/// A depth image of a dataset.
pub(crate) fn depth_frame(what: &str, given: &Bound<'_, PyAny>) -> Result<DepthFrame, Failure> {
    let depth = Depth::new(what, given)?;
    let (width, height) = size_of(what, depth.shape())?;
    Ok(DepthFrame { width, height, values: depth.to_values()? })
}

/// An infrared or grey image of any shape: 8 or 16 bits.
#[derive(Debug)]
pub(crate) enum Gray<'py> {
    Narrow(Values<'py, u8>),
    Wide(Values<'py, u16>),
}

impl<'py> Gray<'py> {
    pub fn new(what: &str, given: &Bound<'py, PyAny>) -> Result<Self, Failure> {
        let array = array_of(what, given)?;
        if let Some(wide) = exactly(what, array)? {
            return Ok(Self::Wide(wide));
        }
        if let Some(narrow) = exactly(what, array)? {
            return Ok(Self::Narrow(narrow));
        }
        Err(input(format!("{what} is {}: give an array of uint8 or uint16", type_name(given))))
    }

    pub fn shape(&self) -> &[usize] {
        match self {
            Self::Narrow(narrow) => narrow.shape(),
            Self::Wide(wide) => wide.shape(),
        }
    }

    /// Its values with 16 bits, row by row.
    pub fn widened(&self) -> Result<Vec<u16>, Failure> {
        Ok(match self {
            Self::Narrow(narrow) => narrow.slice()?.iter().map(|value| u16::from(*value)).collect(),
            Self::Wide(wide) => wide.slice()?.to_vec(),
        })
    }
}

/// An image of a dataset.
pub(crate) fn gray_image(what: &str, given: &Bound<'_, PyAny>) -> Result<GrayImage, Failure> {
    let gray = Gray::new(what, given)?;
    let (width, height) = size_of(what, gray.shape())?;
    let bits = if matches!(gray, Gray::Narrow(_)) { 8 } else { 16 };
    Ok(GrayImage { width, height, data: gray.widened()?, bits })
}
