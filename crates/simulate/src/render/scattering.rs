//! Errors of depth by light that the lens spreads: sums over a whole frame.
//!
//! A time-of-flight camera measures a phasor at every pixel, of the pixel's amplitude A and of the phase 4π f r/c of its range r,
//! and smooths it over 3×3 pixels. What it measures, M, contains the pixel's own light and a share of the light S around it: the
//! own light is M − share · S, and the error of phase that of M against it.

use std::f64::consts::PI;

use crate::instrument::Scattering;

/// Frequency at which the delay by the nearest pixels is given, Hz.
const DELAY_AT: f64 = 80e6;
/// Speed of light, mm/s.
const C: f64 = 299_792_458e3;
/// Standard deviations of the spread light, px: that of the whole scene, and that of the nearest pixels.
const WIDE_PX: f64 = 200.0;
const NEAR_PX: f64 = 0.8;
/// Side of the tiles by which the scene is summed, px.
const TILE: usize = 4;

/// The frame that is exposed, row by row: amplitude of the infrared signal, and range (mm; 0 where there is nothing to be seen).
pub(super) struct Frame<'a> {
    pub width: usize,
    pub amplitude: &'a [f64],
    pub range_mm: &'a [f64],
}

impl Frame<'_> {
    fn height(&self) -> usize {
        self.amplitude.len() / self.width
    }

    /// Mean over the pixels of `values` about (u, v), weighted by the distance.
    fn mean(&self, values: &[f64], [u, v]: [usize; 2], reach: usize, weight: impl Fn(f64) -> f64) -> f64 {
        let (mut sum, mut total) = (0.0, 0.0);
        for y in v.saturating_sub(reach)..=(v + reach).min(self.height() - 1) {
            for x in u.saturating_sub(reach)..=(u + reach).min(self.width - 1) {
                let distance2 = (x as f64 - u as f64).powi(2) + (y as f64 - v as f64).powi(2);
                sum += weight(distance2) * values[y * self.width + x];
                total += weight(distance2);
            }
        }
        sum / total
    }

    /// The error of range at every pixel, mm, with light of these modulation frequencies; 0 for one that is not used.
    pub fn range_errors(&self, scattering: &Scattering, modulation_mhz: &[f64]) -> Vec<f64> {
        let pixels = || (0..self.amplitude.len()).map(|i| [i % self.width, i / self.width]);
        let near: Vec<f64> = pixels()
            .map(|pixel| self.mean(self.amplitude, pixel, 3, |d2| (-d2 / (2.0 * NEAR_PX * NEAR_PX)).exp()))
            .collect();
        let frequencies: Vec<f64> = modulation_mhz.iter().filter(|f| **f > 0.0).map(|f| 1e6 * f).collect();
        let scenes: Vec<Scene> = frequencies.iter().map(|f| self.scene(*f)).collect();
        let total: f64 = frequencies.iter().sum();
        let error = |(i, pixel): (usize, [usize; 2])| {
            let local = self.mean(self.amplitude, pixel, 1, |_| 1.0);
            let mut phases = 0.0;
            for (scene, f) in scenes.iter().zip(&frequencies) {
                let phase = 4.0 * PI * f * self.range_mm[i] / C;
                let spread = scene.at(pixel);
                let own_light = [local * phase.cos(), local * phase.sin()];
                let unscattered =
                    [own_light[0] - scattering.share * spread[0], own_light[1] - scattering.share * spread[1]];
                let turn = phase - unscattered[1].atan2(unscattered[0]);
                phases += turn - (turn / (2.0 * PI)).round() * 2.0 * PI;
            }
            let delay = scattering.delay_rad * self.mean(&near, pixel, 1, |_| 1.0) / local;
            let error = C / (4.0 * PI) * (phases / total + delay / DELAY_AT);
            if local > 0.0 && error.is_finite() { error } else { 0.0 }
        };
        pixels().enumerate().map(error).collect()
    }

    /// The light of the scene at one frequency.
    fn scene(&self, f: f64) -> Scene {
        let [columns, rows] = [self.width.div_ceil(TILE), self.height().div_ceil(TILE)];
        let mut tiles = vec![[0.0; 3]; columns * rows];
        for (i, (amplitude, range)) in self.amplitude.iter().zip(self.range_mm).enumerate() {
            let tile = &mut tiles[i / self.width / TILE * columns + i % self.width / TILE];
            let phase = 4.0 * PI * f * range / C;
            let lit = if *range > 0.0 { *amplitude } else { 0.0 };
            *tile = [tile[0] + lit * phase.cos(), tile[1] + lit * phase.sin(), tile[2] + 1.0];
        }
        let weight = |a: usize, b: usize| {
            let distance = (a as f64 - b as f64) * TILE as f64 / WIDE_PX;
            (-0.5 * distance * distance).exp()
        };
        let add =
            |sum: [f64; 3], w: f64, part: &[f64; 3]| [sum[0] + w * part[0], sum[1] + w * part[1], sum[2] + w * part[2]];
        let across: Vec<[f64; 3]> = (0..tiles.len())
            .map(|i| {
                let row = &tiles[i / columns * columns..][..columns];
                row.iter().enumerate().fold([0.0; 3], |sum, (k, part)| add(sum, weight(k, i % columns), part))
            })
            .collect();
        let spread = (0..tiles.len()).map(|i| {
            let down =
                (0..rows).fold([0.0; 3], |sum, k| add(sum, weight(k, i / columns), &across[k * columns + i % columns]));
            [down[0] / down[2], down[1] / down[2]]
        });
        Scene { columns, rows, spread: spread.collect() }
    }
}

/// Spread light at the middles of tiles.
struct Scene {
    columns: usize,
    rows: usize,
    spread: Vec<[f64; 2]>,
}

impl Scene {
    /// Bilinear between the middles of tiles.
    fn at(&self, [u, v]: [usize; 2]) -> [f64; 2] {
        let middle = 0.5 * (TILE as f64 - 1.0);
        let place = |position: usize, count: usize| {
            let position_in_tiles = ((position as f64 - middle) / TILE as f64).clamp(0.0, (count - 1) as f64);
            (position_in_tiles as usize, (position_in_tiles as usize + 1).min(count - 1), position_in_tiles.fract())
        };
        let ((u0, u1, a), (v0, v1, b)) = (place(u, self.columns), place(v, self.rows));
        let get = |u: usize, v: usize, part: usize| self.spread[v * self.columns + u][part];
        [0, 1].map(|part| {
            let above = get(u0, v0, part) * (1.0 - a) + get(u1, v0, part) * a;
            let below = get(u0, v1, part) * (1.0 - a) + get(u1, v1, part) * a;
            above * (1.0 - b) + below * b
        })
    }
}
