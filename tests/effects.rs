//! Every effect of the catalogue, simulated by code that shares nothing with the pieces: left undeclared it raises the
//! residuals above the noise, declared it lowers them to the noise.

use depthcal::calibration::calibrate::{CalibratedCamera, CameraOptions, calibrate_camera};
use depthcal::calibration::simulated;
use depthcal_simulate::{CameraTruth, Effect, EffectInfo, Kind, Noise, PointOptions, Simulation, catalogue};

/// The piece with its constants as the simulator has them: constants are not fitted, and searching them is not this test's.
fn piece(simulation: &Simulation, name: &str) -> String {
    let truth = simulation.truth().unwrap();
    let parameter = |key: &str| truth.effects[0].parameters[key];
    match name {
        "disparity_ripple" => format!("{name}@period_per_mm={}", parameter("period_per_mm")),
        "cyclic_depth" => format!("{name}@period_mm={}", parameter("period_mm")),
        "reflectivity_bias" => format!("{name}@reference={}", parameter("reference_amplitude")),
        "temperature_drift" => format!("{name}@reference_c={}", parameter("reference_c")),
        "temporal_drift" => {
            let session = truth.frames[0].conditions.session_s;
            format!("{name}@tau_s={}", parameter("time_constant_share_of_session") * session)
        }
        _ => name.to_owned(),
    }
}

fn fit(simulation: &Simulation, effects: Vec<String>) -> CalibratedCamera {
    let observed = simulation.observe_points(&PointOptions::default()).unwrap();
    let effects = effects.iter().map(|e| e.parse().unwrap()).collect();
    let options = CameraOptions { effects, ..CameraOptions::default() };
    calibrate_camera(&simulated::capture(&observed), &options).unwrap()
}

/// Largest deviation from 1 of the ratio of estimated to true noise, with the effect declared. The standard deviation of
/// noise from 40 frames × 44 markers × 2 coordinates has a sampling error of 1/√(2·3520) = 1.2 %; this is three times that. Depth
/// noise comes from more samples.
const SAMPLING: f64 = 0.036;

/// Smallest ratio of the noise that is estimated without the effect to that with it. Both fits have the same noise, so that
/// chance hardly enters; three times the sampling error of two independent estimates would be 5 %.
const CLEAR: f64 = 1.05;

/// Multiples of the default size for effects that the lens of five parameters takes up almost entirely at the default size: the
/// noise is then raised by 0.4 % (`rational_distortion`) and 3.6 % (`thin_prism`). Larger sizes of the former fold the lens.
const ENLARGED: [(&str, f64); 2] = [("rational_distortion", 5.0), ("thin_prism", 2.0)];

/// Ratios of estimated to true noise: of markers, and of depth at 0.4, 0.8 and 1.2 m. Residuals that are not noise raise one of
/// them, and it need not be that of the effect's own image: the joint adjustment weighs both.
fn ratios(result: &CalibratedCamera, noise: &Noise) -> [f64; 4] {
    let depth = |z: f64| result.noise.depth.sigma(1.0 / z) / noise.depth.sigma_rho(1.0 / z);
    [result.noise.pixel_sigma / PointOptions::default().sigma_px, depth(400.0), depth(800.0), depth(1200.0)]
}

#[test]
fn an_effect_shows_undeclared_and_is_taken_up_declared() {
    let noise = Noise::default();
    let mut failures = Vec::new();
    for EffectInfo { name, default_size, .. } in catalogue() {
        let enlarged = ENLARGED.iter().find(|(n, _)| n == name).map_or(1.0, |(_, factor)| *factor);
        let effect = Effect::new(name, enlarged * *default_size).unwrap();
        let camera = CameraTruth::published(1).unwrap();
        let simulation = Simulation::new(camera, Kind::General(1), &[effect], 21).frames(40);
        let without = ratios(&fit(&simulation, Vec::new()), &noise);
        let with = ratios(&fit(&simulation, vec![piece(&simulation, name)]), &noise);
        println!("{name:22} times the true noise: undeclared {without:6.3?}, declared {with:6.3?}");
        let raised = without.iter().zip(with).map(|(without, with)| without / with).fold(0.0, f64::max);
        if raised < CLEAR {
            failures.push(format!("{name} does not show: noise raised {raised:.3} times without the piece"));
        }
        if with.iter().any(|ratio| (ratio - 1.0).abs() > SAMPLING) {
            failures.push(format!("{name} is not taken up: {with:.3?} times the noise are left with the piece"));
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
