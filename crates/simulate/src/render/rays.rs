//! The rays of all pixels, traced once, as the lens' inverse has no closed form.

use rayon::prelude::*;

use crate::optics::Optics;

/// Width of the table beyond the image, px, for displaced pixels and samples at the border.
const MARGIN: usize = 24;

/// Rays (x, y, 1) at pixel centres, with bilinear interpolation.
pub(crate) struct RayTable {
    width: usize,
    rays: Vec<[f64; 2]>,
}

impl RayTable {
    pub fn new(optics: &Optics, width: usize, height: usize) -> Self {
        // Traced at the focused distance; at other distances displaced pixels are looked up.
        let (columns, rows) = (width + 2 * MARGIN, height + 2 * MARGIN);
        let ray = |index: usize| {
            let (row, column) = (index / columns, index % columns);
            let pixel = [column as f64 - MARGIN as f64, row as f64 - MARGIN as f64];
            optics.ray(pixel, crate::optics::FOCUSED_AT).unwrap_or([f64::NAN; 2])
        };
        Self { width: columns, rays: (0..rows * columns).into_par_iter().map(ray).collect() }
    }

    /// The ray of `pixel` (px, at the focused distance); `None` outside the table and where the lens has no ray.
    pub fn at(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let (u, v) = (pixel[0] + MARGIN as f64, pixel[1] + MARGIN as f64);
        if !(u >= 0.0 && v >= 0.0) {
            return None;
        }
        let (column, row) = (u as usize, v as usize);
        let (a, b) = (u - column as f64, v - row as f64);
        let index = row * self.width + column;
        if column + 1 >= self.width || index + self.width + 1 >= self.rays.len() {
            return None;
        }
        let (p, q) = (self.rays[index], self.rays[index + 1]);
        let (r, s) = (self.rays[index + self.width], self.rays[index + self.width + 1]);
        let mix = |i: usize| {
            let (top, bottom) = (p[i] + a * (q[i] - p[i]), r[i] + a * (s[i] - r[i]));
            top + b * (bottom - top)
        };
        let ray = [mix(0), mix(1)];
        ray[0].is_finite().then_some(ray)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::CameraTruth;

    #[test]
    fn interpolated_rays_are_as_good_as_traced_ones() {
        let optics = Optics::new(&CameraTruth::published(2).unwrap());
        let table = RayTable::new(&optics, 640, 480);
        for pixel in [[0.0, 0.0], [639.0, 479.0], [-0.5, 12.3], [320.25, 7.75], [639.5, 479.5], [5.5, 470.5]] {
            let (a, b) = (table.at(pixel).unwrap(), optics.ray(pixel, 0.001).unwrap());
            assert!((a[0] - b[0]).hypot(a[1] - b[1]) * 480.0 < 5e-4);
        }
        assert_eq!(table.at([700.0, 0.0]), None);
        assert_eq!(table.at([0.0, -30.0]), None);
    }
}
