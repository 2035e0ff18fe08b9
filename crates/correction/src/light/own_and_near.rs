//! Own amplitude and that of the nearest pixels, for whole rows.

use depthcal_model::frame_covariates::{NEAR_REACH, NEAR_WEIGHTS, OWN_REACH};

use crate::simd::{Isa, Kernel};

/// Mean amplitude over 3×3 pixels and the ratio to it of the nearest pixels' light, as
/// [`own_and_near`](depthcal_model::frame_covariates::own_and_near) has them, for consecutive rows.
pub(super) struct OwnAndNear<'a> {
    /// Of the whole frame.
    pub amplitude: &'a [u16],
    pub size: [usize; 2],
    pub first_row: usize,
    /// Results for the rows.
    pub own: &'a mut [f32],
    /// NaN where the own amplitude is 0.
    pub near: &'a mut [f32],
}

/// Pixels within `reach` of `at` in a row or column of `length`.
#[inline(always)]
fn span(center: usize, reach: usize, length: usize) -> std::ops::Range<usize> {
    center.saturating_sub(reach)..(center + reach + 1).min(length)
}

/// Sum of the near weights that lie within a row or column.
#[inline(always)]
fn total(center: usize, length: usize) -> f32 {
    span(center, NEAR_REACH, length).map(|i| NEAR_WEIGHTS[i + NEAR_REACH - center]).sum()
}

impl Kernel for OwnAndNear<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let Self { amplitude, size: [width, height], first_row, own, near } = self;
        // Sums down the columns, with zeros beyond both ends of the row.
        let (mut box_sums, mut near_sums) =
            (vec![0.0_f32; width + 2 * OWN_REACH], vec![0.0_f32; width + 2 * NEAR_REACH]);
        let across: Vec<f32> = (0..width).map(|u| 1.0 / total(u, width)).collect();
        let columns: Vec<f32> = (0..width).map(|u| span(u, OWN_REACH, width).len() as f32).collect();
        for (line, (local, near)) in own.chunks_exact_mut(width).zip(near.chunks_exact_mut(width)).enumerate() {
            let v = first_row + line;
            box_sums.fill(0.0);
            near_sums.fill(0.0);
            for row in span(v, NEAR_REACH, height) {
                let weight = NEAR_WEIGHTS[row + NEAR_REACH - v];
                let values = &amplitude[row * width..][..width];
                for (sum, value) in near_sums[NEAR_REACH..].iter_mut().zip(values) {
                    *sum += weight * f32::from(*value);
                }
                if row.abs_diff(v) <= OWN_REACH {
                    for (sum, value) in box_sums[OWN_REACH..].iter_mut().zip(values) {
                        *sum += f32::from(*value);
                    }
                }
            }
            let rows = span(v, OWN_REACH, height).len() as f32;
            let down = 1.0 / total(v, height);
            for u in 0..width {
                local[u] = (box_sums[u] + box_sums[u + 1] + box_sums[u + 2]) / (columns[u] * rows);
            }
            near.fill(0.0);
            for (tap, weight) in NEAR_WEIGHTS.iter().enumerate() {
                for (near, sum) in near.iter_mut().zip(&near_sums[tap..]) {
                    *near += weight * sum;
                }
            }
            for u in 0..width {
                let ratio = near[u] * across[u] * down / local[u];
                near[u] = if local[u] > 0.0 { ratio } else { f32::NAN };
            }
        }
    }
}
