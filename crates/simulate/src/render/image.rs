//! The infrared image.

use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::{Renderer, field};
use crate::defects::Shot;
use crate::light::Light;
use crate::scene::{Cut, PlacedBoard};
use crate::streams::{Purpose, stream};

/// Samples per side of a pixel that an edge crosses.
const SAMPLES: usize = 8;

/// What a pixel's ray meets first.
pub(super) struct Look<'a, 'b> {
    pub renderer: &'b Renderer<'a>,
    pub placed: PlacedBoard<'b>,
    pub light: Light,
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
                    // Part of the card is beyond the lens' field: it may be anywhere.
                    None => bounds = [f64::NEG_INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::INFINITY],
                }
            }
        }
        let grow = 3.0;
        let bounds = [bounds[0] - grow, bounds[1] - grow, bounds[2] + grow, bounds[3] + grow];
        Self { renderer, light: session.light(shot), placed, bounds }
    }

    /// Whether the card may be visible at this pixel of the image.
    pub fn may_show_board(&self, [u, v]: [f64; 2]) -> bool {
        let [u0, v0, u1, v1] = self.bounds;
        u >= u0 && u <= u1 && v >= v0 && v <= v1
    }

    /// The ray of a pixel of the image and where it meets the board.
    pub fn board(&self, pixel: [f64; 2]) -> Option<([f64; 2], Cut)> {
        let optics = &self.renderer.session.instrument.optics;
        let rays = &self.renderer.rays;
        if optics.breathing_mm == 0.0 {
            let ray = rays.at(pixel)?;
            return self.placed.cut(ray).map(|cut| (ray, cut));
        }
        let mut rho = 1.0 / self.placed.pose.translation[2];
        let mut found = None;
        for _ in 0..6 {
            let ray = rays.at(optics.in_focus(pixel, rho))?;
            let cut = self.placed.cut(ray)?;
            rho = 1.0 / cut.z;
            found = Some((ray, cut));
        }
        found
    }

    /// The ray of a pixel of the image that the board does not hide.
    pub fn ray_behind(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let optics = &self.renderer.session.instrument.optics;
        let wall = self.renderer.session.simulation.rendering.wall_mm;
        let rho = if wall > 0.0 { 1.0 / wall } else { 0.0 };
        self.renderer.rays.at(if optics.breathing_mm == 0.0 { pixel } else { optics.in_focus(pixel, rho) })
    }

    /// Signal at one point of the image.
    fn sample(&self, pixel: [f64; 2]) -> f64 {
        match self.board(pixel) {
            Some((ray, cut)) => {
                let albedo = self.placed.board.surface(cut.design).albedo;
                self.light.signal(albedo, cut.cosine, ray, cut.z)
            }
            None => self.sample_behind(pixel),
        }
    }

    fn sample_behind(&self, pixel: [f64; 2]) -> f64 {
        let behind = self.ray_behind(pixel).and_then(|ray| Some((ray, self.renderer.backdrop.hit(ray)?)));
        behind.map_or(0.0, |(ray, hit)| self.light.signal(hit.albedo, hit.cosine, ray, hit.z))
    }

    /// Whether an edge of print or card may cross the pixel.
    fn has_edge(&self, pixel: [f64; 2]) -> bool {
        match self.board(pixel) {
            Some((_, cut)) => {
                let surface = self.placed.board.surface(cut.design);
                surface.print_edge_mm.min(surface.card_edge_mm) < 0.8 * self.footprint(&cut)
            }
            None => [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]]
                .iter()
                .any(|d| self.board([pixel[0] + d[0], pixel[1] + d[1]]).is_some()),
        }
    }

    /// Length of a pixel's longer side on the board, mm, with some allowance for the lens.
    pub fn footprint(&self, cut: &Cut) -> f64 {
        let focal = self.renderer.session.instrument.optics.focal;
        1.2 * cut.z / focal[0].min(focal[1]) / cut.cosine.max(0.05)
    }

    fn pixel(&self, pixel: [f64; 2]) -> f64 {
        if !self.may_show_board(pixel) {
            return self.sample_behind(pixel);
        }
        if !self.has_edge(pixel) {
            return self.sample(pixel);
        }
        let offset = |i: usize| (i as f64 + 0.5) / SAMPLES as f64 - 0.5;
        let samples = (0..SAMPLES * SAMPLES).map(|i| [pixel[0] + offset(i % SAMPLES), pixel[1] + offset(i / SAMPLES)]);
        samples.map(|p| self.sample(p)).sum::<f64>() / (SAMPLES * SAMPLES) as f64
    }
}

/// The signal at every pixel without noise, as a share of full scale, blurred by the lens.
pub(super) fn signal(renderer: &Renderer<'_>, shot: &Shot) -> Vec<f32> {
    let simulation = renderer.session.simulation;
    let (width, height) = (simulation.camera.width, simulation.camera.height);
    let look = Look::new(renderer, shot);
    let mut sharp = vec![0.0f32; width * height];
    sharp.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
        for (column, value) in values.iter_mut().enumerate() {
            *value = look.pixel([column as f64, row as f64]) as f32;
        }
    });
    field::blur(&sharp, width, simulation.noise.blur_px)
}

/// The image with noise, in whole steps.
pub(super) fn expose(renderer: &Renderer<'_>, shot: &Shot, signal: &[f32]) -> Vec<u16> {
    let simulation = renderer.session.simulation;
    let noise = simulation.noise;
    let mut rng = stream(renderer.session.seed(), Purpose::ImageNoise, shot.source);
    let full = if simulation.rendering.image_bits == 16 { 65535.0 } else { 255.0 };
    let expose = |&signal: &f32| {
        let signal = f64::from(signal);
        let sigma = (noise.image_read * noise.image_read + noise.image_shot * signal).sqrt();
        let value = signal + sigma * rng.sample::<f64, _>(StandardNormal);
        (value.clamp(0.0, 1.0) * full).round() as u16
    };
    signal.iter().map(expose).collect()
}
