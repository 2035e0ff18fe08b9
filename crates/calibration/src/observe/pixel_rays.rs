//! The ray of every pixel of a camera, computed once for all frames.

use depthcal_model::hook::HookKind;
use depthcal_model::{Camera, Context, Covariate};
use rayon::prelude::*;

/// Rows of the table that one task computes.
const ROWS: usize = 24;

/// A camera with the rays (X/Z, Y/Z) of all pixels of its image.
#[derive(Debug)]
pub struct PixelRays<'a> {
    camera: &'a Camera,
    /// Row by row, NaN where the lens has no inverse; empty for a lens whose rays depend on depth.
    table: Vec<[f64; 2]>,
    has_pixel_pieces: bool,
    needs_surroundings: bool,
}

impl<'a> PixelRays<'a> {
    /// The rays of a camera: a table where the lens is the same at all depths.
    pub fn new(camera: &'a Camera) -> Self {
        let mut table = Vec::new();
        if camera.has_fixed_rays() {
            table = vec![[0.0; 2]; camera.width * camera.height];
            let tasks = table.par_chunks_mut((ROWS * camera.width).max(1)).enumerate();
            tasks.for_each(|(i, rows)| camera.rays_of_rows(i * ROWS, rows));
        }
        let has_pixel_pieces = Self::has_pixel_pieces_of(camera);
        Self { camera, table, has_pixel_pieces, needs_surroundings: needs_surroundings(camera) }
    }

    /// The same for pixels that are then corrected by `camera`: they get the covariates that its pieces need.
    pub fn to_be_corrected_by(mut self, camera: &Camera) -> Self {
        self.needs_surroundings |= needs_surroundings(camera);
        self
    }

    /// Whether pixels need the amplitude around them.
    pub fn needs_surroundings(&self) -> bool {
        self.needs_surroundings
    }

    /// The camera.
    pub fn camera(&self) -> &'a Camera {
        self.camera
    }

    /// Whether a camera has pixel pieces, so that pixels of the depth image are not those of the image.
    pub fn has_pixel_pieces_of(camera: &Camera) -> bool {
        camera.blocks().iter().any(|b| b.piece().is_some() && b.hook() == HookKind::Pixel)
    }

    /// Whether the rays depend on the depth.
    pub fn depend_on_depth(&self) -> bool {
        self.table.is_empty()
    }

    /// The ray of a pixel of the depth image at a depth (mm); `None` where the lens has no inverse.
    pub fn ray(&self, context: &Context, depth_mm: f64) -> Option<[f64; 2]> {
        if self.table.is_empty() {
            return self.camera.ray(self.camera.image_pixel(context), 1.0 / depth_mm).ok();
        }
        if !self.has_pixel_pieces {
            return self.at(context.pixel, depth_mm);
        }
        self.at(self.camera.image_pixel(context), depth_mm)
    }

    /// The ray of a pixel of the image, from the table where it is one of its grid.
    fn at(&self, [u, v]: [f64; 2], depth_mm: f64) -> Option<[f64; 2]> {
        let (width, height) = (self.camera.width, self.camera.height);
        let (column, row) = (u.round(), v.round());
        let inside = column >= 0.0 && row >= 0.0 && column < width as f64 && row < height as f64;
        let near = inside.then(|| self.table[row as usize * width + column as usize]).filter(|ray| !ray[0].is_nan());
        match near {
            Some(ray) if u == column && v == row => Some(ray),
            near => self.camera.ray_near([u, v], 1.0 / depth_mm, near).ok(),
        }
    }
}

fn needs_surroundings(camera: &Camera) -> bool {
    let pieces = camera.blocks().iter().filter_map(|b| b.piece());
    pieces.into_iter().any(|p| p.needs().contains(&Covariate::Surroundings))
}
