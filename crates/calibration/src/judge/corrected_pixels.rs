//! Board pixels with corrected depth.

use depthcal_model::{Camera, Context};

use crate::observe::PixelRays;
use crate::observe::board_pixels::{BoardPixel, BoardPixels};
use crate::observe::board_plane::BoardSurface;

/// Pixels that are corrected at a time: what they need of memory stays in a processor's cache.
const CHUNK: usize = 1024;

/// The pixels with their depth corrected by a camera; `None` where it cannot correct it. `rays` are those of the camera without
/// pixel and depth pieces.
pub(super) fn corrected(
    camera: &Camera,
    rays: &PixelRays<'_>,
    BoardPixels { pixels, covariates }: &BoardPixels<'_>,
    surface: &BoardSurface<'_>,
) -> Vec<Option<BoardPixel>> {
    let context = |p: &BoardPixel| covariates.context(p.number, p.pixel);
    if PixelRays::has_pixel_pieces_of(camera) || rays.depend_on_depth() {
        return pixels.iter().map(|p| corrected_anew(camera, p, &context(p), surface)).collect();
    }
    let mut list = Vec::with_capacity(pixels.len());
    let mut inverse_depths = [0.0; CHUNK];
    for chunk in pixels.chunks(CHUNK) {
        let contexts: Vec<_> = chunk.iter().map(context).collect();
        let rays: Vec<_> = chunk.iter().map(|p| p.ray).collect();
        let cos_incidence: Vec<_> = chunk.iter().map(|p| p.cos_incidence).collect();
        let measured: Vec<_> = chunk.iter().map(|p| 1.0 / p.depth_mm).collect();
        let inverse_depths = &mut inverse_depths[..chunk.len()];
        camera.true_inverse_depths(&contexts, &rays, &cos_incidence, &measured, inverse_depths);
        let with_depth =
            |(p, rho): (&BoardPixel, &f64)| (!rho.is_nan()).then_some(BoardPixel { depth_mm: 1.0 / rho, ..*p });
        list.extend(chunk.iter().zip(&*inverse_depths).map(with_depth));
    }
    list
}

/// A pixel whose ray is another after correction: the depth image is displaced, or the lens breathes.
fn corrected_anew(
    camera: &Camera,
    p: &BoardPixel,
    context: &Context,
    surface: &BoardSurface<'_>,
) -> Option<BoardPixel> {
    let (ray, rho) = camera.correct_near(context, p.cos_incidence, 1.0 / p.depth_mm, Some(p.ray)).ok()?;
    let board_depth_mm = surface.depth(ray)?;
    let on_board = surface.plane().to_board(ray, board_depth_mm);
    Some(BoardPixel { depth_mm: 1.0 / rho, board_depth_mm, board: [on_board.x, on_board.y], ray, ..*p })
}
