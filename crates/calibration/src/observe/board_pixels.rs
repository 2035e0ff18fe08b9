//! The depth pixels of a frame that lie on the board.

use depthcal_io::DepthFrame;
use depthcal_model::frame_covariates::Surroundings;
use depthcal_model::{Camera, Context};
use depthcal_statistics::Thinning;
use nalgebra::{Isometry3, Point3};

use super::board_plane::BoardSurface;
use super::board_region::BoardRegion;
use super::frame_light::light;
use super::pixel_rays::PixelRays;
use super::stages::{DepthPixel, OpenFrame};

/// A valid depth pixel inside the board's outermost markers.
#[derive(Debug, Clone, Copy)]
pub struct BoardPixel {
    /// The pixel with its covariates; those of its surroundings and of its frame's light only where a piece needs them, see
    /// [`PixelRays::needs_surroundings`] and [`PixelRays::modulation`].
    pub context: Context,
    /// Measured depth, mm.
    pub depth_mm: f64,
    /// The board's depth on this pixel's ray, mm.
    pub board_depth_mm: f64,
    /// The board point that it sees, mm.
    pub board: [f64; 2],
    /// True ray (X/Z, Y/Z).
    pub ray: [f64; 2],
    /// Cosine of the angle of incidence.
    pub cos_incidence: f64,
}

/// The depth of a board pixel, and where it sees the board: a fifth of a [`BoardPixel`], whose covariates few steps need.
#[derive(Debug, Clone, Copy)]
pub struct BoardDepth {
    /// Measured or corrected depth, mm.
    pub depth_mm: f64,
    /// The board's depth on the pixel's ray, mm.
    pub board_depth_mm: f64,
    /// The board point that it sees, mm.
    pub board: [f64; 2],
    /// True ray (X/Z, Y/Z).
    pub ray: [f64; 2],
}

impl From<&BoardPixel> for BoardDepth {
    fn from(pixel: &BoardPixel) -> Self {
        let BoardPixel { depth_mm, board_depth_mm, board, ray, .. } = *pixel;
        Self { depth_mm, board_depth_mm, board, ray }
    }
}

/// Valid depth pixels of a frame on the board, given a camera and a pose that come from the image: of a depth image those that
/// `thinning` keeps (by [`key`]), row by row; or the single pixels that the frame has. `unit_mm` is the unit of the depth image.
pub fn board_pixels(
    frame: &OpenFrame<'_>,
    unit_mm: f64,
    rays: &PixelRays<'_>,
    region: &BoardRegion,
    camera_from_board: &Isometry3<f64>,
    thinning: Thinning,
) -> Vec<BoardPixel> {
    match &frame.depth {
        Some(depth) => image_pixels(frame, depth, unit_mm, rays, region, camera_from_board, thinning),
        None => given_pixels(frame.raw.depth_pixels(), rays, region, camera_from_board),
    }
}

fn image_pixels(
    frame: &OpenFrame<'_>,
    depth: &DepthFrame,
    unit_mm: f64,
    rays: &PixelRays<'_>,
    region: &BoardRegion,
    camera_from_board: &Isometry3<f64>,
    thinning: Thinning,
) -> Vec<BoardPixel> {
    let corners = corners(rays.camera(), region, camera_from_board);
    let Some((low, high)) = bounds(&corners, depth.width, depth.height) else { return Vec::new() };
    let surface = rays.surface(camera_from_board);
    let [fx, ..] = rays.camera().pinhole();
    let image = frame.image.as_deref().filter(|_| rays.needs_surroundings());
    let surroundings = image.map(|i| Surroundings::of(&i.data, [i.width, i.height], low, high));
    let light = light(frame, unit_mm, rays).zip(frame.image.as_deref());
    let within = (high[0] - low[0] + 1) * (high[1] - low[1] + 1);
    let mut pixels = Vec::with_capacity(thinning.expected(within / 2));
    for v in low[1]..=high[1] {
        for u in low[0]..=high[0] {
            let Some(raw) = depth.measurement(v * depth.width + u) else { continue };
            if !thinning.keeps(key([u as f64, v as f64])) {
                continue;
            }
            let depth_mm = raw * unit_mm;
            let mut context = frame.conditions([u as f64, v as f64]);
            if let Some(surroundings) = &surroundings {
                (context.surround, context.slope) = surroundings.at(u, v);
            }
            let Some(mut pixel) = at_board(context, depth_mm, rays, &surface) else { continue };
            // Along the direction of tilt a pixel covers more of the board.
            let mm_per_px = pixel.board_depth_mm / (fx * pixel.cos_incidence.max(0.1));
            if region.contains(pixel.board, mm_per_px) {
                if let Some((light, image)) = &light {
                    pixel.context.stray = light.at(&image.data, [u, v]);
                }
                pixels.push(pixel);
            }
        }
    }
    pixels
}

/// Number of pixels that the board covers in the image, about.
pub fn board_area_px(camera: &Camera, region: &BoardRegion, camera_from_board: &Isometry3<f64>) -> usize {
    let corners = corners(camera, region, camera_from_board);
    let next = corners.iter().cycle().skip(1);
    let twice_area: f64 = corners.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum();
    (0.5 * twice_area.abs()).min((camera.width * camera.height) as f64) as usize
}

/// A key of a pixel's place, for a [`Thinning`].
pub fn key(pixel: [f64; 2]) -> u64 {
    // Truncated, which is one instruction; of whole numbers it is exact.
    let [u, v] = pixel.map(|c| (16.0 * c) as i32 as u64 & 0xffff_ffff);
    v << 32 | u
}

/// The corners of the board's region in the image.
fn corners(camera: &Camera, region: &BoardRegion, camera_from_board: &Isometry3<f64>) -> Vec<[f64; 2]> {
    let project = |c: &[f64; 2]| camera.project(&(camera_from_board * Point3::new(c[0], c[1], 0.0)).coords);
    region.hull().iter().filter_map(project).collect()
}

fn given_pixels(
    pixels: &[DepthPixel],
    rays: &PixelRays<'_>,
    region: &BoardRegion,
    camera_from_board: &Isometry3<f64>,
) -> Vec<BoardPixel> {
    let surface = rays.surface(camera_from_board);
    let seen = pixels.iter().filter_map(|p| at_board(p.context, p.depth_mm, rays, &surface));
    seen.filter(|p| region.contains(p.board, 0.0)).collect()
}

/// The point of the board's surface that a pixel sees; `None` where its ray does not meet the surface.
fn at_board(context: Context, depth_mm: f64, rays: &PixelRays<'_>, surface: &BoardSurface<'_>) -> Option<BoardPixel> {
    let ray = rays.ray(&context, depth_mm)?;
    let board_depth_mm = surface.depth(ray)?;
    let on_board = surface.plane().to_board(ray, board_depth_mm);
    let cos_incidence = surface.plane().cos_incidence(ray);
    Some(BoardPixel { context, depth_mm, board_depth_mm, board: [on_board.x, on_board.y], ray, cos_incidence })
}

/// First and last column and row that the corners span, with a margin for a displaced depth image, clipped to the image;
/// `None` where the corners are outside.
fn bounds(corners: &[[f64; 2]], width: usize, height: usize) -> Option<([usize; 2], [usize; 2])> {
    const MARGIN_PX: f64 = 10.0;
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for c in corners {
        for i in 0..2 {
            low[i] = low[i].min(c[i] - MARGIN_PX);
            high[i] = high[i].max(c[i] + MARGIN_PX);
        }
    }
    let size = [width, height];
    let inside = (0..2).all(|i| high[i] >= 0.0 && low[i] <= size[i] as f64 - 1.0);
    inside.then(|| {
        let clamp = |x: f64, i: usize| x.clamp(0.0, size[i] as f64 - 1.0) as usize;
        ([clamp(low[0], 0), clamp(low[1], 1)], [clamp(high[0], 0), clamp(high[1], 1)])
    })
}
