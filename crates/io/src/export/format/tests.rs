use std::collections::BTreeMap;

use depthcal_model::Of;
use depthcal_model::hook::HookKind;

use super::super::camera::names;
use super::super::outcome::ExportWarning;
use super::*;
use crate::record::{ParameterRecord, PieceRecord};

fn piece(hook: HookKind, name: &str, parameters: &[(&str, f64)]) -> PieceRecord {
    let parameters = parameters
        .iter()
        .map(|(name, value)| ParameterRecord {
            name: (*name).into(),
            unit: "1".into(),
            value: *value,
            std_dev: None,
            fixed: false,
        })
        .collect();
    PieceRecord { hook, name: name.into(), parameters, of: Of::True, on: None, options: BTreeMap::new(), formula: None }
}

/// A camera that every format can hold.
fn plain() -> ExportCamera {
    ExportCamera {
        width: 640,
        height: 480,
        fx: 476.5,
        fy: 477.25,
        cx: 312.97,
        cy: 242.49,
        skew: 0.0,
        distortion: [-0.1468, 0.0463, 0.0012, -7e-5, 0.0],
        depth: Vec::new(),
        lens: Vec::new(),
    }
}

/// The same with everything that some format cannot hold.
fn full() -> ExportCamera {
    let mut camera = ExportCamera { skew: 0.25, ..plain() };
    camera.distortion[4] = -0.0756;
    camera.depth = vec![piece(HookKind::Depth, "projective", &[("dx", 1.3406e-7), ("dw", 1.00604654)])];
    camera.depth[0].options.insert("columns".into(), 6.0);
    camera.lens = vec![piece(HookKind::Lens, "thin_prism", &[("s1", 1e-3)])];
    camera
}

#[test]
fn opencv() {
    let export = opencv_yaml(&plain()).unwrap();
    let expected = "\
%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [476.5, 0.0, 312.97, 0.0, 477.25, 242.49, 0.0, 0.0, 1.0]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [-0.1468, 0.0463, 0.0012, -7.0e-5, 0.0]
";
    assert_eq!(export, Export { text: expected.into(), warnings: Vec::new() });
    let export = opencv_yaml(&full()).unwrap();
    let pieces = "\
lens_pieces:
   -
      name: \"thin_prism\"
      parameters:
         - { name: \"s1\", unit: \"1\", value: 0.001 }
depth_pieces:
   -
      name: \"projective\"
      options:
         - { name: \"columns\", value: 6.0 }
      parameters:
         - { name: \"dx\", unit: \"1\", value: 1.3406e-7 }
         - { name: \"dw\", unit: \"1\", value: 1.00604654 }
";
    assert!(export.text.ends_with(pieces), "{}", export.text);
    assert!(export.text.contains("data: [476.5, 0.25, 312.97"));
    assert!(matches!(export.warnings[..], [ExportWarning::Skew { written: true, .. }, ExportWarning::Lens { .. }]));
}

#[test]
fn ros() {
    let export = ros_camera_info(&plain()).unwrap();
    let expected = "\
image_width: 640
image_height: 480
camera_name: depthcal
camera_matrix:
  rows: 3
  cols: 3
  data: [476.5, 0.0, 312.97, 0.0, 477.25, 242.49, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.1468, 0.0463, 0.0012, -7.0e-5, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [476.5, 0.0, 312.97, 0.0, 0.0, 477.25, 242.49, 0.0, 0.0, 0.0, 1.0, 0.0]
";
    assert_eq!(export, Export { text: expected.into(), warnings: Vec::new() });
    let export = ros_camera_info(&full()).unwrap();
    assert!(export.text.contains("-0.0756") && !export.text.contains("0.25,"));
    assert!(matches!(
        export.warnings[..],
        [ExportWarning::Skew { written: false, .. }, ExportWarning::Lens { .. }, ExportWarning::Depth { .. }]
    ));
}

#[test]
fn kalibr() {
    let export = kalibr_camchain(&plain()).unwrap();
    let expected = "\
cam0:
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.1468, 0.0463, 0.0012, -7.0e-5]
  distortion_model: radtan
  intrinsics: [476.5, 477.25, 312.97, 242.49]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
";
    assert_eq!(export, Export { text: expected.into(), warnings: Vec::new() });
    let warnings = kalibr_camchain(&full()).unwrap().warnings;
    assert_eq!(warnings.len(), 4);
    assert!(warnings.contains(&ExportWarning::Distortion { format: "Kalibr", coefficient: "k3", value: -0.0756 }));
    assert!(warnings.iter().any(|warning| warning.to_string().contains("projective")));
}

#[test]
fn mrcal() {
    let export = mrcal_cameramodel(&plain()).unwrap();
    let expected = "\
{
    'lensmodel': 'LENSMODEL_OPENCV5',

    # fx, fy, cx, cy, k1, k2, p1, p2, k3
    'intrinsics': [476.5, 477.25, 312.97, 242.49, -0.1468, 0.0463, 0.0012, -7.0e-5, 0.0],

    # rt_cam_ref
    'extrinsics': [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],

    'imagersize': [640, 480],
}
";
    assert_eq!(export, Export { text: expected.into(), warnings: Vec::new() });
    assert_eq!(mrcal_cameramodel(&full()).unwrap().warnings.len(), 3);
}

#[test]
fn numbers_that_are_none_are_refused() {
    let refused = |change: fn(&mut ExportCamera)| {
        let mut camera = full();
        change(&mut camera);
        camera.export(ExportFormat::OpenCv).unwrap_err().to_string()
    };
    assert!(refused(|camera| camera.fx = f64::NAN).contains("`fx`"));
    assert!(refused(|camera| camera.width = 0).contains("`width`"));
    assert!(refused(|camera| camera.distortion[2] = f64::INFINITY).contains("`distortion`"));
    assert!(refused(|camera| camera.depth[0].parameters[1].value = f64::NAN).contains("`projective.dw`"));
}

#[test]
fn formats_have_names() {
    assert_eq!("kalibr".parse::<ExportFormat>().unwrap(), ExportFormat::Kalibr);
    assert!("yaml".parse::<ExportFormat>().unwrap_err().to_string().contains("opencv, ros, kalibr or mrcal"));
}

#[test]
fn a_calibration_gives_its_camera() {
    let mut calibration = crate::record::example();
    calibration.camera.pieces = vec![
        piece(HookKind::Board, "board_bow", &[("a", 1e-5)]),
        piece(HookKind::Lens, "brown_conrady", &[("k1", 0.1), ("k2", 0.2), ("p1", 0.3), ("p2", 0.4), ("k3", 0.5)]),
        piece(HookKind::Lens, "thin_prism", &[("s1", 1e-3)]),
        piece(HookKind::Pixel, "pinhole", &[("fx", 1.0), ("fy", 2.0), ("cx", 3.0), ("cy", 4.0), ("skew", 5.0)]),
        piece(HookKind::Pixel, "depth_registration", &[("du", 0.5)]),
        piece(HookKind::Depth, "projective", &[("dw", 1.0)]),
    ];
    let camera = ExportCamera::from_calibration(&calibration).unwrap();
    assert_eq!([camera.fx, camera.fy, camera.cx, camera.cy, camera.skew], [1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(camera.distortion, [0.1, 0.2, 0.3, 0.4, 0.5]);
    assert_eq!(names(&camera.depth), ["depth_registration", "projective"]);
    assert_eq!(names(&camera.lens), ["thin_prism"]);
    calibration.camera.pieces.remove(3);
    let message = ExportCamera::from_calibration(&calibration).unwrap_err().to_string();
    assert!(message.contains("pinhole.fx"), "{message}");
}
