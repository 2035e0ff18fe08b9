//! From rendered images to a camera: found boards, centres, focal length, depth.

#![cfg(feature = "detect")]

use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::judge::camera::evaluate_camera;
use depthcal::calibration::load::{LoadOptions, load};
use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

/// Narrowest width of a dot of this size, px, from its outline under the true camera.
fn narrowest_dot_px(simulation: &Simulation, frame: usize) -> f64 {
    // Rendered dots are projected discs: the smaller axis is foreshortened by the tilt.
    let truth = simulation.truth().unwrap();
    let pose = &truth.frames[frame].pose;
    let diameter = truth.board.circle_diameter_mm().unwrap();
    let focal = truth.camera.focal_px[0];
    let widths = (0..truth.board.len()).map(|i| {
        let [x, y] = truth.board.marker(i);
        let p = pose.apply([x, y, 0.0]);
        let range = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
        let m = pose.matrix();
        let cos = (m[(0, 2)] * p[0] + m[(1, 2)] * p[1] + m[(2, 2)] * p[2]).abs() / range;
        focal * diameter * cos / p[2]
    });
    widths.fold(f64::INFINITY, f64::min)
}

#[test]
fn boards_centres_focal_length_and_depth_of_rendered_captures() {
    let exact = PointOptions { sigma_px: 0.0, depth_samples: 0, ..PointOptions::default() };
    let (mut wanted, mut boards, mut sum, mut count) = (0, 0, 0.0, 0);
    for seed in [11, 12] {
        let camera = CameraTruth::published(1).unwrap();
        let simulation = Simulation::new(camera, Kind::General(1), &[], seed);
        let folder = tempfile::tempdir().unwrap();
        simulation.write_dataset(folder.path().join("capture")).unwrap();
        let options = LoadOptions { cache: None, ..LoadOptions::default() };
        let loaded = load(&folder.path().join("capture"), &options).unwrap().into_only_camera().unwrap();
        let truth = simulation.observe_points(&exact).unwrap();
        for (i, frame) in truth.frames.iter().enumerate() {
            let detected = loaded.capture.frames.iter().find(|f| f.name == frame.name);
            let inside = frame.markers.len() == truth.truth.board.len();
            if inside && narrowest_dot_px(&simulation, i) >= 5.0 {
                wanted += 1;
                boards += i32::from(detected.is_some());
            }
            for marker in detected.map_or(&[][..], |f| &f.markers) {
                let Some(true_marker) = frame.markers.iter().find(|m| m.index == marker.index) else { continue };
                let miss = [marker.pixel[0] - true_marker.pixel[0], marker.pixel[1] - true_marker.pixel[1]];
                sum += miss[0] * miss[0] + miss[1] * miss[1];
                count += 1;
            }
        }
        let result = calibrate_camera(&loaded.capture, &CameraOptions::default()).unwrap();
        let [fx, fy, ..] = result.camera.pinhole();
        println!("seed {seed}: fx {fx:.3}, fy {fy:.3}, reprojection {:.4} px", result.reprojection_rms_px);
        assert!((fx - camera.focal_px[0]).abs() < 0.3, "fx = {fx}");
        assert!((fy - camera.focal_px[1]).abs() < 0.3, "fy = {fy}");
        let errors = evaluate_camera(&result.camera, &loaded.capture).record();
        println!("{}", depthcal::calibration::judge::table::table(std::slice::from_ref(&errors), None));
        let rms = errors.depth_rms_mm.unwrap();
        assert!(rms.after < 0.3 * rms.before, "depth rms {:.2} mm to {:.2} mm", rms.before, rms.after);
    }
    let rms = (sum / f64::from(2 * count)).sqrt();
    println!("{boards} of {wanted} boards found; centres {rms:.4} px rms per coordinate");
    assert!(f64::from(boards) >= 0.95 * f64::from(wanted), "{boards} of {wanted}");
    assert!(rms < 0.05, "centres are off by {rms:.4} px rms");
}
