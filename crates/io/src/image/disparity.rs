//! Depth from disparities, as structured-light cameras have them before they make depth of them.

use serde::{Deserialize, Serialize};

use super::depth_frame::{DepthFrame, DepthValues};

/// Value of Kinect's raw disparity, of 11 bits, where nothing was measured.
const NO_DISPARITY: f64 = 2047.0;

/// The affine function that makes inverse depth of a disparity d: 1/z = a + b d.
///
/// Its values need not be exact: an error of a is the depth model's dz, one of b its dw.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Disparity(
    /// a and b, 1/mm.
    pub [f64; 2],
);

impl Disparity {
    /// The depth in mm, as floating-point numbers; NaN where nothing was measured, and where inverse depth would not be positive.
    pub fn depth(&self, raw: &DepthFrame) -> DepthFrame {
        let Self([a, b]) = *self;
        let depth = |index: usize| {
            let disparity = raw.measurement(index).filter(|d| *d != NO_DISPARITY);
            let rho = disparity.map(|d| a + b * d).filter(|rho| *rho > 0.0);
            rho.map_or(f32::NAN, |rho| (1.0 / rho) as f32)
        };
        let values = DepthValues::Float((0..raw.len()).map(depth).collect());
        DepthFrame { width: raw.width, height: raw.height, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kinect 1's nominal values: 1091.5 − d is 348 m over z.
    #[test]
    fn raw_disparities_of_a_kinect_become_depth() {
        let disparity = Disparity([1091.5 / 348_000.0, -1.0 / 348_000.0]);
        let raw = DepthFrame { width: 5, height: 1, values: DepthValues::Steps(vec![743, 1000, 2047, 0, 1100]) };
        let DepthValues::Float(mm) = disparity.depth(&raw).values else { panic!() };
        assert!((mm[0] - 348_000.0 / 348.5).abs() < 1e-3 && (mm[1] - 348_000.0 / 91.5).abs() < 1e-2, "{mm:?}");
        // Nothing was measured, twice; beyond infinity.
        assert!(mm[2..].iter().all(|z| z.is_nan()), "{mm:?}");
    }
}
