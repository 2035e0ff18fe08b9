//! The board's plane in depth images, without an image that shows the board.

use crate::observe::DetectedFrame;
use depthcal_io::{DepthFrame, ImageError};
use depthcal_statistics::upper_median;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// A plane in a depth image: inverse depth α u + β v + γ, 1/mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImagePlane {
    /// α, β, γ with (u, v) counted from the middle of the image.
    pub coefficients: [f64; 3],
    /// Pixels that support it.
    pub pixels: usize,
    /// Their middle, px.
    pub middle: [f64; 2],
}

/// Pixels of a depth image that are looked at, about.
const LOOKED_AT: usize = 24_000;
/// Fewest pixels of a board.
const FEWEST: usize = 60;
/// Planes that are tried per frame.
const TRIED: usize = 300;
/// A pixel supports a plane within this share of its inverse depth.
const SUPPORTS: f64 = 0.012;
/// Nearer than the scene behind by this share of the distance, a pixel shows something that moves: the board.
const IN_FRONT: f64 = 0.03;
/// Share of the frames, from far to near, that gives the depth of the scene behind …
const BEHIND: f64 = 0.2;
/// … where at least this share of them measures anything.
const MEASURED: f64 = 0.3;

/// (u, v, ρ) from the image's middle, px and 1/mm.
type Point = [f64; 3];

/// The board's plane in every frame; `None` where none is found. Of depth images the pixels count that are nearer than the
/// scene is in most frames: the board moves.
///
/// # Errors
///
/// [`ImageError`] where a depth image has become unreadable.
pub fn planes_of(
    frames: &[DetectedFrame],
    (width, height): (usize, usize),
    unit_mm: f64,
) -> Result<Vec<Option<ImagePlane>>, ImageError> {
    let stride = ((width * height) as f64 / LOOKED_AT as f64).sqrt().ceil().max(1.0) as usize;
    let places: Vec<[usize; 2]> =
        (0..height).step_by(stride).flat_map(|v| (0..width).step_by(stride).map(move |u| [u, v])).collect();
    let middle = [(width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0];
    let centred = |u: f64, v: f64, rho: f64| [u - middle[0], v - middle[1], rho];
    let images: Vec<Option<Vec<Option<f64>>>> = frames
        .par_iter()
        .map(|frame| {
            let Some(image) = frame.depth_image() else { return Ok(None) };
            let image = image.get()?;
            let depth_mm = |[u, v]: &[usize; 2]| depth_at(&image, *u, *v).map(|z| z * unit_mm);
            Ok(Some(places.iter().map(depth_mm).collect::<Vec<Option<f64>>>()))
        })
        .collect::<Result<_, ImageError>>()?;
    let behind: Vec<f64> = (0..places.len()).map(|i| scene_behind(&images, i)).collect();
    let plane = |(frame, image): (&DetectedFrame, &Option<Vec<Option<f64>>>)| {
        let points: Vec<Point> = match image {
            Some(depths) => {
                let in_front = |(i, z): (usize, &Option<f64>)| {
                    let z = (*z)?;
                    let [u, v] = places[i];
                    (z < (1.0 - IN_FRONT) * behind[i]).then(|| centred(u as f64, v as f64, 1.0 / z))
                };
                depths.iter().enumerate().filter_map(in_front).collect()
            }
            None => {
                let pixels = frame.depth_pixels().iter();
                pixels.map(|p| centred(p.context.pixel[0], p.context.pixel[1], 1.0 / p.depth_mm)).collect()
            }
        };
        largest_plane(&points)
    };
    Ok(frames.par_iter().zip(&images).map(plane).collect())
}

fn depth_at(image: &DepthFrame, u: usize, v: usize) -> Option<f64> {
    image.measurement(v * image.width + u)
}

/// Depth of the scene behind the board at one place: that of a far frame among those that measure anything there; infinite
/// where few do, so that only the board is ever near enough to be measured.
fn scene_behind(images: &[Option<Vec<Option<f64>>>], place: usize) -> f64 {
    let mut depths: Vec<f64> = images.iter().flatten().filter_map(|image| image[place]).collect();
    let frames = images.iter().flatten().count();
    if depths.is_empty() || (depths.len() as f64) < MEASURED * frames as f64 {
        return f64::INFINITY;
    }
    depths.sort_by(|a, b| b.total_cmp(a));
    depths[(BEHIND * (depths.len() - 1) as f64) as usize]
}

/// The plane that most points support, of those through three of them, refined by least squares.
fn largest_plane(points: &[Point]) -> Option<ImagePlane> {
    if points.len() < FEWEST {
        return None;
    }
    // A fixed sequence of triples: the same input gives the same plane.
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut draw = || {
        state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        ((state >> 33) as usize) % points.len()
    };
    let supports =
        |plane: &Vector3<f64>, p: &Point| (plane.x * p[0] + plane.y * p[1] + plane.z - p[2]).abs() <= SUPPORTS * p[2];
    let mut best: Option<(usize, Vector3<f64>)> = None;
    for _ in 0..TRIED {
        let triple = [draw(), draw(), draw()].map(|i| points[i]);
        let rows = Matrix3::from_fn(|i, j| if j < 2 { triple[i][j] } else { 1.0 });
        let Some(inverse) = rows.try_inverse() else { continue };
        let plane = inverse * Vector3::new(triple[0][2], triple[1][2], triple[2][2]);
        let count = points.iter().filter(|p| supports(&plane, p)).count();
        if best.as_ref().is_none_or(|(most, _)| count > *most) {
            best = Some((count, plane));
        }
    }
    let (_, mut plane) = best?;
    let mut inliers: Vec<Point> = Vec::new();
    for _ in 0..4 {
        inliers = points.iter().copied().filter(|p| supports(&plane, p)).collect();
        plane = least_squares(&inliers)?;
        // Then those within its own noise.
        let residual = |p: &Point| (plane.x * p[0] + plane.y * p[1] + plane.z - p[2]).abs();
        let mut sizes: Vec<f64> = inliers.iter().map(residual).collect();
        let limit = 4.0 * 1.4826 * upper_median(&mut sizes)?;
        inliers.retain(|p| residual(p) <= limit.max(1e-9));
        plane = least_squares(&inliers)?;
    }
    let n = inliers.len();
    let middle = inliers.iter().fold([0.0; 2], |s, p| [s[0] + p[0] / n as f64, s[1] + p[1] / n as f64]);
    (n >= FEWEST).then_some(ImagePlane { coefficients: [plane.x, plane.y, plane.z], pixels: n, middle })
}

fn least_squares(points: &[Point]) -> Option<Vector3<f64>> {
    let (mut normal, mut rhs) = (Matrix3::zeros(), Vector3::zeros());
    for p in points {
        let row = Vector3::new(p[0], p[1], 1.0);
        normal += row * row.transpose();
        rhs += row * p[2];
    }
    Some(normal.cholesky()?.solve(&rhs))
}
