//! `diff`, from calibrations in files to `diff.json`.

#![cfg(feature = "cli")]

use crate::support::{Folder, fails, schemas, stdout, succeeds};
use depthcal::io::Difference;
use serde_json::Value;

/// A camera file of OpenCV with this focal length, px, and images of 640×480.
fn opencv(focal_px: f64) -> String {
    format!(
        "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
         data: [ {focal_px}, 0., 320., 0., {focal_px}, 240., 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n   \
         cols: 5\n   dt: d\n   data: [ 0., 0., 0., 0., 0. ]\n"
    )
}

#[test]
fn two_camera_files_are_compared_and_the_files_follow_their_schema() {
    let folder = Folder::new();
    folder.write("a.yml", opencv(500.0));
    folder.write("b.yml", opencv(505.0));
    let [a, b, out] = ["a.yml", "b.yml", "out"].map(|name| folder.arg(name));
    let output = succeeds(["diff", &a, &b, "--out", &out, "--json"]);
    let json: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let verdict = json["verdict"][0].as_str().unwrap();
    assert!(verdict.starts_with("Projection differs by"), "{verdict}");
    assert!(json["next"].as_str().unwrap().starts_with("depthcal evaluate"), "{json}");
    schemas::follows(folder.path("out/diff.json"), "diff");
    let record = Difference::read(folder.path("out/diff.json")).unwrap();
    let camera = &record.cameras[0];
    assert!(camera.depth.is_empty() && !camera.first.has_covariance);
    let p = &camera.projection[0];
    // The second camera has the larger image: one per cent of the distance from the centre, and no rotation removes that.
    for (cell, (du, dv)) in p.du_px.iter().zip(&p.dv_px).enumerate() {
        let [u, v] = camera.pixel(cell);
        let [expected_u, expected_v] = [0.01 * (u - 320.0), 0.01 * (v - 240.0)];
        assert!((du.unwrap() - expected_u).abs() < 0.02 && (dv.unwrap() - expected_v).abs() < 0.02, "cell {cell}");
    }
    assert!(std::fs::read_to_string(folder.path("out/report.html")).unwrap().contains("Projection differs by"));
}

#[test]
fn what_cannot_be_compared_is_said() {
    let folder = Folder::new();
    folder.write("a.yml", opencv(500.0));
    let [a, missing] = ["a.yml", "none"].map(|name| folder.arg(name));
    fails(["diff", &a, &missing], &["none"]);
    let smaller = opencv(500.0).replace("640", "320").replace("480", "240");
    folder.write("c.yml", smaller);
    let c = folder.arg("c.yml");
    fails(["diff", &a, &c], &["640x480 px in", "320x240 px in", "one resolution"]);
}
