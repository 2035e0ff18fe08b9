//! The ray of every pixel of a camera, computed once for all frames.

use std::borrow::Cow;

use depthcal_model::hook::HookKind;
use depthcal_model::{Camera, Context, Covariate, Modulation, PixelGrid, Target, needed_light};
use nalgebra::Isometry3;
use rayon::prelude::*;

use super::board_heights::BoardHeights;
use super::board_plane::BoardSurface;

/// Distances of the exactly computed pixels that are tried, widest first, px. Where none is fine enough every pixel is exact.
const STEPS: [usize; 4] = [16, 8, 4, 2];
/// Largest error of an interpolated ray on the normalised image plane: some hundred-thousandths of a pixel, or a ten-thousandth
/// of a millimetre at a metre.
const TOLERANCE: f64 = 1e-7;
/// Nodes to either side of a pixel that it is interpolated from.
const REACH: usize = 3;
/// Columns and rows of the pixels at which the interpolation is compared with exact rays.
const CHECKS: [usize; 2] = [9, 7];

/// A camera with the rays (X/Z, Y/Z) of all pixels of its image.
#[derive(Debug)]
pub struct PixelRays<'a> {
    camera: &'a Camera,
    /// Row by row, NaN where the lens has no inverse; empty for a lens whose rays depend on depth.
    table: Cow<'a, [[f64; 2]]>,
    /// Whether the table is that of the camera itself.
    is_exact: bool,
    has_pixel_pieces: bool,
    needs_surroundings: bool,
    modulation: Option<Modulation>,
    heights: Option<BoardHeights>,
}

impl<'a> PixelRays<'a> {
    /// The rays of a camera: a table where the lens is the same at all depths; and the surface that they meet, of a board.
    pub fn new(camera: &'a Camera, target: &Target) -> Self {
        let table = if camera.has_fixed_rays() { table(camera) } else { Vec::new() };
        Self::from_table(camera, target, Cow::Owned(table), true)
    }

    /// The rays of a camera that is nearly that of these, such as its fit to other frames, each computed where it is asked for: a
    /// table takes longer where few pixels are.
    pub fn of_similar<'b>(&'b self, camera: &'b Camera, target: &Target) -> PixelRays<'b> {
        let size = camera.width * camera.height;
        if !camera.has_fixed_rays() || self.table.len() != size {
            return PixelRays::new(camera, target);
        }
        PixelRays::from_table(camera, target, Cow::Borrowed(&self.table), false)
    }

    fn from_table(camera: &'a Camera, target: &Target, table: Cow<'a, [[f64; 2]]>, is_exact: bool) -> Self {
        let has_pixel_pieces = Self::has_pixel_pieces_of(camera);
        let (needs_surroundings, modulation) = (needs_surroundings(camera), light_of(camera));
        let heights = BoardHeights::new(camera, target);
        Self { camera, table, is_exact, has_pixel_pieces, needs_surroundings, modulation, heights }
    }

    /// These rays for pixels that are then corrected by `camera`: they get the covariates that its pieces need.
    pub fn to_be_corrected_by(mut self, camera: &Camera) -> Self {
        self.needs_surroundings |= needs_surroundings(camera);
        self.modulation = self.modulation.or_else(|| light_of(camera));
        self
    }

    /// These rays for pixels that need the light of their frame at these modulation frequencies.
    pub fn with_light(mut self, modulation: Option<Modulation>) -> Self {
        self.modulation = modulation.or(self.modulation);
        self
    }

    /// Modulation frequencies for which pixels need the light of their frame; `None` where they do not.
    pub fn modulation(&self) -> Option<Modulation> {
        self.modulation
    }

    /// Range over depth at the pixel with this row-major index, whatever the displacement of the depth image; 1 where the pixel
    /// has no ray.
    pub fn slant(&self, index: usize, depth_mm: f64) -> f64 {
        let width = self.camera.width.max(1);
        let pixel = [(index % width) as f64, (index / width) as f64];
        let ray =
            if self.table.is_empty() { self.camera.ray(pixel, 1.0 / depth_mm).ok() } else { self.at(pixel, depth_mm) };
        ray.map_or(1.0, |[x, y]| (1.0 + x * x + y * y).sqrt())
    }

    /// Whether pixels need the amplitude around them.
    pub fn needs_surroundings(&self) -> bool {
        self.needs_surroundings
    }

    /// The surface of the board in a pose.
    pub fn surface(&self, camera_from_board: &Isometry3<f64>) -> BoardSurface<'_> {
        BoardSurface::new(camera_from_board, self.heights.as_ref())
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

    /// The ray of a pixel of the depth image at a depth (mm); `None` where the lens has no inverse. Its covariates are asked for
    /// only where the ray depends on them.
    pub fn ray(&self, pixel: [f64; 2], depth_mm: f64, context: impl FnOnce() -> Context) -> Option<[f64; 2]> {
        if self.table.is_empty() {
            return self.camera.ray(self.camera.image_pixel(&context()), 1.0 / depth_mm).ok();
        }
        let of_image = if self.has_pixel_pieces { self.camera.image_pixel(&context()) } else { pixel };
        self.at(of_image, depth_mm)
    }

    /// The ray of a pixel of the image, from the table where it is one of its grid.
    fn at(&self, [u, v]: [f64; 2], depth_mm: f64) -> Option<[f64; 2]> {
        let (width, height) = (self.camera.width, self.camera.height);
        let inside = |c: f64, size: usize| (c > -0.5 && c < size as f64 - 0.5).then_some((c + 0.5) as usize);
        let nearest = inside(u, width).zip(inside(v, height));
        let near = nearest.map(|(column, row)| self.table[row * width + column]).filter(|ray| !ray[0].is_nan());
        match near {
            Some(ray)
                if self.is_exact && nearest.is_some_and(|(column, row)| [u, v] == [column as f64, row as f64]) =>
            {
                Some(ray)
            }
            near => self.camera.ray_near([u, v], 1.0 / depth_mm, near).ok(),
        }
    }
}

/// The modulation frequencies for which the pieces of a camera need the light of frames.
fn light_of(camera: &Camera) -> Option<Modulation> {
    needed_light(camera.blocks().iter().filter_map(|b| b.piece()).map(|p| &**p))
}

fn needs_surroundings(camera: &Camera) -> bool {
    let pieces = camera.blocks().iter().filter_map(|b| b.piece());
    pieces.into_iter().any(|p| p.needs().contains(&Covariate::Surroundings))
}

/// The rays of all pixels, row by row: exact on a grid, of fifth order between its nodes where that is as good.
fn table(camera: &Camera) -> Vec<[f64; 2]> {
    let fine_enough = STEPS.iter().map(|step| Nodes::of(camera, *step)).find(|nodes| nodes.error() <= TOLERANCE);
    fine_enough.map_or_else(
        || camera.rays_of_grid(&PixelGrid { first: [0.0; 2], step: 1.0, columns: camera.width, rows: camera.height }),
        |nodes| nodes.table(),
    )
}

/// Exact rays on a grid of pixels that reaches beyond the image by two nodes or more all round.
struct Nodes<'a> {
    camera: &'a Camera,
    step: usize,
    grid: PixelGrid,
    rays: Vec<[f64; 2]>,
}

/// Weights of the nodes at −2, −1, 0, 1, 2, 3 for the polynomial of fifth order through them, at t in [0, 1] (Lagrange).
fn quintic(t: f64) -> [f64; 2 * REACH] {
    std::array::from_fn(|i| {
        let node = |k: usize| k as f64 - (REACH as f64 - 1.0);
        (0..2 * REACH).filter(|k| *k != i).map(|k| (t - node(k)) / (node(i) - node(k))).product()
    })
}

fn combine(weights: &[f64; 2 * REACH], rays: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    weights.iter().zip(rays).fold([0.0; 2], |sum, (w, ray)| [sum[0] + w * ray[0], sum[1] + w * ray[1]])
}

impl<'a> Nodes<'a> {
    fn of(camera: &'a Camera, step: usize) -> Self {
        let nodes = |size: usize| size.div_ceil(step) + 2 * REACH - 1;
        let first = -((REACH - 1) as f64 * step as f64);
        let (columns, rows) = (nodes(camera.width), nodes(camera.height));
        let grid = PixelGrid { first: [first; 2], step: step as f64, columns, rows };
        Self { camera, step, grid, rays: camera.rays_of_grid(&grid) }
    }

    /// Rays of the nodes' columns at a row of the image.
    fn along_row(&self, v: usize) -> Vec<[f64; 2]> {
        let weights = quintic((v % self.step) as f64 / self.step as f64);
        let first = v / self.step;
        let node =
            |column: usize| (first..first + 2 * REACH).map(move |row| self.rays[row * self.grid.columns + column]);
        (0..self.grid.columns).map(|column| combine(&weights, node(column))).collect()
    }

    fn at(&self, row: &[[f64; 2]], weights: &[[f64; 2 * REACH]], u: usize) -> [f64; 2] {
        let first = u / self.step;
        combine(&weights[u % self.step], row[first..first + 2 * REACH].iter().copied())
    }

    fn weights(&self) -> Vec<[f64; 2 * REACH]> {
        (0..self.step).map(|i| quintic(i as f64 / self.step as f64)).collect()
    }

    /// Largest error of the interpolation at pixels half way between nodes, on the normalised image plane.
    fn error(&self) -> f64 {
        let weights = self.weights();
        let mut worst = 0.0_f64;
        for i in 0..CHECKS[1] {
            let half_way = |i: usize, n: usize, size: usize| {
                let node = (i * (size - 1) / (n - 1)) / self.step * self.step;
                (node + self.step / 2).min(size - 1)
            };
            let v = half_way(i, CHECKS[1], self.camera.height);
            let row = self.along_row(v);
            for j in 0..CHECKS[0] {
                let u = half_way(j, CHECKS[0], self.camera.width);
                let [x, y] = self.at(&row, &weights, u);
                if let Ok(exact) = self.camera.ray_near([u as f64, v as f64], 1e-3, Some([x, y])) {
                    // Where a node has no ray the pixel is computed exactly.
                    let error = (x - exact[0]).abs().max((y - exact[1]).abs());
                    worst = if error.is_nan() { worst } else { worst.max(error) };
                }
            }
        }
        worst
    }

    fn table(&self) -> Vec<[f64; 2]> {
        let weights = self.weights();
        let safe = 0.98 * self.camera.lens_limit();
        let mut table = vec![[0.0; 2]; self.camera.width * self.camera.height];
        let rows = table.par_chunks_mut(self.camera.width.max(1)).enumerate();
        rows.for_each(|(v, out)| {
            let row = self.along_row(v);
            for (u, ray) in out.iter_mut().enumerate() {
                *ray = self.at(&row, &weights, u);
                // Negated so that NaN counts as outside: near the lens' limit every pixel is exact.
                if !(ray[0] * ray[0] + ray[1] * ray[1] < safe * safe) {
                    *ray = self.camera.ray([u as f64, v as f64], 1e-3).unwrap_or([f64::NAN; 2]);
                }
            }
        });
        table
    }
}

#[cfg(test)]
mod tests {
    use depthcal_model::{Pattern, Register};

    use super::*;

    /// A mild and a strong lens, and one that folds within the image: the table is exact to the tolerance or empty-handed where
    /// the camera is.
    #[test]
    fn the_table_has_the_rays_of_the_camera() {
        let target = Target { pattern: Pattern::Chessboard, columns: 9, rows: 6, spacing_mm: 25.0 };
        for (focal, k) in [(480.0, [-0.15, 0.05]), (150.0, [-0.3, 0.09]), (300.0, [-0.5, 0.0])] {
            let mut lens = Register::builtin().block("brown_conrady", None).unwrap();
            lens.theta[..2].copy_from_slice(&k);
            lens.theta[2..4].copy_from_slice(&[1e-3, -2e-3]);
            let camera = Camera::new(321, 243, [focal, 1.01 * focal, 155.2, 126.1, 0.0], vec![lens]);
            let rays = PixelRays::new(&camera, &target);
            assert!(!rays.depend_on_depth());
            assert_rays_of(&camera, &rays, 5.0 * TOLERANCE);
            let mut theta = camera.theta();
            theta[0] *= 1.002;
            theta[5] *= 0.98;
            let other = camera.with_theta(&theta);
            assert_rays_of(&other, &rays.of_similar(&other, &target), 1e-9);
        }
    }

    fn assert_rays_of(camera: &Camera, rays: &PixelRays<'_>, tolerance: f64) {
        let focal = camera.pinhole()[0];
        for v in (0..243).step_by(7) {
            for u in (0..321).step_by(3) {
                let context = Context { pixel: [f64::from(u), f64::from(v)], ..Context::default() };
                match (rays.ray(context.pixel, 800.0, || context), camera.ray(context.pixel, 1e-3).ok()) {
                    (Some(a), Some(b)) => {
                        let error = (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
                        assert!(error < tolerance, "f {focal}, pixel {u}, {v}: {error:e}");
                    }
                    (a, b) => assert_eq!(a, b, "f {focal}, pixel {u}, {v}"),
                }
            }
        }
    }
}
