//! The depth pixels that lie on the board, and the board's depth on their rays.

use depthcal_io::DepthImage;
use depthcal_model::{Camera, Context, Pattern, Target};
use nalgebra::{Isometry3, Point3, Vector3};

use super::stages::{DepthPixel, MeasuredDepth, RawFrame};

/// Pixels nearer than this to a dot's edge are excluded: depth on the dark print and at its rim is unreliable.
pub const MARKER_MARGIN_PX: f64 = 1.5;

/// A valid depth pixel inside the board's outermost markers.
#[derive(Debug, Clone, Copy)]
pub struct BoardPixel {
    /// The pixel with its covariates.
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

/// The board's plane in the camera frame.
#[derive(Debug, Clone, Copy)]
pub struct BoardPlane {
    board_from_camera: Isometry3<f64>,
    normal: Vector3<f64>,
    offset: f64,
}

impl BoardPlane {
    /// The plane z = 0 of the board's frame.
    pub fn new(camera_from_board: &Isometry3<f64>) -> Self {
        let normal = camera_from_board.rotation * Vector3::z();
        let offset = normal.dot(&camera_from_board.translation.vector);
        Self { board_from_camera: camera_from_board.inverse(), normal, offset }
    }

    /// Depth (mm) at which a ray (X/Z, Y/Z) meets the plane; `None` where it meets none in front of the camera.
    pub fn depth(&self, ray: [f64; 2]) -> Option<f64> {
        let z = self.offset / self.normal.dot(&Vector3::new(ray[0], ray[1], 1.0));
        (z > 0.0 && z.is_finite()).then_some(z)
    }

    /// Depth (mm) at which a ray meets the board as the camera's board pieces shape it.
    pub fn depth_of_shape(&self, ray: [f64; 2], camera: &Camera) -> Option<f64> {
        let d = Vector3::new(ray[0], ray[1], 1.0);
        let mut depth = self.depth(ray)?;
        // Fixed-point iteration. Heights are millimetres on boards of hundreds: each round gains two digits or more.
        for _ in 0..4 {
            let at = self.to_board(ray, depth);
            let height = camera.board_point([at.x, at.y])[2];
            if height == at.z {
                break;
            }
            depth = (self.offset + height) / self.normal.dot(&d);
        }
        (depth > 0.0 && depth.is_finite()).then_some(depth)
    }

    /// Height of a point on a ray at a depth (mm) over the board as the camera's board pieces shape it, mm.
    pub fn height_over_shape(&self, ray: [f64; 2], depth_mm: f64, camera: &Camera) -> f64 {
        let at = self.to_board(ray, depth_mm);
        at.z - camera.board_point([at.x, at.y])[2]
    }

    /// A point on a ray at a depth (mm), in board coordinates, mm.
    pub fn to_board(&self, ray: [f64; 2], depth_mm: f64) -> Point3<f64> {
        self.board_from_camera * Point3::new(ray[0] * depth_mm, ray[1] * depth_mm, depth_mm)
    }

    /// Cosine of the angle between a ray and the normal, in [0, 1].
    pub fn cos_incidence(&self, ray: [f64; 2]) -> f64 {
        let d = Vector3::new(ray[0], ray[1], 1.0);
        self.normal.dot(&d).abs() / d.norm()
    }
}

/// The region of the board whose depth is used: the convex hull of all markers, without dots and their surroundings.
#[derive(Debug, Clone)]
pub struct BoardRegion {
    hull: Vec<[f64; 2]>,
    dots: Vec<[f64; 2]>,
    dot_radius_mm: f64,
}

impl BoardRegion {
    /// The region of a board.
    pub fn new(target: &Target) -> Self {
        let points = target.points();
        let dots = match target.pattern {
            Pattern::AsymmetricCircles { .. } | Pattern::SymmetricCircles { .. } => points.clone(),
            _ => Vec::new(),
        };
        let dot_radius_mm = target.circle_diameter_mm().unwrap_or(0.0) / 2.0;
        Self { hull: convex_hull(points), dots, dot_radius_mm }
    }

    /// Corners of the convex hull in order, board frame, mm.
    pub fn hull(&self) -> &[[f64; 2]] {
        &self.hull
    }

    /// Whether a board point (mm) is in the region; `mm_per_px` is the size of a pixel on the board there.
    pub fn contains(&self, [x, y]: [f64; 2], mm_per_px: f64) -> bool {
        let n = self.hull.len();
        let inside = (0..n).all(|i| {
            let (a, b) = (self.hull[i], self.hull[(i + 1) % n]);
            (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) >= 0.0
        });
        let keep_off = self.dot_radius_mm + MARKER_MARGIN_PX * mm_per_px;
        inside && self.dots.iter().all(|d| (d[0] - x).hypot(d[1] - y) > keep_off)
    }
}

/// Convex hull, counter-clockwise in a frame with y up (Andrew's monotone chain).
fn convex_hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let turn = |o: [f64; 2], a: [f64; 2], b: [f64; 2]| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while chain.len() >= 2 && turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    hull
}

/// All valid depth pixels of a frame on the board, given a camera and a pose that come from the image: of a depth image every
/// `stride`-th column and row, row by row; or the single pixels that the frame has. `unit_mm` is the unit of the depth image.
pub fn board_pixels(
    frame: &RawFrame,
    unit_mm: f64,
    camera: &Camera,
    region: &BoardRegion,
    camera_from_board: &Isometry3<f64>,
    stride: usize,
) -> Vec<BoardPixel> {
    match &frame.depth {
        MeasuredDepth::None => Vec::new(),
        MeasuredDepth::Image(depth) => image_pixels(frame, depth, unit_mm, camera, region, camera_from_board, stride),
        MeasuredDepth::Pixels(pixels) => given_pixels(pixels, camera, region, camera_from_board),
    }
}

fn image_pixels(
    frame: &RawFrame,
    depth: &DepthImage,
    unit_mm: f64,
    camera: &Camera,
    region: &BoardRegion,
    camera_from_board: &Isometry3<f64>,
    stride: usize,
) -> Vec<BoardPixel> {
    let corners: Vec<[f64; 2]> = region
        .hull()
        .iter()
        .filter_map(|c| camera.project(&(camera_from_board * Point3::new(c[0], c[1], 0.0)).coords))
        .collect();
    let Some((low, high)) = bounds(&corners, depth.width, depth.height) else { return Vec::new() };
    let plane = BoardPlane::new(camera_from_board);
    let [fx, ..] = camera.pinhole();
    let mut pixels = Vec::new();
    for v in (low[1]..=high[1]).filter(|v| v % stride == 0) {
        for u in (low[0]..=high[0]).filter(|u| u % stride == 0) {
            let raw = depth.data[v * depth.width + u];
            if raw == 0 {
                continue;
            }
            let context = frame.context([u as f64, v as f64]);
            let depth_mm = f64::from(raw) * unit_mm;
            let Ok(ray) = camera.ray(camera.image_pixel(&context), 1.0 / depth_mm) else { continue };
            let Some(board_depth_mm) = plane.depth_of_shape(ray, camera) else { continue };
            let on_board = plane.to_board(ray, board_depth_mm);
            let cos_incidence = plane.cos_incidence(ray);
            // Along the direction of tilt a pixel covers more of the board.
            let mm_per_px = board_depth_mm / (fx * cos_incidence.max(0.1));
            let board = [on_board.x, on_board.y];
            if region.contains(board, mm_per_px) {
                pixels.push(BoardPixel { context, depth_mm, board_depth_mm, board, ray, cos_incidence });
            }
        }
    }
    pixels
}

fn given_pixels(
    pixels: &[DepthPixel],
    camera: &Camera,
    region: &BoardRegion,
    camera_from_board: &Isometry3<f64>,
) -> Vec<BoardPixel> {
    let plane = BoardPlane::new(camera_from_board);
    let pixel = |s: &DepthPixel| {
        let ray = camera.ray(camera.image_pixel(&s.context), 1.0 / s.depth_mm).ok()?;
        let board_depth_mm = plane.depth_of_shape(ray, camera)?;
        let on_board = plane.to_board(ray, board_depth_mm);
        let board = [on_board.x, on_board.y];
        let cos_incidence = plane.cos_incidence(ray);
        let pixel = BoardPixel { context: s.context, depth_mm: s.depth_mm, board_depth_mm, board, ray, cos_incidence };
        region.contains(board, 0.0).then_some(pixel)
    };
    pixels.iter().filter_map(pixel).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_region_is_the_hull_without_the_dots() {
        let target = Target {
            pattern: Pattern::SymmetricCircles { circle_diameter_mm: 10.0 },
            columns: 3,
            rows: 3,
            spacing_mm: 30.0,
        };
        let region = BoardRegion::new(&target);
        assert_eq!(region.hull().len(), 4);
        assert!(region.contains([15.0, 15.0], 1.0), "between four dots");
        assert!(!region.contains([30.0, 30.0], 1.0), "on a dot");
        assert!(!region.contains([36.4, 30.0], 1.0), "within 1.5 px of a dot");
        assert!(region.contains([36.6, 30.0], 1.0), "beyond that margin");
        assert!(!region.contains([-0.1, 15.0], 1.0), "outside the markers");
    }
}
