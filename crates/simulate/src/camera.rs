//! The true camera: intrinsics, lens and projective depth distortion; and the published cameras.

use serde::{Deserialize, Serialize};

use crate::error::{SimulateError, check, positive};

/// True parameters of a depth camera. Pixel centres have integer coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CameraTruth {
    /// Image width, px.
    pub width: usize,
    /// Image height, px.
    pub height: usize,
    /// Focal lengths [fx, fy], px.
    pub focal_px: [f64; 2],
    /// Skew s in u = fx x' + s y' + cx, px.
    pub skew_px: f64,
    /// Principal point [cx, cy], px.
    pub centre_px: [f64; 2],
    /// Brown–Conrady coefficients [k1, k2, p1, p2, k3].
    pub lens: [f64; 5],
    /// Coefficients k1 to k4 of a fisheye lens, whose image radius is f θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) at the angle θ to
    /// the axis; the other lens is then not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fisheye: Option<[f64; 4]>,
    /// Projective depth distortion [dx, dy, dz, dw]: ρ_m = dx x + dy y + dz + dw ρ; dx, dy, dz in 1/mm.
    pub depth: [f64; 4],
    /// Distance between projector and camera, along x, mm. Disparity is f · baseline · ρ, px.
    pub baseline_mm: f64,
}

impl CameraTruth {
    /// Camera 1, 2, 3 or 4 of Sjöholm 2017 (sections 6.2 and 6.5), 640×480 px.
    ///
    /// # Errors
    /// [`SimulateError::UnknownCamera`] for any other number.
    pub fn published(number: usize) -> Result<Self, SimulateError> {
        let (focal_px, centre_px, lens, depth) = match number {
            1 => (
                [476.9, 476.9],
                [312.97, 242.49],
                [-0.1468, 0.0463, 0.0012, -0.0007, -0.0756],
                [1.3406e-4, -3.52e-6, -6.99e-6, 1.00604654],
            ),
            2 => (
                [487.63, 487.75],
                [316.54, 245.37],
                [-0.113493, -0.085626, 0.001575, 0.001248, 0.094735],
                [1.7984e-4, 1.908e-5, -3.684e-5, 1.0393758],
            ),
            3 => (
                [476.85, 476.06],
                [314.35, 244.32],
                [-0.129139, -0.021613, -0.001209, 0.00017, -0.005435],
                [5.374e-5, -1.949e-5, 9.46e-6, 0.99313368],
            ),
            4 => (
                [476.82, 476.76],
                [311.17, 240.12],
                [-0.117859, -0.073007, 0.001899, 0.000341, 0.055911],
                [4.329e-5, 9e-8, 1.14e-6, 1.0045781],
            ),
            _ => return Err(SimulateError::UnknownCamera { number }),
        };
        Ok(Self { focal_px, centre_px, lens, depth, ..Self::ideal(640, 480, 476.9) })
    }

    /// A camera without lens distortion and depth distortion, with its principal point in the middle of the image.
    pub fn ideal(width: usize, height: usize, focal_px: f64) -> Self {
        Self {
            width,
            height,
            focal_px: [focal_px, focal_px],
            skew_px: 0.0,
            centre_px: [(width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0],
            lens: [0.0; 5],
            fisheye: None,
            depth: [0.0, 0.0, 0.0, 1.0],
            baseline_mm: 50.0,
        }
    }

    /// A fisheye camera of 150° from the left to the right border, 800×500 px, whose corners see 88° off axis.
    pub fn fisheye_150() -> Self {
        Self {
            centre_px: [402.7, 247.1],
            fisheye: Some([0.021, -0.009, 0.0024, -0.0003]),
            depth: [2.0e-5, -6.0e-6, 4.0e-6, 1.008],
            ..Self::ideal(800, 500, 299.5)
        }
    }

    /// Pixels of disparity per unit of inverse depth, px·mm.
    pub fn disparity_scale(&self) -> f64 {
        self.focal_px[0] * self.baseline_mm
    }

    /// Checks that the parameters are finite, and those that must be positive are.
    pub(crate) fn check(&self) -> Result<(), SimulateError> {
        positive([
            ("camera.width", self.width as f64),
            ("camera.height", self.height as f64),
            ("camera.focal_px", self.focal_px[0]),
            ("camera.focal_px", self.focal_px[1]),
            ("camera.baseline_mm", self.baseline_mm),
            ("camera.depth[3]", self.depth[3]),
        ])?;
        let others = [self.skew_px, self.centre_px[0], self.centre_px[1]];
        let others = others.into_iter().chain(self.lens).chain(self.fisheye.unwrap_or_default()).chain(self.depth);
        check(others.map(|value| ("camera", value)), "finite parameters", |_| true)
    }
}
