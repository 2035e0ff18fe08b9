//! The depth image.

use rand::RngExt;
use rand_distr::{ChiSquared, Distribution};
use rayon::prelude::*;

use super::field;
use super::look::Look;
use super::renderer::Renderer;
use super::scattering::Frame;
use crate::board::Pattern;
use crate::defects::Shot;
use crate::instrument::Reading;
use crate::streams::{Purpose, stream};

/// Measurement of a depth pixel before noise.
#[derive(Clone, Copy, Default)]
struct Pixel {
    /// Measured inverse depth, 1/mm; 0 when nothing is measured.
    rho: f64,
    /// True depth, mm.
    z: f64,
    /// Range over depth.
    slant: f64,
    /// Infrared signal, share of full scale.
    amplitude: f64,
    /// The pixel is missing when a standard normal variable is below this; −∞ for never.
    missing_below: f64,
    /// Standard deviation of the noise relative to the usual one.
    roughness: f64,
}

/// Thresholds of [`Pixel::missing_below`], with the resulting share of missing pixels.
mod missing {
    pub const NEVER: f64 = f64::NEG_INFINITY;
    /// 15 %
    pub const BESIDE_PRINT: f64 = -1.036;
    /// 30 %
    pub const WEAK_SIGNAL: f64 = -0.524;
    /// 55 %
    pub const PRINT_EDGE: f64 = 0.126;
    /// 75 %
    pub const DOT: f64 = 0.674;
    /// 85 %
    pub const OUTLINE: f64 = 1.036;
    /// 10 %
    pub const DARK_SQUARE: f64 = -1.282;
    /// Share of pixels that are missing without a cause.
    pub const DROPOUT: f64 = 0.002;
}

/// Renders the depth image of an exposure whose infrared signal is `amplitude`.
pub(super) fn render(renderer: &Renderer<'_>, shot: &Shot, amplitude: &[f32]) -> Vec<u16> {
    let simulation = renderer.session.simulation;
    let (width, height) = (simulation.camera.width, simulation.camera.height);
    let rendering = simulation.rendering;
    let look = Look::new(renderer, shot);
    let mut pixels = vec![Pixel::default(); width * height];
    let measure_all = |pixels: &mut [Pixel], errors: &[f64]| {
        pixels.par_chunks_mut(width).enumerate().for_each(|(row, pixels)| {
            for (column, pixel) in pixels.iter_mut().enumerate() {
                let error = errors.get(row * width + column).copied().unwrap_or(0.0);
                *pixel = measure(&look, shot, amplitude, [column, row], error).unwrap_or_default();
            }
        });
    };
    measure_all(&mut pixels, &[]);
    if let Some(scattering) = &renderer.session.instrument.scattering {
        let values = |value: fn(&Pixel) -> f64| pixels.iter().map(value).collect::<Vec<f64>>();
        let (signal, range) = (values(|p| p.amplitude), values(|p| p.z * p.slant));
        let frame = Frame { width, amplitude: &signal, range_mm: &range };
        let errors = frame.range_errors(scattering, &rendering.modulation_mhz);
        measure_all(&mut pixels, &errors);
    }
    let mut rng = stream(renderer.session.seed(), Purpose::DepthNoise, shot.source);
    let noise = field::correlated(width, height, simulation.noise.depth_correlation_px, &mut rng);
    let mut holes = stream(renderer.session.seed(), Purpose::Holes, shot.source);
    let patches = field::correlated(width, height, 1.5, &mut holes);
    let tails = simulation.noise.tail_dof.and_then(|dof| Some((ChiSquared::new(dof).ok()?, dof - 2.0)));
    let outliers = simulation.defects.depth_outliers;
    let step = simulation.noise.depth_step_rho;
    let mut out = vec![0u16; width * height];
    for index in 0..out.len() {
        let pixel = pixels[index];
        // Every pixel consumes the same number of random numbers, so that a change of one pixel affects no other.
        let (drop, strike, far, mix): (f64, f64, f64, f64) =
            (holes.random(), holes.random(), holes.random_range(-1.0..1.0), holes.random());
        let spread = tails.map_or(1.0, |(chi, scale)| (scale / chi.sample(&mut rng)).sqrt());
        if pixel.rho <= 0.0 {
            continue;
        }
        let beyond = edge_of_depth(&pixels, width, index);
        let threshold = if beyond.is_some() { missing::OUTLINE } else { pixel.missing_below };
        // The shift of the threshold is continuous in the frequency of missing depth.
        let shifted = threshold + rendering.holes.max(1e-9).ln();
        if rendering.holes > 0.0 && (f64::from(patches[index]) < shifted || drop < missing::DROPOUT * rendering.holes) {
            continue;
        }
        let mut rho = pixel.rho;
        if let Some(other) = beyond.filter(|_| rendering.mixed_pixels) {
            rho += mix * (other - rho);
        }
        let sigma = simulation.noise.depth.sigma_rho(rho) * pixel.roughness * spread;
        rho += sigma * f64::from(noise[index]);
        if step > 0.0 {
            rho = (rho / step).round() * step;
        }
        let mut z = 1.0 / rho;
        if strike < outliers {
            z += far.signum() * (20.0 + 180.0 * far.abs());
        }
        let raw = (z / rendering.depth_unit_mm).round();
        if z > 0.0 && z <= rendering.max_range_mm && raw <= 65535.0 {
            out[index] = raw as u16;
        }
    }
    out
}

/// Measurement of the depth pixel (column, row), whose range is measured `range_error` mm too long; `None` when its ray meets
/// nothing.
fn measure(
    look: &Look<'_, '_>,
    shot: &Shot,
    amplitude: &[f32],
    [column, row]: [usize; 2],
    range_error: f64,
) -> Option<Pixel> {
    let session = &look.renderer.session;
    let simulation = session.simulation;
    let pixel = [column as f64, row as f64];
    let shown = session.instrument.image_pixel(pixel);
    let amplitude = signal_at(amplitude, simulation.camera.width, shown);
    let reading = |ray: [f64; 2], cosine: f64| Reading { pixel, ray, cosine, amplitude, conditions: shot.conditions };
    let slant = |ray: [f64; 2]| (1.0 + ray[0] * ray[0] + ray[1] * ray[1]).sqrt();
    let weak = if amplitude < 0.015 { missing::WEAK_SIGNAL } else { missing::NEVER };
    let board = if look.may_show_board(shown) { look.board(shown) } else { None };
    if let Some((ray, cut)) = board {
        let surface = look.placed.board.surface(cut.design);
        let edge_px = 1.2 * surface.print_edge_mm / look.footprint(&cut);
        // Depth is mostly missing on dark dots, but measured on a chessboard's squares, which are large.
        let board = look.placed.board;
        let chessboard = matches!(board.pattern, Pattern::Chessboard);
        let dark_dot = surface.printed && !chessboard && !board.white_on_black;
        let missing_below = match () {
            () if edge_px < 1.2 => missing::PRINT_EDGE,
            () if dark_dot => missing::DOT,
            () if edge_px < 2.5 => missing::BESIDE_PRINT,
            () if surface.printed && chessboard => missing::DARK_SQUARE,
            () => weak,
        };
        let roughness = if edge_px < 2.0 { simulation.rendering.edge_noise } else { 1.0 };
        let slant = slant(ray);
        let rho = session.instrument.measure(&reading(ray, cut.cosine), 1.0 / (cut.z + range_error / slant));
        return Some(Pixel { rho, z: cut.z, slant, amplitude, missing_below, roughness });
    }
    let ray = look.ray_behind(shown)?;
    let behind = look.renderer.backdrop.hit(ray)?;
    let slant = slant(ray);
    let rho = session.instrument.measure(&reading(ray, behind.cosine), 1.0 / (behind.z + range_error / slant));
    Some(Pixel { rho, z: behind.z, slant, amplitude, missing_below: weak, roughness: 1.0 })
}

/// The infrared signal at a position between pixels (px), clipped at full scale as the image is.
fn signal_at(amplitude: &[f32], width: usize, [u, v]: [f64; 2]) -> f64 {
    let height = amplitude.len() / width;
    let (u, v) = (u.clamp(0.0, width as f64 - 1.0), v.clamp(0.0, height as f64 - 1.0));
    let (column, row) = (u as usize, v as usize);
    let (right, below) = ((column + 1).min(width - 1), (row + 1).min(height - 1));
    let (a, b) = (u - column as f64, v - row as f64);
    let value = |row: usize, column: usize| f64::from(amplitude[row * width + column]);
    let top = value(row, column) * (1.0 - a) + value(row, right) * a;
    let bottom = value(below, column) * (1.0 - a) + value(below, right) * a;
    (top * (1.0 - b) + bottom * b).min(1.0)
}

/// Inverse depth beyond a depth discontinuity within two pixels of `index`; `None` when there is none.
fn edge_of_depth(pixels: &[Pixel], width: usize, index: usize) -> Option<f64> {
    let z = pixels[index].z;
    let (column, row) = ((index % width) as i64, (index / width) as i64);
    let height = (pixels.len() / width) as i64;
    let ring = (-2..=2).flat_map(|dv| (-2..=2).map(move |du| (row + dv, column + du)));
    ring.filter(|&(v, u)| v >= 0 && u >= 0 && v < height && u < width as i64)
        .map(|(v, u)| pixels[v as usize * width + u as usize])
        .find(|other| (other.z - z).abs() > 0.05 * z)
        .map(|other| if other.rho > 0.0 { other.rho } else { pixels[index].rho })
}
