//! A camera with the covariance of its parameters.

use nalgebra::DMatrix;

use crate::camera::Camera;

/// Change of parameters for a derivative, in standard deviations: small against the curvature, large against rounding.
pub const STEP: f64 = 0.1;
/// Directions of less variance than this share of the largest are rounding.
const NEGLIGIBLE: f64 = 1e-13;

/// A camera with the uncertainty of its parameters.
#[derive(Debug, Clone)]
pub struct UncertainCamera {
    /// The camera.
    pub camera: Camera,
    /// Independent changes of all parameters, each of one standard deviation; none where the camera is taken as exact.
    directions: Vec<Vec<f64>>,
}

impl UncertainCamera {
    /// A camera that is taken as exact.
    pub fn exact(camera: Camera) -> Self {
        Self { camera, directions: Vec::new() }
    }

    /// A camera with the covariance of some of its parameters, given by their places in [`Camera::theta`]; it is exact where all
    /// are held.
    pub fn new(camera: Camera, places: &[usize], covariance: &DMatrix<f64>) -> Self {
        if places.is_empty() {
            return Self::exact(camera);
        }
        let std_devs: Vec<f64> = (0..places.len()).map(|i| covariance[(i, i)].sqrt()).collect();
        let correlation = DMatrix::from_fn(places.len(), places.len(), |i, j| {
            let product = std_devs[i] * std_devs[j];
            if product > 0.0 { covariance[(i, j)] / product } else { 0.0 }
        });
        let eigen = correlation.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let parameters = camera.theta().len();
        let direction = |k: usize| {
            let mut change = vec![0.0; parameters];
            let scale = eigen.eigenvalues[k].sqrt();
            places
                .iter()
                .enumerate()
                .for_each(|(i, place)| change[*place] = std_devs[i] * scale * eigen.eigenvectors[(i, k)]);
            change
        };
        let certain = |k: &usize| eigen.eigenvalues[*k] > NEGLIGIBLE * largest;
        let directions = (0..places.len()).filter(certain).map(direction).collect();
        Self { camera, directions }
    }

    /// Whether it is taken as exact.
    pub fn is_exact(&self) -> bool {
        self.directions.is_empty()
    }

    /// The camera with parameters changed to either side along every direction, by [`STEP`] standard deviations.
    pub fn changed(&self) -> Vec<[Camera; 2]> {
        let theta = self.camera.theta();
        let along = |direction: &Vec<f64>| {
            [STEP, -STEP].map(|step| {
                let shifted: Vec<f64> = theta.iter().zip(direction).map(|(t, d)| t + step * d).collect();
                self.camera.with_theta(&shifted)
            })
        };
        self.directions.iter().map(along).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_whose_parameters_are_all_held_is_exact() {
        let camera = Camera::new(640, 480, [500.0, 500.0, 319.5, 239.5, 0.0], vec![]);
        let held = UncertainCamera::new(camera.clone(), &[], &DMatrix::zeros(0, 0));
        assert!(held.is_exact() && held.changed().is_empty());
        assert!(!UncertainCamera::new(camera, &[0], &DMatrix::identity(1, 1)).is_exact());
    }
}
