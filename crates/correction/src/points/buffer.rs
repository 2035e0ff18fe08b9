//! The buffer that points are written to.

use crate::bands::Split;

/// A buffer for the points of all pixels, row-major: x, y, z in mm in the camera frame, NaN where there is no depth or
/// no ray.
#[derive(Debug)]
pub enum PointsMut<'a> {
    /// x y z x y z …, three values per pixel.
    Interleaved(&'a mut [f32]),
    /// A plane each of x, y and z, one value per pixel.
    Planes([&'a mut [f32]; 3]),
}

impl PointsMut<'_> {
    /// The part of `count` pixels from `first` on.
    #[inline(always)]
    pub(crate) fn part(&mut self, first: usize, count: usize) -> PointsMut<'_> {
        match self {
            Self::Interleaved(out) => PointsMut::Interleaved(&mut out[3 * first..3 * (first + count)]),
            Self::Planes(planes) => PointsMut::Planes(planes.each_mut().map(|p| &mut p[first..first + count])),
        }
    }
}

impl Split for PointsMut<'_> {
    fn split(self, pixels: usize) -> (Self, Self) {
        match self {
            Self::Interleaved(out) => {
                let (a, b) = out.split_at_mut(3 * pixels);
                (Self::Interleaved(a), Self::Interleaved(b))
            }
            Self::Planes([x, y, z]) => {
                let ((x0, x1), (y0, y1), (z0, z1)) =
                    (x.split_at_mut(pixels), y.split_at_mut(pixels), z.split_at_mut(pixels));
                (Self::Planes([x0, y0, z0]), Self::Planes([x1, y1, z1]))
            }
        }
    }
}
