//! The depth pixels of a frame that lie on the board.

use depthcal_model::Camera;
use depthcal_statistics::Thinning;
use nalgebra::{Isometry3, Point3};

use super::board_plane::BoardSurface;
use super::board_region::BoardRegion;
use super::pixel_covariates::PixelCovariates;
use super::pixel_rays::PixelRays;
use super::stages::OpenFrame;

/// A valid depth pixel inside the board's outermost markers.
#[derive(Debug, Clone, Copy)]
pub struct BoardPixel {
    /// Its number in the depth image, row by row, or among the frame's single pixels.
    pub number: u32,
    /// Pixel of the depth image, px.
    pub pixel: [f64; 2],
    /// Measured or corrected depth, mm.
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

/// The board pixels of a frame.
#[derive(Debug)]
pub struct BoardPixels<'a> {
    /// The pixels, row by row.
    pub pixels: Vec<BoardPixel>,
    /// Their covariates.
    pub covariates: PixelCovariates<'a>,
}

/// Valid depth pixels of a frame on the board, given a camera and a pose that come from the image: of a depth image those that
/// `thinning` keeps (by [`key`]), row by row; or the single pixels that the frame has. `unit_mm` is the unit of the depth image.
pub fn board_pixels<'a>(
    frame: &'a OpenFrame<'a>,
    unit_mm: f64,
    rays: &PixelRays<'_>,
    region: &BoardRegion,
    camera_from_board: &Isometry3<f64>,
    thinning: Thinning,
) -> BoardPixels<'a> {
    let surface = rays.surface(camera_from_board);
    let Some(depth) = &frame.depth else {
        return given_pixels(frame, rays, region, &surface);
    };
    let corners = corners(rays.camera(), region, camera_from_board);
    let Some((low, high)) = bounds(&corners, depth.width, depth.height) else {
        return BoardPixels { pixels: Vec::new(), covariates: PixelCovariates::given(frame) };
    };
    let covariates = PixelCovariates::of_part(frame, unit_mm, rays, (low, high));
    let [fx, ..] = rays.camera().pinhole();
    let within = (high[0] - low[0] + 1) * (high[1] - low[1] + 1);
    let mut pixels = Vec::with_capacity(thinning.expected(within / 2));
    for v in low[1]..=high[1] {
        for u in low[0]..=high[0] {
            let number = v * depth.width + u;
            let Some(raw) = depth.measurement(number) else { continue };
            let place = [u as f64, v as f64];
            if !thinning.keeps(key(place)) {
                continue;
            }
            let seen = at_board((number as u32, place), raw * unit_mm, rays, &surface, &covariates);
            let Some(pixel) = seen else { continue };
            // Along the direction of tilt a pixel covers more of the board.
            let mm_per_px = pixel.board_depth_mm / (fx * pixel.cos_incidence.max(0.1));
            if region.contains(pixel.board, mm_per_px) {
                pixels.push(pixel);
            }
        }
    }
    BoardPixels { pixels, covariates }
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

fn given_pixels<'a>(
    frame: &'a OpenFrame<'a>,
    rays: &PixelRays<'_>,
    region: &BoardRegion,
    surface: &BoardSurface<'_>,
) -> BoardPixels<'a> {
    let covariates = PixelCovariates::given(frame);
    let given = (0..).zip(frame.raw.depth_pixels());
    let seen = given.filter_map(|(i, p)| at_board((i, p.context.pixel), p.depth_mm, rays, surface, &covariates));
    let pixels = seen.filter(|p| region.contains(p.board, 0.0)).collect();
    BoardPixels { pixels, covariates }
}

/// The point of the board's surface that a pixel, given by its number and place, sees; `None` where its ray does not meet the
/// surface.
fn at_board(
    (number, pixel): (u32, [f64; 2]),
    depth_mm: f64,
    rays: &PixelRays<'_>,
    surface: &BoardSurface<'_>,
    covariates: &PixelCovariates<'_>,
) -> Option<BoardPixel> {
    let ray = rays.ray(pixel, depth_mm, || covariates.without_light(number, pixel))?;
    let board_depth_mm = surface.depth(ray)?;
    let on_board = surface.plane().to_board(ray, board_depth_mm);
    let cos_incidence = surface.plane().cos_incidence(ray);
    Some(BoardPixel { number, pixel, depth_mm, board_depth_mm, board: [on_board.x, on_board.y], ray, cos_incidence })
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
