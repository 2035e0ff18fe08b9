//! Parameters that users hold at their nominal values.

use std::fmt;
use std::str::FromStr;

use depthcal_model::{Block, Camera};
use thiserror::Error;

use super::error::CalibrateError;

/// Text that names no parameter.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("'{given}' names no parameter: write PIECE.PARAMETER, such as brown_conrady.k3, or PIECE.PARAMETER=VALUE")]
pub struct HeldError {
    /// The text.
    pub given: String,
}

/// A parameter that is held instead of fitted, written `PIECE.PARAMETER` or `PIECE.PARAMETER=VALUE`: `brown_conrady.k3`,
/// `pinhole.cx=319.5`.
///
/// Without a value it keeps its declared one, or else its nominal one; the principal point, the image's middle.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldParameter {
    /// The piece, or `pinhole`.
    pub piece: String,
    /// The parameter.
    pub parameter: String,
    /// The value at which it is held, where one is given.
    pub value: Option<f64>,
}

impl fmt::Display for HeldParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.piece, self.parameter)
    }
}

impl FromStr for HeldParameter {
    type Err = HeldError;

    fn from_str(text: &str) -> Result<Self, HeldError> {
        let wrong = || HeldError { given: text.to_owned() };
        let (name, value) = match text.split_once('=') {
            Some((name, value)) => (name, Some(value.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(wrong)?)),
            None => (text, None),
        };
        match name.split_once('.') {
            Some((piece, parameter)) if !piece.is_empty() && !parameter.is_empty() => {
                Ok(Self { piece: piece.to_owned(), parameter: parameter.to_owned(), value })
            }
            _ => Err(wrong()),
        }
    }
}

/// The camera with parameters held; those that its blocks do not have are passed over, see [`check`].
pub(super) fn hold(camera: &Camera, held: &[HeldParameter], pinhole_is_declared: bool) -> Camera {
    if held.is_empty() {
        return camera.clone();
    }
    let middle = [camera.width, camera.height].map(|n| (n as f64 - 1.0) / 2.0);
    camera.map_blocks(|mut block| {
        for i in 0..block.theta.len() {
            let parameter = &block.parameters()[i];
            let is_this = |h: &&HeldParameter| h.piece == block.name() && h.parameter == parameter.name;
            let Some(this) = held.iter().find(is_this) else { continue };
            // All other parameters have their nominal or declared values before anything is fitted.
            match (this.value, block.piece().is_none() && !pinhole_is_declared, &*parameter.name) {
                (Some(value), ..) => block.theta[i] = value,
                (None, true, "cx") => block.theta[i] = middle[0],
                (None, true, "cy") => block.theta[i] = middle[1],
                _ => {}
            }
            block.free[i] = false;
        }
        block
    })
}

/// Refuses held parameters that none of the blocks has, and focal lengths that have no value to be held at.
///
/// # Errors
///
/// [`CalibrateError::UnknownHeld`], [`CalibrateError::HeldWithoutValue`].
pub(super) fn check<'a>(
    held: &[HeldParameter],
    blocks: impl Iterator<Item = &'a Block> + Clone,
    pinhole_is_declared: bool,
) -> Result<(), CalibrateError> {
    for h in held {
        let has = |b: &Block| b.name() == h.piece && b.parameters().iter().any(|p| p.name == h.parameter);
        if !blocks.clone().any(has) {
            // The fields of maps have too many to be listed.
            let few = blocks.clone().filter(|b| b.theta.len() <= 8);
            let names = few.flat_map(|b| b.parameters().iter().map(|p| format!("{}.{}", b.name(), p.name)));
            return Err(CalibrateError::UnknownHeld { held: h.to_string(), known: names.collect() });
        }
        if h.piece == "pinhole" && h.parameter.starts_with('f') && !pinhole_is_declared && h.value.is_none() {
            return Err(CalibrateError::HeldWithoutValue { held: h.to_string() });
        }
    }
    Ok(())
}
