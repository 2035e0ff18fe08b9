//! Searches for functions that were made before: the loop comes to the same residuals by several ways, and a search takes longer
//! than a fit.

use std::cell::RefCell;

use depthcal_model::Block;

use crate::calibrate::CalibratedCamera;
use crate::diagnose::discovery::Component;
use crate::observe::noise::NoiseModel;

/// Parameters are alike that differ by less than this share of their typical deviations: by far less than a search could tell.
const ALIKE: f64 = 0.01;
/// Noise is alike that differs by less than this share.
const AS_NOISY: f64 = 0.02;
/// Inverse depths at which noise is compared, 1/mm.
const INVERSE_DEPTHS: [f64; 2] = [5e-4, 2e-3];

/// Searches with their results.
#[derive(Default)]
pub(super) struct KnownSearches(RefCell<Vec<Known>>);

/// A search: all that it depends on, and its components.
struct Known {
    frames: Vec<String>,
    blocks: Vec<Block>,
    noise: NoiseModel,
    taken: Vec<String>,
    components: Vec<Component>,
}

impl KnownSearches {
    /// The components that `search` finds in the residuals of a fit, or those that it found in the same ones before.
    pub fn components(
        &self,
        fit: &CalibratedCamera,
        taken: &[String],
        search: impl FnOnce() -> Vec<Component>,
    ) -> Vec<Component> {
        if let Some(known) = self.0.borrow().iter().find(|known| known.is_of(fit, taken)) {
            return known.components.clone();
        }
        let components = search();
        self.0.borrow_mut().push(Known {
            frames: fit.capture.frames.iter().map(|frame| frame.name.clone()).collect(),
            blocks: fit.camera.blocks().to_vec(),
            noise: fit.noise,
            taken: taken.to_vec(),
            components: components.clone(),
        });
        components
    }
}

impl Known {
    fn is_of(&self, fit: &CalibratedCamera, taken: &[String]) -> bool {
        let frames = &fit.capture.frames;
        let blocks = fit.camera.blocks();
        self.taken == taken
            && self.frames.len() == frames.len()
            && self.frames.iter().zip(frames.iter()).all(|(name, frame)| *name == frame.name)
            && is_as_noisy(&self.noise, &fit.noise)
            && self.blocks.len() == blocks.len()
            && self.blocks.iter().zip(blocks).all(|(a, b)| are_alike(a, b))
    }
}

/// Whether two blocks are of one piece with the same constants, and have nearly the same parameters.
fn are_alike(a: &Block, b: &Block) -> bool {
    let constants = |block: &Block| block.piece().map(|piece| (piece.options(), piece.formula().cloned()));
    let differences = a.theta.iter().zip(&b.theta).zip(a.parameters());
    a.name() == b.name()
        && a.free == b.free
        && constants(a) == constants(b)
        && a.theta.len() == b.theta.len()
        && differences.into_iter().all(|((a, b), parameter)| (a - b).abs() <= ALIKE * parameter.scale)
}

fn is_as_noisy(a: &NoiseModel, b: &NoiseModel) -> bool {
    let is_close = |a: f64, b: f64| (a / b - 1.0).abs() <= AS_NOISY;
    is_close(a.pixel_sigma, b.pixel_sigma)
        && INVERSE_DEPTHS.iter().all(|rho| is_close(a.depth.sigma(*rho), b.depth.sigma(*rho)))
}

#[cfg(all(test, feature = "simulate"))]
mod tests {
    use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

    use super::*;
    use crate::calibrate::{CameraOptions, calibrate_camera};
    use crate::simulated;

    /// Other parameters, noise, names or frames are another question.
    #[test]
    fn what_was_searched_is_not_searched_again() {
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 3).frames(12);
        let capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        let fit = calibrate_camera(&capture, &CameraOptions::default()).unwrap();
        let known = KnownSearches::default();
        let is_searched = |fit: &CalibratedCamera, taken: &[String]| {
            let mut searched = false;
            known.components(fit, taken, || {
                searched = true;
                Vec::new()
            });
            searched
        };
        assert!(is_searched(&fit, &[]));
        assert!(!is_searched(&fit, &[]));
        let with_fx = |change: f64| {
            let mut theta = fit.camera.theta();
            theta[0] += change * fit.camera.blocks()[0].parameters()[0].scale;
            CalibratedCamera { camera: fit.camera.with_theta(&theta), ..fit.clone() }
        };
        assert!(!is_searched(&with_fx(0.5 * ALIKE), &[]));
        assert!(is_searched(&with_fx(2.0 * ALIKE), &[]));
        let noise = NoiseModel { pixel_sigma: fit.noise.pixel_sigma * (1.0 + 2.0 * AS_NOISY), ..fit.noise };
        assert!(is_searched(&CalibratedCamera { noise, ..fit.clone() }, &[]));
        assert!(is_searched(&fit, &["found_z".to_owned()]));
        let fewer = fit.capture.subset(|i, _| i > 0);
        assert!(is_searched(&CalibratedCamera { capture: fewer, ..fit.clone() }, &[]));
    }
}
