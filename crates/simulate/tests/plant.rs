//! Effects planted in measured depth images.

use depthcal_simulate::{Conditions, Effect, PlantView, SimulateError, plant};

const WIDTH: usize = 160;
const HEIGHT: usize = 120;

fn view(time_s: f64) -> PlantView<'static> {
    PlantView {
        width: WIDTH,
        height: HEIGHT,
        unit_mm: 1.0,
        focal_px: [120.0, 120.0],
        centre_px: [80.0, 60.0],
        conditions: Conditions { frame: 3, time_s, session_s: 100.0, temperature_c: 31.0 },
        amplitude: None,
        unit: 0,
        seed: 1,
    }
}

/// A plane with holes, 1/z = 1/800 + x/4000.
fn measured() -> Vec<u16> {
    let z = |i: usize| 1.0 / (1.0 / 800.0 + ((i % WIDTH) as f64 - 80.0) / 120.0 / 4000.0);
    (0..WIDTH * HEIGHT).map(|i| if i % 97 == 0 { 0 } else { z(i).round() as u16 }).collect()
}

fn mean_change(before: &[u16], after: &[u16]) -> f64 {
    let pairs = before.iter().zip(after).filter(|(a, b)| **a != 0 && **b != 0);
    let (sum, count) = pairs.fold((0.0, 0.0), |(s, n), (a, b)| (s + f64::from(*b) - f64::from(*a), n + 1.0));
    sum / count
}

#[test]
fn an_offset_smaller_than_a_step_is_there_on_average() {
    let before = measured();
    let mut after = before.clone();
    let truth = plant(&Effect::new("range_offset", 0.4).unwrap(), &mut after, &view(0.0)).unwrap();
    assert_eq!(truth.size, 0.4);
    let change = mean_change(&before, &after);
    assert!((0.3..0.4).contains(&change), "{change}");
    assert!(before.iter().zip(&after).all(|(a, b)| (*a == 0) == (*b == 0)));
}

#[test]
fn a_drift_depends_on_the_frame_and_ends_at_its_size() {
    let change = |time: f64| {
        let before = measured();
        let mut after = before.clone();
        plant(&Effect::new("temporal_drift", 6.0).unwrap(), &mut after, &view(time)).unwrap();
        mean_change(&before, &after).abs()
    };
    assert!(change(0.0) < 1e-9);
    assert!(change(100.0) > change(20.0) && change(20.0) > 1.0);
}

#[test]
fn a_displaced_depth_image_is_moved() {
    let before = measured();
    let mut after = before.clone();
    let truth = plant(&Effect::new("depth_registration", 3.0).unwrap(), &mut after, &view(0.0)).unwrap();
    let du = truth.parameters["du_px"];
    let plane = |u: f64| 1.0 / (1.0 / 800.0 + (u - 80.0) / 120.0 / 4000.0);
    let errors: Vec<f64> = (0..WIDTH * HEIGHT)
        .filter(|&i| after[i] != 0)
        .map(|i| f64::from(after[i]) - plane((i % WIDTH) as f64 - du))
        .collect();
    assert!(errors.len() > WIDTH * HEIGHT * 9 / 10);
    assert!(errors.iter().all(|error| error.abs() < 3.0));
    assert!((errors.iter().sum::<f64>() / errors.len() as f64).abs() < 0.1);
}

#[test]
fn what_cannot_be_planted_is_said() {
    let mut depth = measured();
    for name in ["board_bow", "thin_prism", "incidence_bias", "reflectivity_bias"] {
        let error = plant(&Effect::with_default_size(name).unwrap(), &mut depth, &view(0.0)).unwrap_err();
        assert!(matches!(error, SimulateError::NotPlantable { .. }) && error.to_string().contains(name));
    }
    assert_eq!(depth, measured());
    let error = plant(&Effect::new("range_offset", 1.0).unwrap(), &mut depth[1..], &view(0.0)).unwrap_err();
    assert!(matches!(error, SimulateError::SizeMismatch { .. }));
    let amplitude = vec![0.1; WIDTH * HEIGHT];
    let lit = PlantView { amplitude: Some(&amplitude), ..view(0.0) };
    plant(&Effect::with_default_size("reflectivity_bias").unwrap(), &mut depth, &lit).unwrap();
    assert!(mean_change(&measured(), &depth) > 1.0);
}
