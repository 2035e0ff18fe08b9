//! The reported standard deviations are right: 100 simulated captures of camera 1 at the point level.

use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::simulated;
use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};
use nalgebra::DVector;
use rayon::prelude::*;

const SEEDS: u64 = 100;

/// Errors of the free parameters over their standard deviations, and the normalised squared error eᵀ Σ⁻¹ e.
fn one(seed: u64) -> (Vec<f64>, f64) {
    let camera = CameraTruth::published(1).unwrap();
    let simulation = Simulation::new(camera, Kind::General(1), &[], seed);
    let observed = simulation.observe_points(&PointOptions::default()).unwrap();
    let result = calibrate_camera(&simulated::capture(&observed), &CameraOptions::default()).unwrap();
    assert!(result.capture.dropped.is_empty(), "seed {seed}: {:?}", result.capture.dropped);
    let truth = simulated::true_theta(&camera);
    let covariance = result.covariance.as_ref().unwrap();
    let free: Vec<usize> = (0..truth.len()).filter(|i| covariance[(*i, *i)] > 0.0).collect();
    assert_eq!(free.len(), 13, "fx fy cx cy, five of the lens, four of D");
    let theta = result.camera.theta();
    let error = DVector::from_iterator(free.len(), free.iter().map(|i| theta[*i] - truth[*i]));
    let std = DVector::from_iterator(free.len(), free.iter().map(|i| covariance[(*i, *i)].sqrt()));
    // Scaled to a correlation matrix: its entries have units from px to 1/mm.
    let correlation =
        nalgebra::DMatrix::from_fn(free.len(), free.len(), |i, j| covariance[(free[i], free[j])] / (std[i] * std[j]));
    let whitened = error.component_div(&std);
    let nees = whitened.dot(&correlation.cholesky().unwrap().solve(&whitened));
    (whitened.iter().copied().collect(), nees)
}

/// Exact observations give the exact camera, and no division by a noise of zero.
#[test]
fn exact_observations_give_the_exact_camera() {
    let camera = CameraTruth::published(2).unwrap();
    let simulation = Simulation::new(camera, Kind::General(1), &[], 1).noise(depthcal_simulate::Noise::none());
    let options = PointOptions { sigma_px: 0.0, ..PointOptions::default() };
    let observed = simulation.observe_points(&options).unwrap();
    let result = calibrate_camera(&simulated::capture(&observed), &CameraOptions::default()).unwrap();
    let truth = simulated::true_theta(&camera);
    // k1 … k3, fx … skew, D: rounding of the solution, in each group's own size.
    let tolerances = [[1e-6; 5], [1e-4; 5]].concat().into_iter().chain([1e-10, 1e-10, 1e-10, 1e-6]);
    for (i, ((value, truth), tolerance)) in result.camera.theta().iter().zip(&truth).zip(tolerances).enumerate() {
        assert!((value - truth).abs() < tolerance, "parameter {i}: {value} for {truth}");
    }
}

#[test]
fn errors_match_the_reported_covariance() {
    let runs: Vec<(Vec<f64>, f64)> = (0..SEEDS).into_par_iter().map(one).collect();
    let within = runs.iter().filter(|(z, _)| z.iter().all(|z| z.abs() <= 3.0)).count();
    let mean = runs.iter().map(|(_, nees)| nees / 13.0).sum::<f64>() / SEEDS as f64;
    for i in 0..13 {
        let rms = (runs.iter().map(|(z, _)| z[i] * z[i]).sum::<f64>() / SEEDS as f64).sqrt();
        println!("parameter {i}: rms of error over standard deviation {rms:.3}");
    }
    println!(
        "{within} of {SEEDS} seeds with every parameter within 3 standard deviations; mean normalised squared error {mean:.3}"
    );
    // With 13 nearly normal parameters 96.5 % of seeds are expected; the requirement is 95 %.
    assert!(within >= 95, "{within} of {SEEDS}");
    // χ² with 13 · 100 degrees of freedom over that number: 95 % within 1 ± 1.96 √(2 / 1300).
    let half_width = 1.96 * (2.0 / (13.0 * SEEDS as f64)).sqrt();
    assert!((mean - 1.0).abs() <= half_width, "{mean:.3} is not within 1 ± {half_width:.3}");
}
