//! Input and output of a pass.

use crate::bands::Split;
use crate::points::PointsMut;

/// Measured depth: steps, or mm.
#[derive(Clone, Copy)]
pub(crate) enum Input<'a> {
    U16(&'a [u16]),
    F32(&'a [f32]),
    /// The values in the output buffer: correction in place.
    Output,
}

/// The buffer for results: corrected depth in steps or in mm, or points.
pub(crate) enum Output<'a> {
    U16(&'a mut [u16]),
    F32(&'a mut [f32]),
    Points(PointsMut<'a>),
}

impl Split for Output<'_> {
    fn split(self, pixels: usize) -> (Self, Self) {
        match self {
            Self::U16(out) => {
                let (a, b) = out.split(pixels);
                (Self::U16(a), Self::U16(b))
            }
            Self::F32(out) => {
                let (a, b) = out.split(pixels);
                (Self::F32(a), Self::F32(b))
            }
            Self::Points(out) => {
                let (a, b) = out.split(pixels);
                (Self::Points(a), Self::Points(b))
            }
        }
    }
}
