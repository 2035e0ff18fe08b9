//! Correction by a function of depth that is the same at all pixels, as a table.

use rayon::prelude::*;

use super::depth_table::{self, Cell, NODES, Values};
use super::scalar_inverse::inverse_depth;

/// Largest deviation from the exact inverse between two nodes, mm. Where the table deviates more, pixels are inverted
/// in f64.
const TOLERANCE_MM: f64 = 0.002;

/// True minus measured depth, tabulated over measured depth; NaN where the table is too coarse or there is no inverse.
#[derive(Debug, Clone)]
pub(crate) struct Curve {
    change: Box<Values>,
}

impl Curve {
    /// Tabulates the inverse of `measured`, which maps true to measured inverse depth (1/mm).
    pub fn new(measured: impl Fn(f64) -> f64 + Sync) -> Self {
        let change_at = |z_m: f64| 1.0 / inverse_depth(&measured, 1.0 / z_m).unwrap_or(f64::NAN) - z_m;
        let at_nodes: Vec<f64> =
            (0..NODES).into_par_iter().map(|i| change_at(f64::from(depth_table::node(i)))).collect();
        let coarse: Vec<bool> = (0..NODES - 1)
            .into_par_iter()
            .map(|i| {
                let [here, next] = [i, i + 1].map(|i| f64::from(depth_table::node(i)));
                let miss = |t: f64| {
                    let linear = at_nodes[i] + t * (at_nodes[i + 1] - at_nodes[i]);
                    (change_at(here + t * (next - here)) - linear).abs()
                };
                !(miss(0.25) < TOLERANCE_MM && miss(0.5) < TOLERANCE_MM && miss(0.75) < TOLERANCE_MM)
            })
            .collect();
        let mut change = depth_table::zeros();
        for i in 0..NODES {
            let unusable = coarse.get(i).copied().unwrap_or(true);
            change[i] = if unusable { f32::NAN } else { at_nodes[i] as f32 };
        }
        Self { change }
    }

    /// Takes measured to true depth (mm), in place. 0 stays 0; NaN where the table does not reach.
    #[inline(always)]
    pub fn correct(&self, z: &mut [f32]) {
        for z in z {
            let cell = Cell::of(*z);
            let corrected = *z + cell.value_and_rise(&self.change).0;
            let corrected = if cell.inside { corrected } else { f32::NAN };
            *z = if *z > 0.0 { corrected } else { *z };
        }
    }
}
