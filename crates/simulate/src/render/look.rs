//! The scene of one exposure as pixels see it.

use super::renderer::Renderer;
use super::spread::Spread;
use crate::defects::Shot;
use crate::light::Light;
use crate::scene::{Cut, PlacedBoard};

/// The scene of one exposure as pixels see it.
pub(super) struct Look<'a, 'b> {
    pub renderer: &'b Renderer<'a>,
    pub placed: PlacedBoard<'b>,
    pub light: Light,
    spread: Spread,
    /// u0, v0, u1, v1 around the card.
    bounds: [f64; 4],
}

impl<'a, 'b> Look<'a, 'b> {
    pub fn new(renderer: &'b Renderer<'a>, shot: &Shot) -> Self {
        let session = &renderer.session;
        let placed = session.placed(shot);
        let [x0, y0, x1, y1] = session.simulation.board.card_rectangle();
        let mut bounds = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        for step in 0..=16 {
            let t = f64::from(step) / 16.0;
            let (x, y) = (x0 + t * (x1 - x0), y0 + t * (y1 - y0));
            for design in [[x, y0], [x, y1], [x0, y], [x1, y]] {
                match session.instrument.optics.project(placed.point(design)) {
                    Some([u, v]) => {
                        bounds = [bounds[0].min(u), bounds[1].min(v), bounds[2].max(u), bounds[3].max(v)];
                    }
                    // Part of the card is outside the lens' field of view: no bounds can be given.
                    None => bounds = [f64::NEG_INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::INFINITY],
                }
            }
        }
        let spread = Spread::new(session.simulation.noise.blur_px);
        let grow = 2.0 + spread.reach;
        let bounds = [bounds[0] - grow, bounds[1] - grow, bounds[2] + grow, bounds[3] + grow];
        Self { renderer, light: session.light(shot), placed, spread, bounds }
    }

    /// Whether the card may be visible at this pixel of the image; false only if it is not.
    pub fn may_show_board(&self, [u, v]: [f64; 2]) -> bool {
        let [u0, v0, u1, v1] = self.bounds;
        u >= u0 && u <= u1 && v >= v0 && v <= v1
    }

    /// The ray of a pixel of the image and its intersection with the board; `None` when it misses the board.
    pub fn board(&self, pixel: [f64; 2]) -> Option<([f64; 2], Cut)> {
        let optics = &self.renderer.session.instrument.optics;
        let rays = &self.renderer.rays;
        if optics.breathing_mm == 0.0 {
            let ray = rays.at(pixel)?;
            return self.placed.cut(ray).map(|cut| (ray, cut));
        }
        let mut rho = 1.0 / self.placed.pose.translation[2];
        let mut nearest = None;
        for _ in 0..6 {
            let ray = rays.at(optics.in_focus(pixel, rho))?;
            let cut = self.placed.cut(ray)?;
            rho = 1.0 / cut.z;
            nearest = Some((ray, cut));
        }
        nearest
    }

    /// The ray of a pixel of the image that shows the background.
    pub fn ray_behind(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let optics = &self.renderer.session.instrument.optics;
        let wall = self.renderer.session.simulation.rendering.wall_mm;
        let rho = if wall > 0.0 { 1.0 / wall } else { 0.0 };
        self.renderer.rays.at(if optics.breathing_mm == 0.0 { pixel } else { optics.in_focus(pixel, rho) })
    }

    /// Mean signal over a square of the image, `side` px wide, about a point.
    fn sample(&self, pixel: [f64; 2], side: f64) -> f64 {
        match self.board(pixel) {
            Some((ray, cut)) => {
                let board = self.placed.board;
                let surface = board.surface(cut.design);
                // An edge through the square mixes dark and bright in proportion. Samples that are either dark or
                // bright would quantise the positions of the edges of small dots.
                let width = side * cut.z / self.renderer.session.instrument.optics.focal[0];
                let beyond = (0.5 - surface.print_edge_mm / width).max(0.0);
                let other = board.bright + board.dark - surface.albedo;
                let albedo = surface.albedo + beyond * (other - surface.albedo);
                self.light.signal(albedo, cut.cosine, ray, cut.z)
            }
            None => self.sample_behind(pixel),
        }
    }

    fn sample_behind(&self, pixel: [f64; 2]) -> f64 {
        let behind = self.ray_behind(pixel).and_then(|ray| Some((ray, self.renderer.backdrop.hit(ray)?)));
        behind.map_or(0.0, |(ray, hit)| self.light.signal(hit.albedo, hit.cosine, ray, hit.z))
    }

    /// Whether light from beyond an edge of print, card or background may reach the pixel.
    fn has_edge(&self, pixel: [f64; 2], near_board: bool) -> bool {
        let reach = self.spread.reach;
        let around = || {
            (0..9).filter(|i| *i != 4).map(|i| {
                let [i, j] = [f64::from(i % 3) - 1.0, f64::from(i / 3) - 1.0];
                [pixel[0] + i * reach, pixel[1] + j * reach]
            })
        };
        if near_board {
            if let Some((_, cut)) = self.board(pixel) {
                let surface = self.placed.board.surface(cut.design);
                return surface.print_edge_mm.min(surface.card_edge_mm) < reach.max(0.8) * self.footprint(&cut);
            }
            if around().any(|p| self.board(p).is_some()) {
                return true;
            }
        }
        let backdrop = &self.renderer.backdrop;
        let part = |p: [f64; 2]| self.ray_behind(p).map(|ray| backdrop.part(ray));
        backdrop.has_edges() && around().any(|p| part(p) != part(pixel))
    }

    /// Length of a pixel's longer side on the board, mm, with a margin of 20 % for the lens.
    pub fn footprint(&self, cut: &Cut) -> f64 {
        let focal = self.renderer.session.instrument.optics.focal;
        1.2 * cut.z / focal[0].min(focal[1]) / cut.cosine.max(0.05)
    }

    /// Infrared signal of a pixel of the image, share of full scale, without noise.
    pub fn pixel(&self, pixel: [f64; 2]) -> f64 {
        let near_board = self.may_show_board(pixel);
        if self.has_edge(pixel, near_board) {
            let side = self.spread.step;
            let sample = |&([du, dv], weight): &([f64; 2], f64)| {
                let shifted = [pixel[0] + du, pixel[1] + dv];
                weight * if near_board { self.sample(shifted, side) } else { self.sample_behind(shifted) }
            };
            return self.spread.samples.iter().map(sample).sum();
        }
        if near_board { self.sample(pixel, 1.0) } else { self.sample_behind(pixel) }
    }
}
