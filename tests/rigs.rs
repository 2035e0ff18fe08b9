//! Rendered rigs from the command line: simulate, calibrate, evaluate, register, against the truth of the simulation.
#![cfg(feature = "detect")]

use crate::support::{Folder, fails, run_with_input, schemas, stderr, stdout, succeeds};
use depthcal::calibration::rig_simulated::pose;
use depthcal::io::{Calibration, Comparison, Diagnosis, Evaluation, Verdict, read_depth, read_json, read_rgb};
use depthcal_simulate::RigTruth;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

/// Runs `apply CALIBRATION -` on the bytes; returns what it writes.
fn stream(calibration: &str, input: &[u8], more: &[&str]) -> Vec<u8> {
    let output = run_with_input([&["apply", calibration, "-"][..], more].concat(), input);
    assert!(output.status.success(), "{}", stderr(&output));
    output.stdout
}

/// Renders a rig of infrared and depth, colour, and depth whose image cannot be had, with its truth.
fn render(rig: &str, truth: &str) {
    let cameras =
        ["simulate", "--rig", "infrared,colour,depth", "--kind", "centered1", "--frames", "12", "--seed", "5"];
    succeeds(cameras.into_iter().chain(["--truth", truth, "--out", rig]));
}

#[test]
fn a_rendered_rig_from_images_to_coloured_clouds() {
    let folder = Folder::new();
    let (rig, truth, result) = (folder.arg("rig"), folder.arg("truth.json"), folder.arg("result"));
    render(&rig, &truth);
    let words = stdout(&succeeds(["calibrate", &rig, "--hold-out", "4", "--out", &result]));
    assert!(words.contains("[colour]") && words.contains("camera_from_rig"), "{words}");
    assert!(words.contains("depth: 12 frames of depth without images"), "{words}");
    schemas::follows(folder.path("result/calibration.json"), "calibration");
    schemas::follows(folder.path("result/evaluation.json"), "evaluation");

    extrinsics_are_near(&read_json(&truth).unwrap(), &folder);
    let evaluation = Evaluation::read(folder.path("result/evaluation.json")).unwrap();
    let held_out = evaluation.transfer.iter().find(|t| t.dataset.contains("held out")).expect("transfer errors");
    assert!(held_out.rms_px < 0.5 && held_out.rms_px < 0.5 * held_out.before_rms_px, "{held_out:?}");

    let (file, check) = (folder.arg("result/calibration.json"), folder.arg("check"));
    succeeds(["evaluate", &file, &rig, "--out", &check]);
    let again = Evaluation::read(folder.path("check/evaluation.json")).unwrap();
    let names: Vec<&str> = again.datasets.iter().map(|d| d.name.as_str()).collect();
    assert_eq!(names, ["rig/infrared", "rig/colour", "rig/depth"]);
    let [_, colour, depth] = &again.datasets[..] else { panic!("{names:?}") };
    assert!(colour.reprojection_px.is_some() && colour.depth_rms_mm.is_none(), "{colour:?}");
    assert!(
        depth.reprojection_px.is_none() && depth.depth_rms_mm.is_some_and(|rms| rms.after < rms.before),
        "{depth:?}"
    );

    let out = folder.arg("registered");
    succeeds(["apply", &file, &rig, "--register", "colour", "--cloud", "--out", &out]);
    let registered = read_depth(folder.path("registered/infrared_in_colour/0003.png")).unwrap();
    assert_eq!((registered.width, registered.height), (1280, 720));
    let colours = read_rgb(folder.path("registered/colour_in_infrared/0003.png")).unwrap();
    assert!(colours.data.iter().filter(|c| **c != [0; 3]).count() > 50_000);
    assert!(folder.path("registered/infrared/0003.ply").is_file());

    streams_equal_files(&folder, &file);

    diagnosis_finds_nothing(&folder, &rig);
    let compared = folder.arg("compared");
    let models = ["--models", "none,projective", "--learning", "0", "--folds", "3"];
    succeeds(["compare", &rig, "--out", &compared].into_iter().chain(models));
    for camera in ["infrared", "depth"] {
        let comparison = Comparison::read(folder.path(&format!("compared/{camera}/comparison.json"))).unwrap();
        assert_eq!(comparison.models[0].model.to_string(), "projective", "{camera}");
    }

    let validated = folder.arg("validated");
    succeeds(["calibrate", &rig, "--cross-validate", "3", "--out", &validated]);
    let errors = Evaluation::read(folder.path("validated/evaluation.json")).unwrap();
    let names: Vec<&str> = errors.datasets.iter().map(|d| d.name.as_str()).collect();
    let both = ["rig/infrared", "rig/colour"].map(|name| [name.to_owned(), format!("{name} (cross-validated)")]);
    assert!(both.iter().flatten().all(|name| names.contains(&name.as_str())), "{names:?}");
    // Every camera with depth is a unit of a fleet of its type.
    assert!(folder.path("validated/infrared/calibration.json").is_file());
    assert!(folder.path("validated/infrared/scores.json").is_file() && !folder.path("validated/colour").exists());
    let refused = ["apply", &file, &rig, "--register", "colour", "--stream-output", "u16", "--out", &out];
    fails(refused, &["--stream-output", "standard input"]);
    let other = ["apply", &file, "-", "--register", "colour", "--stream-camera", "colour", "--stream-output", "u16"];
    fails(other, &["colour", "no depth"]);
    fails(["diagnose", &rig, "--rrd", &folder.arg("x.rrd"), "--out", &folder.arg("diagnosed")], &["--rrd", "several"]);
    fails(
        ["calibrate", &rig, "--with", "time_offset", "--out", &result],
        &["time_offset", "name the camera", "depth:time_offset"],
    );
    fails(["apply", &file, &rig, "--register", "red", "--out", &out], &["red", "infrared, colour, depth"]);
    fails(["simulate", "--rig", "infrared,lidar", "--out", &folder.arg("x")], &["lidar", "colour"]);
}

/// The extrinsics of the colour camera are known to some hundredths of a degree, those of the depth camera by planes alone to
/// some tenths.
fn extrinsics_are_near(truth: &RigTruth, folder: &Folder) {
    let calibration = Calibration::read(folder.path("result/calibration.json")).unwrap();
    assert_eq!(calibration.cameras().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["infrared", "colour", "depth"]);
    for (number, (most_deg, most_mm)) in [(1, (0.05, 1.0)), (2, (1.0, 20.0))] {
        let record = &calibration.others[number - 1].camera_from_rig;
        let [w, x, y, z] = record.rotation;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let place = Isometry3::from_parts(Translation3::from(nalgebra::Vector3::from(record.translation_mm)), rotation);
        let error = place * pose(&truth.cameras[number].camera_from_rig).inverse();
        let (angle, distance) = (error.rotation.angle().to_degrees(), error.translation.vector.norm());
        assert!(angle < most_deg && distance < most_mm, "camera {number}: {angle}°, {distance} mm");
    }
}

/// A frame as a stream, with and without its colours, is what the dataset's files have.
fn streams_equal_files(folder: &Folder, file: &str) {
    let registered = read_depth(folder.path("registered/infrared_in_colour/0003.png")).unwrap();
    let colours = read_rgb(folder.path("registered/colour_in_infrared/0003.png")).unwrap();
    let depth = read_depth(folder.path("rig/infrared/depth/0003.png")).unwrap();
    let raw: Vec<u8> = depth.data.iter().flat_map(|z| z.to_le_bytes()).collect();
    let streamed = stream(file, &raw, &["--register", "colour", "--stream-output", "u16"]);
    let steps: Vec<u16> = streamed.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b)).collect();
    assert!(steps == registered.data, "the stream's depth is not that of the dataset");
    let colour = read_rgb(folder.path("rig/colour/image/0003.png")).unwrap();
    let both = [&raw[..], colour.data.as_flattened()].concat();
    let output = stream(file, &both, &["--register", "colour", "--stream-output", "xyzrgb", "--stream-color"]);
    let points = output.as_chunks::<16>().0;
    assert_eq!(points.len(), colours.data.len());
    for (point, expected) in points.iter().zip(&colours.data) {
        assert_eq!(point[12..15], expected[..]);
    }
    let of_depth = read_depth(folder.path("rig/depth/depth/0003.png")).unwrap();
    let raw: Vec<u8> = of_depth.data.iter().flat_map(|z| z.to_le_bytes()).collect();
    let more = ["--register", "colour", "--stream-camera", "depth", "--stream-output", "u16"];
    let of_second: Vec<u16> = stream(file, &raw, &more).as_chunks().0.iter().map(|b| u16::from_le_bytes(*b)).collect();
    assert!(of_second == read_depth(folder.path("registered/depth_in_colour/0003.png")).unwrap().data);
}

/// Nothing is wrong with these cameras.
fn diagnosis_finds_nothing(folder: &Folder, rig: &str) {
    let diagnosed = folder.arg("diagnosed");
    let words = stdout(&succeeds(["diagnose", rig, "--no-discovery", "--out", &diagnosed]));
    assert!(words.contains("[depth]\nthe poses of the board are those of the other cameras"), "{words}");
    schemas::follows(folder.path("diagnosed/diagnosis.json"), "rig_diagnosis");
    schemas::follows(folder.path("diagnosed/depth/diagnosis.json"), "diagnosis");
    let record = Diagnosis::read(folder.path("diagnosed/diagnosis.json")).unwrap();
    assert_eq!(record.cameras.iter().map(|c| c.camera.as_str()).collect::<Vec<_>>(), ["infrared", "depth"]);
    let together = record.rig.as_ref().expect("findings of the rig");
    assert_eq!(together.without_depth, ["colour"]);
    assert_eq!(record.verdict, Verdict::Adequate, "{words}");
    assert!(together.extrinsics_drift.len() == 4 && together.extrinsics_drift.iter().all(|test| !test.added));
}

/// Where both depth cameras show the board, their clouds meet, at every distance; and neither shows the wall behind through holes
/// in the depth of the board.
#[test]
fn clouds_of_two_depth_cameras_meet() {
    /// Depth from which on pixels show the walls of the room, mm.
    const WALL_MM: f64 = 1700.0;
    /// Surfaces that are farther apart than this share of their distance are not the same.
    const SAME: f64 = 0.05;
    let folder = Folder::new();
    let (rig, result, out) = (folder.arg("rig"), folder.arg("result"), folder.arg("registered"));
    render(&rig, &folder.arg("truth.json"));
    // A colour image of another moment: the frame contradicts what infrared sees.
    std::fs::copy(folder.path("rig/colour/image/0000.png"), folder.path("rig/colour/image/0005.png")).unwrap();
    succeeds(["calibrate", &rig, "--out", &result]);
    let report = std::fs::read_to_string(folder.path("result/report.html")).unwrap();
    let (_, colour) = report.split_once(">Camera colour</h2>").expect("sections of the colour camera");
    let (_, listed) = colour.split_once("Frames that were not used").expect("a table of frames that are not used");
    let rows = listed.split("</table>").next().unwrap();
    assert!(rows.contains("0005"), "{rows}");
    let file = folder.arg("result/calibration.json");
    succeeds(["apply", &file, &rig, "--register", "colour", "--out", &out]);
    let unit_mm = Calibration::read(&file).unwrap().camera.depth_unit_mm.unwrap();
    let (mut board, mut through) = (0, 0);
    for frame in 0..12 {
        let read = |camera: &str| {
            let image = read_depth(folder.path(&format!("registered/{camera}_in_colour/{frame:04}.png"))).unwrap();
            image.data.iter().map(|z| unit_mm * f64::from(*z)).collect::<Vec<f64>>()
        };
        let (infrared, depth) = (read("infrared"), read("depth"));
        let both: Vec<(f64, f64)> = infrared
            .iter()
            .zip(&depth)
            .filter(|(a, b)| **a > 0.0 && **b > 0.0 && a.min(**b) < WALL_MM)
            .map(|(a, b)| (*a, *b))
            .collect();
        let same: Vec<f64> =
            both.iter().filter(|(a, b)| (a - b).abs() < SAME * a.min(*b)).map(|(a, b)| a - b).collect();
        assert!(same.len() > 2000, "frame {frame}: {} pixels", same.len());
        let mean = same.iter().sum::<f64>() / same.len() as f64;
        let distance = both.iter().map(|(a, b)| a.min(*b)).sum::<f64>() / both.len() as f64;
        assert!(mean.abs() < 0.0015 * distance, "frame {frame}: clouds {distance:.0} mm away are {mean:.2} mm apart");
        board += both.len();
        through += both.len() - same.len();
    }
    assert!(
        through * 50 < board,
        "one camera sees the wall where the other sees the board: {through} of {board} pixels"
    );
}
