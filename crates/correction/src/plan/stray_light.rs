//! Correction of stray light: a piece that depends on the light of the whole frame.
//!
//! With the measured range r_m, the true range is r − d, where r solves r − m Σ_f arg(1 − κ R_f(r)) = r_m and
//! R_f(r) = S_f exp(−i k_f r) / A; d, m, κ and k_f are constants or known at the pixel. Newton's method takes three steps from
//! r_m; from one to the next R_f turns by a small angle.

use depthcal_model::Modulation;
use depthcal_model::frame_covariates::{BLOCK_PX, FREQUENCIES, LIGHT_MM_PER_S, Phasors, phasor, turns_per_mm};

use super::piece::DepthPiece;
use crate::light::FrameLight;

/// Name of the piece that this stage inverts; the plan's comparison with the camera shows if it is another of the same name.
const NAME: &str = "stray_light";
/// Frequency, Hz, to which the delay by the nearest pixels refers.
const REFERENCE_HZ: f64 = 80e6;

/// Newton steps.
const NEWTON_STEPS: usize = 3;
/// Longest last step at which the iteration counts as converged, mm: it converges quadratically.
const CONVERGED_MM: f32 = 0.02;
/// Largest angle, rad, for which the turn between two steps is computed.
const LARGEST_TURN: f32 = 0.6;
/// Least real part of 1 − κ R_f and least slope of r + δ(r). Pixels with less signal of their own are inverted in f64.
const LEAST: f32 = 0.1;

type Lanes = [f32; BLOCK_PX];

/// The stage.
#[derive(Debug, Clone)]
pub(crate) struct StrayLight {
    kappa: f32,
    /// Delay per ratio of the nearest pixels' light, mm.
    delay_mm: f32,
    /// Range per radian of the sum of phases, mm.
    mm_per_rad: f32,
    turns_per_mm: [f32; FREQUENCIES],
    width: usize,
    /// Range over depth at every pixel.
    slants: Vec<f32>,
}

/// Range over depth on every ray; 1 where there is no ray.
pub(crate) fn slants(rays: &[[f64; 2]]) -> Vec<f32> {
    let slant = |[x, y]: &[f64; 2]| (1.0 + x * x + y * y).sqrt();
    rays.iter().map(|ray| if ray[0].is_nan() { 1.0 } else { slant(ray) as f32 }).collect()
}

impl StrayLight {
    /// The stage of a piece; `None` for a piece that is not this one.
    pub fn new(piece: &DepthPiece, width: usize, rays: &[[f64; 2]]) -> Option<Self> {
        let modulation = Modulation::of(&piece.piece.options());
        let (&[kappa, b], true) = (piece.theta.as_slice(), piece.piece.name() == NAME) else { return None };
        let mm_per_rad = |hz: f64| LIGHT_MM_PER_S / (4.0 * std::f64::consts::PI * hz);
        let sum_hz = modulation.sum_hz();
        (sum_hz > 0.0).then(|| Self {
            kappa: kappa as f32,
            delay_mm: (b * mm_per_rad(REFERENCE_HZ)) as f32,
            mm_per_rad: mm_per_rad(sum_hz) as f32,
            turns_per_mm: turns_per_mm(&modulation),
            width,
            slants: slants(rays),
        })
    }

    /// Takes measured to true depth (mm), in place, for consecutive pixels from `first` on. 0 and NaN stay, and pixels without
    /// light of their own; NaN where the iteration does not converge.
    #[inline(always)]
    pub fn correct(&self, light: &FrameLight, first: usize, z: &mut [f32]) {
        let (local, near) = light.own_and_near();
        let mut done = 0;
        while done < z.len() {
            let index = first + done;
            let (row, column) = (index / self.width, index % self.width);
            let (node, offset) = (column / BLOCK_PX, column % BLOCK_PX);
            let count = (BLOCK_PX - offset).min(self.width - column).min(z.len() - done);
            let nodes = light.row(row);
            let ends = [&nodes[node], &nodes[(node + 1).min(nodes.len() - 1)]];
            let pixels = index..index + count;
            let known = [&local[pixels.clone()], &near[pixels.clone()], &self.slants[pixels]];
            let of_pixels = &mut z[done..done + count];
            if let ([Ok(local), Ok(near), Ok(slants)], Ok(z)) = (known.map(Lanes::try_from), of_pixels.try_into()) {
                self.block(ends, offset, [&local, &near, &slants], z);
            } else {
                // Lanes without a pixel have depth 0.
                let mut lanes = [0.0; BLOCK_PX];
                lanes[..count].copy_from_slice(of_pixels);
                let known = known.map(|values| {
                    let mut lanes = [1.0; BLOCK_PX];
                    lanes[..count].copy_from_slice(values);
                    lanes
                });
                self.block(ends, offset, known.each_ref(), &mut lanes);
                of_pixels.copy_from_slice(&lanes[..count]);
            }
            done += count;
        }
    }

    /// Consecutive pixels between two nodes: own amplitude, ratio of the nearest pixels' light and slant of each.
    #[inline(always)]
    fn block(&self, ends: [&Phasors; 2], offset: usize, [own, near, slants]: [&Lanes; 3], z: &mut Lanes) {
        // r − r_m.
        let mut change: Lanes = [0.0; BLOCK_PX];
        // R of every frequency, real and imaginary parts.
        let mut shares = [[[0.0_f32; BLOCK_PX]; 2]; FREQUENCIES];
        for (f, [along, across]) in shares.iter_mut().enumerate() {
            let ([re, im], [re_next, im_next]) = (ends[0].0[f], ends[1].0[f]);
            for i in 0..BLOCK_PX {
                let t = (offset + i) as f32 * (1.0 / BLOCK_PX as f32);
                let (re, im) = (re + t * (re_next - re), im + t * (im_next - im));
                let [cos, sin] = phasor(z[i] * slants[i] * self.turns_per_mm[f]);
                let per_own = 1.0 / own[i];
                along[i] = (cos * re + sin * im) * per_own;
                across[i] = (cos * im - sin * re) * per_own;
            }
        }
        let mut step: Lanes = [0.0; BLOCK_PX];
        // How far the iteration is from where it cannot be trusted; negative beyond.
        let mut margin: Lanes = [1.0; BLOCK_PX];
        for iteration in 0..NEWTON_STEPS {
            let mut turned: Lanes = [0.0; BLOCK_PX];
            let mut slope: Lanes = [1.0; BLOCK_PX];
            for ([along, across], turns) in shares.iter_mut().zip(self.turns_per_mm) {
                let k = turns * std::f32::consts::TAU;
                if iteration > 0 {
                    turn(along, across, k, &step, &mut margin);
                }
                let gain = self.mm_per_rad * self.kappa * k;
                for i in 0..BLOCK_PX {
                    let (re, im) = (along[i], across[i]);
                    let (x, y) = (1.0 - self.kappa * re, -self.kappa * im);
                    margin[i] = least(margin[i], x - LEAST);
                    turned[i] += angle(y, x);
                    slope[i] -= gain * (re - self.kappa * (re * re + im * im)) / (x * x + y * y);
                }
            }
            for i in 0..BLOCK_PX {
                margin[i] = least(margin[i], slope[i] - LEAST);
                step[i] = (self.mm_per_rad * turned[i] - change[i]) / slope[i];
                change[i] += step[i];
            }
        }
        for i in 0..BLOCK_PX {
            let corrected = z[i] + (change[i] - self.delay_mm * near[i]) / slants[i];
            let good = (margin[i] > 0.0) & (step[i].abs() <= CONVERGED_MM) & (corrected > 0.0);
            let corrected = if good { corrected } else { f32::NAN };
            z[i] = if (z[i] > 0.0) & (own[i] > 0.0) { corrected } else { z[i] };
        }
    }
}

/// Turns phasors back by the phase of `step` (mm) at k (rad/mm).
#[inline(always)]
fn turn(along: &mut Lanes, across: &mut Lanes, k: f32, step: &Lanes, margin: &mut Lanes) {
    for i in 0..BLOCK_PX {
        let a = -k * step[i];
        let a2 = a * a;
        let cos = 1.0 - a2 * (0.5 - a2 * (1.0 / 24.0 - a2 * (1.0 / 720.0)));
        let sin = a * (1.0 - a2 * (1.0 / 6.0 - a2 * (1.0 / 120.0 - a2 * (1.0 / 5040.0))));
        margin[i] = least(margin[i], LARGEST_TURN - a.abs());
        (along[i], across[i]) = (along[i] * cos - across[i] * sin, along[i] * sin + across[i] * cos);
    }
}

/// The lesser of two numbers, in one instruction; the second where either is NaN.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The angle of (x, y) for x > 0, to within 2·10⁻⁷.
#[inline(always)]
fn angle(y: f32, x: f32) -> f32 {
    let b = y.abs();
    let (small, large) = (b <= 0.414_213_57 * x, b > 2.414_213_7 * x);
    // Reduced to an angle between −π/8 and π/8.
    let above = if small {
        b
    } else if large {
        -x
    } else {
        b - x
    };
    let below = if small {
        x
    } else if large {
        b
    } else {
        b + x
    };
    let base = if small {
        0.0
    } else if large {
        std::f32::consts::FRAC_PI_2
    } else {
        std::f32::consts::FRAC_PI_4
    };
    let t = above / below;
    let s = t * t;
    let atan = (((8.053_744_5e-2 * s - 1.387_768_6e-1) * s + 1.997_771_1e-1) * s - 3.333_295e-1) * s * t + t;
    (base + atan).copysign(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_atan2() {
        for i in -2000..2000 {
            let y = i as f32 * 5e-3;
            for x in [0.1, 0.5, 1.0, 3.7_f32] {
                let expected = f64::from(y).atan2(f64::from(x));
                assert!((f64::from(angle(y, x)) - expected).abs() < 2e-7, "{y} {x}");
            }
        }
    }
}
