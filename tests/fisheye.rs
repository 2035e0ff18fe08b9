//! A fisheye camera of 150° from rendered images to corrected depth: found boards, focal length, depth on another capture beside
//! the true camera.

#![cfg(feature = "detect")]

use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::judge::camera::evaluate_camera;
use depthcal::calibration::load::{LoadOptions, LoadedCamera, load};
use depthcal_simulate::{Board, CameraTruth, Kind, Pattern, Simulation};

use crate::support::{Folder, succeeds};

fn rendered(camera: CameraTruth, kind: Kind, seed: u64) -> LoadedCamera {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("capture");
    // The dots of the thesis' board would be three pixels wide in most frames.
    let board = Board::new(Pattern::AsymmetricCircles { circle_diameter_mm: 28.0 }, 4, 11, 42.0);
    Simulation::new(camera, kind, &[], seed).board(board).write_dataset(&path).unwrap();
    load(&path, &LoadOptions { cache: None, ..LoadOptions::default() }).unwrap().into_only_camera().unwrap()
}

#[test]
fn a_rendered_fisheye_capture_is_calibrated() {
    let truth = CameraTruth::fisheye_150();
    let capture = rendered(truth, Kind::General(1), 31).capture;
    let boards = capture.frames.len();
    let widest = capture
        .frames
        .iter()
        .flat_map(|f| &f.markers)
        .map(|m| (m.pixel[0] - truth.centre_px[0]).abs())
        .fold(0.0, f64::max);
    println!("{boards} of {} boards found, markers up to {widest:.0} px from the axis", Kind::General(1).frames());
    assert!(boards * 10 >= Kind::General(1).frames() * 8, "{boards} boards found");
    assert!(widest > 300.0, "markers reach only {widest} px from the axis");
    let options = CameraOptions { lens: "kannala-brandt".to_owned(), ..CameraOptions::default() };
    let result = calibrate_camera(&capture, &options).unwrap();
    let [fx, fy, cx, cy, _] = result.camera.pinhole();
    println!("fx {fx:.3}, fy {fy:.3}, cx {cx:.3}, cy {cy:.3}; reprojection {:.4} px", result.reprojection_rms_px);
    assert!((fx - truth.focal_px[0]).abs() < 0.3, "fx = {fx}");
    assert!((fy - truth.focal_px[1]).abs() < 0.3, "fy = {fy}");

    let other = rendered(truth, Kind::General(2), 32).capture;
    let pinhole = [truth.focal_px[0], truth.focal_px[1], truth.centre_px[0], truth.centre_px[1], truth.skew_px];
    let theta: Vec<f64> = truth.fisheye.unwrap().into_iter().chain(pinhole).chain(truth.depth).collect();
    let oracle = result.camera.with_theta(&theta);
    let depth = |camera| evaluate_camera(camera, &other).record().depth_rms_mm.unwrap();
    let (fitted, best) = (depth(&result.camera), depth(&oracle));
    println!(
        "depth rms: {:.3} mm before, {:.3} mm after, {:.3} mm with the true camera",
        fitted.before, fitted.after, best.after
    );
    assert!(fitted.after < 1.05 * best.after, "{} mm, {} mm with the true camera", fitted.after, best.after);
}

/// The commands: simulate, calibrate with the lens of dataset.toml, export, evaluate the exported file, start from it with
/// another lens.
#[test]
fn a_fisheye_camera_through_all_commands() {
    let folder = Folder::new();
    let path = |name: &str| folder.arg(name);
    succeeds(["simulate", "--camera", "fisheye", "--frames", "24", "--seed", "3", "--out", &path("captures")]);
    let dataset = std::path::PathBuf::from(path("captures")).join("dataset.toml");
    let declared = std::fs::read_to_string(&dataset).unwrap();
    std::fs::write(&dataset, format!("{declared}\n[camera]\nlens = \"kannala-brandt\"\n")).unwrap();
    succeeds(["calibrate", &path("captures"), "--no-cache", "--out", &path("result")]);
    let calibration = format!("{}/calibration.json", path("result"));
    assert!(std::fs::read_to_string(&calibration).unwrap().contains("kannala_brandt"));
    for (format, model) in
        [("opencv", "fisheye_model: 1"), ("ros", "equidistant"), ("kalibr", "equi"), ("colmap", "OPENCV_FISHEYE")]
    {
        let file = path(&format!("camera.{format}"));
        succeeds(["export", &calibration, "--format", format, "--out", &file]);
        assert!(std::fs::read_to_string(&file).unwrap().contains(model), "{format}");
    }
    let error_px = |what: &str, out: &str| -> f64 {
        succeeds(["evaluate", what, &path("captures"), "--no-cache", "--out", &path(out)]);
        let text = std::fs::read_to_string(format!("{}/evaluation.json", path(out))).unwrap();
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        value["datasets"][0]["reprojection_px"]["rms"].as_f64().unwrap()
    };
    let (ours, exported) = (error_px(&calibration, "own"), error_px(&path("camera.opencv"), "exported"));
    assert!((ours - exported).abs() < 1e-6 && ours < 0.2, "{ours} px, exported {exported} px");
    std::fs::write(&dataset, format!("{declared}\n[camera]\nintrinsics = \"../camera.kalibr\"\nfixed = true\n"))
        .unwrap();
    succeeds(["calibrate", &path("captures"), "--no-cache", "--out", &path("fixed")]);
    let fixed: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(format!("{}/calibration.json", path("fixed"))).unwrap()).unwrap();
    let lens = &fixed["camera"]["pieces"][0];
    assert!(lens["name"] == "kannala_brandt" && lens["parameters"][0]["fixed"] == true, "{lens}");
}
