//! True rays of all pixels of a camera.

use depthcal_model::Camera;
use rayon::prelude::*;

use super::brown_conrady::BrownConrady;
use super::exact::exact;
use super::reach::Reach;
use super::real::Real;
use super::rows::Rows;
use crate::error::CorrectorError;
use crate::simd::dispatch;

/// True rays of all pixels of a camera's depth image: the inverse of pinhole and lens.
#[derive(Debug, Clone)]
pub struct Rays {
    camera: Camera,
    /// Lens and reach, where the fast method applies.
    fast: Option<(BrownConrady, Reach)>,
}

/// Rows per thread below which every thread has a single band.
const LOW: usize = 400;

impl Rays {
    /// Prepares for a camera. Where its lens depends on depth (focus breathing), the rays are those at a depth of 1 m.
    pub fn new(camera: &Camera) -> Self {
        let fast = BrownConrady::of(camera).map(|lens| (lens, Reach::of(camera, &lens)));
        Self { camera: camera.clone(), fast }
    }

    /// x = X/Z and y = Y/Z of all pixels, each in a row-major buffer, in f32: to within 1e-3 px. NaN where the lens
    /// maps no ray to the pixel.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`] where a buffer does not have one value per pixel.
    pub fn single(&self, out: [&mut [f32]; 2]) -> Result<(), CorrectorError> {
        self.fill(out)
    }

    /// [`Rays::single`] in f64: to within 1e-9 px.
    ///
    /// # Errors
    ///
    /// As [`Rays::single`].
    pub fn double(&self, out: [&mut [f64]; 2]) -> Result<(), CorrectorError> {
        self.fill(out)
    }

    fn fill<T: Real>(&self, [x, y]: [&mut [T]; 2]) -> Result<(), CorrectorError> {
        let (width, height) = (self.camera.width, self.camera.height);
        for length in [x.len(), y.len()] {
            if length != width * height {
                return Err(CorrectorError::Length {
                    what: "a buffer for rays",
                    found: length,
                    expected: width * height,
                });
            }
        }
        let threads = rayon::current_num_threads();
        // Two bands per thread, so that a thread that is free early finds more work. But the first rows of a band,
        // which cannot be extrapolated, take several times as long, so that low images have one band per thread.
        let bands = if threads == 1 || height < LOW * threads { threads } else { 2 * threads };
        let band = height.div_ceil(bands).max(8);
        let work = |(k, (x, y)): (usize, (&mut [T], &mut [T]))| self.rows(k * band, x, y);
        if threads == 1 {
            work((0, (x, y)));
        } else {
            x.par_chunks_mut(band * width).zip(y.par_chunks_mut(band * width)).enumerate().for_each(work);
        }
        Ok(())
    }

    /// The rays of whole rows from row `first` on.
    fn rows<T: Real>(&self, first: usize, x: &mut [T], y: &mut [T]) {
        let camera = &self.camera;
        match &self.fast {
            Some((lens, reach)) => dispatch(Rows { camera, lens, reach, first, x, y }),
            None => exact(camera, first * camera.width, x, y),
        }
    }
}
