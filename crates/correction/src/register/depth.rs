//! Depth resampled into another camera.

use depthcal_model::Camera;
use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;

use super::gaps::closed_gaps;

/// Neighbouring pixels whose depths differ by a larger share are not of one surface: a surface seen at 80° has a hundredth.
const JOINED: f32 = 0.025;
/// How far outside a triangle a pixel may lie, as a share of the height of the triangle: by rounding, a pixel on the edge that
/// two triangles share may seem to lie outside of both, and would become a hole.
const ON_EDGE: f32 = 1e-5;
/// Rows of the image that one thread fills.
const BAND: usize = 64;
/// Depth that is larger than that of the surface in front of it by more than this share is hidden.
pub(super) const HIDDEN: f32 = 0.015;

/// Depth in another camera's image.
#[derive(Debug, Clone, PartialEq)]
pub struct RegisteredDepth {
    /// Width of the image, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// Depth in the other camera, mm, row by row; 0 where no depth pixel shows anything, and where what one shows lies behind a
    /// surface whose own depth is missing there.
    pub depth_mm: Vec<f32>,
    /// The nearest surface, with its gaps closed, mm: what hides points behind it; 0 where there is none.
    pub surface_mm: Vec<f32>,
    /// Number of pixels without depth.
    pub holes: usize,
}

/// A point in the other camera: its pixel and depth.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub pixel: [f32; 2],
    pub depth_mm: f32,
}

/// Points of a depth camera (mm, its frame, row by row of an image `width` wide, NaN where there is none) as another camera
/// sees them; `None` outside its field of view.
pub(super) fn seen(points: &[[f32; 3]], camera: &Camera, camera_from_depth: &Isometry3<f64>) -> Vec<Option<Seen>> {
    let see = |p: &[f32; 3]| {
        if p[2].is_nan() {
            return None;
        }
        let point = camera_from_depth * Point3::from(p.map(f64::from));
        let [u, v] = camera.project(&point.coords)?;
        let (width, height) = (camera.width as f64, camera.height as f64);
        // Points just outside carry triangles that reach inside.
        let near = u > -0.5 * width && u < 1.5 * width && v > -0.5 * height && v < 1.5 * height;
        near.then_some(Seen { pixel: [u as f32, v as f32], depth_mm: point.z as f32 })
    };
    points.par_iter().map(see).collect()
}

/// Resamples the depth of a camera into another one's image.
///
/// `points` are the corrected points of all pixels of the depth camera, mm in its frame, row by row of an image `width` pixels
/// wide, NaN where there is no depth. Pixel centres are at integers.
pub fn depth_into(
    points: &[[f32; 3]],
    width: usize,
    camera: &Camera,
    camera_from_depth: &Isometry3<f64>,
) -> RegisteredDepth {
    let measured = nearest(&shapes(&seen(points, camera, camera_from_depth), width), camera);
    // Gaps are joined with each other and with the points about them, which are what they are interpolated from.
    let mut whole = closed_gaps(points, width);
    whole.iter_mut().zip(points).filter(|(_, p)| !p[2].is_nan()).for_each(|(stored, p)| *stored = *p);
    let whole = nearest(&shapes(&seen(&whole, camera, camera_from_depth), width), camera);
    let depth = |rho: f32| if rho > 0.0 { 1.0 / rho } else { 0.0 };
    let surface_mm: Vec<f32> = whole.into_iter().map(depth).collect();
    let visible = |(rho, surface): (f32, &f32)| {
        let z = depth(rho);
        if *surface > 0.0 && z > (1.0 + HIDDEN) * surface { 0.0 } else { z }
    };
    let depth_mm: Vec<f32> = measured.into_iter().zip(&surface_mm).map(visible).collect();
    let holes = depth_mm.iter().filter(|z| **z == 0.0).count();
    RegisteredDepth { width: camera.width, height: camera.height, depth_mm, surface_mm, holes }
}

/// Triangles between neighbouring pixels on one surface, and every point by itself.
fn shapes(seen: &[Option<Seen>], width: usize) -> Vec<[Seen; 3]> {
    let rows = seen.len() / width.max(1);
    let mut shapes: Vec<[Seen; 3]> = Vec::with_capacity(2 * seen.len());
    for row in 0..rows {
        for column in 0..width {
            let point_at = |r: usize, c: usize| (r < rows && c < width).then(|| seen[r * width + c]).flatten();
            let Some(here) = point_at(row, column) else { continue };
            // A point alone covers its nearest pixel, so that thin surfaces do not vanish.
            shapes.push([here; 3]);
            let (right, below) = (point_at(row, column + 1), point_at(row + 1, column));
            let corner = point_at(row + 1, column + 1);
            if let (Some(right), Some(below)) = (right, below) {
                shapes.push([here, right, below]);
            }
            if let (Some(right), Some(below), Some(corner)) = (right, below, corner) {
                shapes.push([right, corner, below]);
            }
        }
    }
    shapes.retain(|shape| {
        let (near, far) =
            shape.iter().fold((f32::INFINITY, 0.0_f32), |(a, b), s| (a.min(s.depth_mm), b.max(s.depth_mm)));
        far <= (1.0 + JOINED) * near
    });
    shapes
}

/// Inverse depth of the nearest shape at every pixel of the camera, 1/mm; 0 where there is none.
fn nearest(shapes: &[[Seen; 3]], camera: &Camera) -> Vec<f32> {
    let mut inverse = vec![0.0_f32; camera.width * camera.height];
    let bands = inverse.par_chunks_mut(camera.width * BAND).enumerate();
    bands.for_each(|(number, band)| {
        let first = (number * BAND) as f32;
        let rows = (band.len() / camera.width) as f32;
        for shape in shapes {
            let (low, high) = bounds(shape, 1);
            if high + 0.5 >= first && low - 0.5 < first + rows {
                fill(band, camera.width, number * BAND, shape);
            }
        }
    });
    inverse
}

fn bounds(shape: &[Seen; 3], axis: usize) -> (f32, f32) {
    shape.iter().map(|s| s.pixel[axis]).fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
}

/// Writes the inverse depth of a triangle, or of a point, into the rows of a band where it is nearer than what is there.
/// Inverse depth is affine over the image of a plane.
fn fill(band: &mut [f32], width: usize, first: usize, [a, b, c]: &[Seen; 3]) {
    let rows = band.len() / width;
    let mut put = |u: i64, v: i64, rho: f32| {
        let row = v - first as i64;
        if u >= 0 && (u as usize) < width && row >= 0 && (row as usize) < rows {
            let value = &mut band[row as usize * width + u as usize];
            *value = value.max(rho);
        }
    };
    let area =
        (b.pixel[0] - a.pixel[0]) * (c.pixel[1] - a.pixel[1]) - (b.pixel[1] - a.pixel[1]) * (c.pixel[0] - a.pixel[0]);
    if area == 0.0 {
        put(a.pixel[0].round() as i64, a.pixel[1].round() as i64, 1.0 / a.depth_mm);
        return;
    }
    let ((u0, u1), (v0, v1)) = (bounds(&[*a, *b, *c], 0), bounds(&[*a, *b, *c], 1));
    for v in v0.ceil() as i64..=v1.floor() as i64 {
        for u in u0.ceil() as i64..=u1.floor() as i64 {
            let (x, y) = (u as f32, v as f32);
            let part = |p: &Seen, q: &Seen| {
                ((q.pixel[0] - p.pixel[0]) * (y - p.pixel[1]) - (q.pixel[1] - p.pixel[1]) * (x - p.pixel[0])) / area
            };
            let (of_c, of_a) = (part(a, b), part(b, c));
            let of_b = 1.0 - of_a - of_c;
            if [of_a, of_b, of_c].iter().all(|part| *part >= -ON_EDGE) {
                put(u, v, of_a / a.depth_mm + of_b / b.depth_mm + of_c / c.depth_mm);
            }
        }
    }
}
