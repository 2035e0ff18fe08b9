//! The planner against closed forms, against another propagation of the same covariance, and against captures that are then made.

use depthcal_simulate::{CameraTruth, DepthNoise, Kind, Noise, PointOptions, Simulation};
use nalgebra::DMatrix;

use super::error::Error;
use super::{Goal, GoalError, Planner};
use crate::adjust::state::{CameraState, State};
use crate::calibrate::{CalibratedCamera, CameraOptions, calibrate_camera, parameter_names};
use crate::simulated;

/// A fit to so many of the frames of a simulated capture.
fn fitted(frames: usize) -> CalibratedCamera {
    let noise = Noise { depth: DepthNoise::Disparity { sigma_rho: 2e-6 }, ..Noise::default() };
    let simulation =
        Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 3).frames(12).noise(noise);
    let options = PointOptions { depth_samples: 100, ..PointOptions::default() };
    let capture = simulated::capture(&simulation.observe_points(&options).unwrap());
    let options = CameraOptions { frame_planes: false, ..CameraOptions::default() };
    calibrate_camera(&capture.subset(|i, _| i < frames), &options).unwrap()
}

fn planner(fit: &CalibratedCamera) -> Planner {
    let camera = CameraState::reference(fit.capture.clone(), fit.camera.clone(), fit.noise);
    Planner::new(&State::of_camera(camera), 0, fit.covariance.as_ref().unwrap()).unwrap()
}

/// One variable of standard deviation 2 is below 1.96 · 2 with 95 %; of 50 alike, the mean square is χ²₅₀/50, whose 95 % quantile
/// is 67.505/50.
#[test]
fn what_an_error_is_below_with_certainty() {
    let one = Error::of(&DMatrix::from_element(1, 1, 4.0), &DMatrix::identity(1, 1));
    assert!((one.certain() - 2.0 * 1.959_964).abs() < 1e-4, "{}", one.certain());
    let many = Error::of(&DMatrix::identity(50, 50), &(DMatrix::identity(50, 50) / 50.0));
    assert!((many.certain() - (67.505f64 / 50.0).sqrt()).abs() < 1e-4, "{}", many.certain());
}

#[test]
fn the_present_value_of_a_parameter_is_its_standard_deviation() {
    let fit = fitted(8);
    let planner = planner(&fit);
    for (name, std_dev) in parameter_names(&fit.camera).into_iter().zip(fit.std_devs()) {
        let Some(std_dev) = std_dev else { continue };
        let plan = planner.plan(&Goal::Parameter(name.0.clone()), 0.0, 1).unwrap();
        assert!((plan.now / std_dev - 1.0).abs() < 1e-4, "{}: {} instead of {std_dev}", name.0, plan.now);
        assert!(plan.poses[0].expected < plan.now && plan.frames_needed.is_none());
    }
    let unknown = planner.plan(&Goal::Parameter("pinhole.f".into()), 0.0, 1).unwrap_err().to_string();
    assert!(unknown.contains("pinhole.fx, pinhole.fy"), "{unknown}");
    let nothing = Goal::Depth { range_mm: [500.0, 1000.0] };
    let without = fit.camera.filtered(|block| block.name() != "projective");
    let error = nothing.weight(&without, &Default::default(), (&[0], &[1.0])).unwrap_err();
    assert_eq!(error, GoalError::NothingChanges { goal: "depth" });
}

/// The first pose lowers the goal more than the frames that were captured next did, and each further one less than the last.
#[test]
fn proposed_frames_are_worth_more_than_those_that_were_captured() {
    let [before, after] = [6, 9].map(|frames| planner(&fitted(frames)));
    let goal = before.default_goal();
    let plan = before.plan(&goal, 0.0, 3).unwrap();
    let captured = after.plan(&goal, 0.0, 1).unwrap().now;
    let mut last = plan.now;
    for planned in &plan.poses {
        assert!(planned.expected < last);
        last = planned.expected;
    }
    // Random poses: what the fit says of itself differs from capture to capture by some 10 %.
    assert!(last < 1.1 * captured, "three proposed frames give {last} mm, three random ones {captured} mm");
    let met = before.plan(&goal, 2.0 * plan.now_certain, 1).unwrap();
    assert_eq!(met.frames_needed, Some(0));
    // A tighter target needs more frames, by the root of their number where it is well below what the first ones give.
    let needed = |share: f64| before.plan(&goal, share * plan.now_certain, 1).unwrap().frames_needed.unwrap();
    let [half, quarter] = [0.5, 0.25].map(needed);
    assert!(half >= 1 && quarter > half, "{half} and {quarter} frames");
}

/// Frames that are forecast lazily are as many as with every pose tried at every frame.
#[test]
fn the_lazy_forecast_is_that_of_all_poses() {
    let planner = planner(&fitted(8));
    let goal = planner.default_goal();
    let target = 0.4 * planner.plan(&goal, 0.0, 1).unwrap().now_certain;
    let [lazy, exact] = [1, 60].map(|count| planner.plan(&goal, target, count).unwrap());
    let needed = lazy.frames_needed.unwrap();
    assert!(needed > 3 && exact.frames_needed == Some(needed), "{needed} and {:?}", exact.frames_needed);
}
