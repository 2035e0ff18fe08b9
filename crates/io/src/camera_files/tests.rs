//! Texts as the owners of the formats write or document them, and round trips of random cameras through every format.

use std::collections::BTreeMap;
use std::path::Path;

use depthcal_model::hook::HookKind;
use depthcal_model::{Camera, Of, Register};
use proptest::prelude::*;

use super::capability::largest_error;
use super::*;
use crate::record::{ParameterRecord, PieceRecord};

mod programs;
mod refusals;

/// Lens pieces with the values of their first parameters.
type Lens<'a> = &'a [(&'static str, &'a [f64])];

fn camera_of(lens: Lens<'_>, skew: f64) -> Camera {
    let blocks = lens.iter().map(|(piece, values)| {
        let mut block = Register::builtin().block(piece, None).unwrap();
        block.theta[..values.len()].copy_from_slice(values);
        block
    });
    Camera::new(640, 480, [476.5, 477.25, 312.97, 242.49, skew], blocks.collect())
}

fn export(camera: Camera) -> ExportCamera {
    ExportCamera { camera, depth: Vec::new() }
}

fn read(text: &str) -> Intrinsics {
    parse_camera(Path::new("camera"), text, None).unwrap()
}

fn fails(text: &str) -> String {
    parse_camera(Path::new("camera.yaml"), text, None).unwrap_err().to_string()
}

/// Largest distance over the image between the pixels of a camera and of one that was read, px.
fn error_px(camera: &Camera, read: &Intrinsics) -> f64 {
    let (rays, pixels) = camera.rays_over_image(41, 31);
    assert!(rays.len() > 1000, "most of the image has rays");
    largest_error(&read.camera([640, 480], &Register::builtin()).unwrap(), &rays, &pixels)
}

/// The formats that hold a lens.
const ALL_WITH_LENSES: [CameraFormat; 12] = {
    use CameraFormat::{
        Camodocal, Colmap, Kalibr, Mrcal, Nerf, OpenCv, OpenCvJson, OpenCvXml, OrbSlam3, Ost, RealSense, Ros,
    };
    [OpenCv, OpenCvXml, OpenCvJson, Ros, Ost, Kalibr, Mrcal, Colmap, Camodocal, OrbSlam3, Nerf, RealSense]
};
const BROWN: [f64; 5] = [-0.1468, 0.0463, 0.0012, -7e-5, 0.0];
const OPENCV14: [f64; 14] = [-0.2, 0.05, 1e-3, -2e-3, 0.01, 0.1, -0.04, 0.02, 3e-3, -1e-3, 2e-3, 5e-4, 0.02, -0.03];

#[test]
fn opencv_as_it_is_written() {
    let camera = camera_of(&[("brown_conrady", &BROWN)], 0.0);
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
    let written = export(camera).export(CameraFormat::OpenCv).unwrap();
    assert_eq!(written, Export { text: expected.into(), warnings: Vec::new() });
}

#[test]
fn ros_as_it_is_written() {
    let camera = camera_of(&[("brown_conrady", &BROWN)], 0.0);
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
    let written = export(camera).export(CameraFormat::Ros).unwrap();
    assert_eq!(written, Export { text: expected.into(), warnings: Vec::new() });
}

#[test]
fn mrcal_and_colmap_as_they_are_written() {
    let camera = export(camera_of(&[("brown_conrady", &BROWN)], 0.0));
    let text = camera.export(CameraFormat::Mrcal).unwrap().text;
    assert!(text.contains("'lensmodel': 'LENSMODEL_OPENCV5'"), "{text}");
    assert!(text.contains("[476.5, 477.25, 312.97, 242.49, -0.1468, 0.0463, 0.0012, -7.0e-5, 0.0]"), "{text}");
    let text = camera.export(CameraFormat::Colmap).unwrap().text;
    assert!(text.ends_with("1 OPENCV 640 480 476.5 477.25 313.47 242.99 -0.1468 0.0463 0.0012 -7.0e-5\n"), "{text}");
}

/// Files as OpenCV's calibration sample, `cv2` and OpenCV's fisheye sample write them.
#[test]
fn opencvs_own_files() {
    let sample = "\
%YAML:1.0
---
calibration_time: \"Thu Jan  1 00:00:00 2026\"
image_width: 640
image_height: 480
board_width: 9
flags: 0
fisheye_model: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.3591573396163199e+02, 0., 3.4228315473308373e+02, 0.,
       5.3591573396163199e+02, 2.3557082909788173e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -2.6637260909660682e-01, -3.8588898922304653e-02,
       1.7831947042852964e-03, -2.8122100441115472e-04,
       2.3839153080878486e-01 ]
avg_reprojection_error: 3.9259109564815858e-01
";
    let camera = read(sample);
    assert_eq!(camera.size, Some([640, 480]));
    let [fx, fy, cx, ..] = camera.pinhole;
    assert_eq!([fx, fy, cx], [535.915_733_961_632, 535.915_733_961_632, 342.28315473308373]);
    let lens = camera.lens.unwrap();
    assert_eq!((lens.piece, lens.values.len(), lens.values[4]), ("brown_conrady", 5, 0.23839153080878486));
    let python = "%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 500., 0., 320., 0., 501., 240., 0., 0., \
                  1. ]\nD: !!opencv-matrix\n   rows: 1\n   cols: 8\n   dt: d\n   data: [ 1., 2., 3., 4., 5., 6., 7., 8. ]\n";
    let camera = read(python);
    assert_eq!((camera.size, camera.lens.unwrap().piece), (None, "opencv_lens"));
    let fisheye = sample
        .replace("fisheye_model: 0", "fisheye_model: 1")
        .replace("rows: 5\n", "rows: 4\n")
        .replace("       2.3839153080878486e-01 ]", "       ]");
    let lens = read(&fisheye).lens.unwrap();
    assert_eq!((lens.piece, lens.values[3]), ("kannala_brandt", -2.812_210_044_111_547e-4));
}

#[test]
fn the_text_of_ros_documentation() {
    let ros = "\
image_width: 2448
image_height: 2050
camera_name: prosilica
camera_matrix:
  rows: 3
  cols: 3
  data: [4827.94, 0, 1223.5, 0, 4835.62, 1024.5, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.41527, 0.31874, -0.00197, 0.00071, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [4827.94, 0, 1223.5, 0, 0, 4835.62, 1024.5, 0, 0, 0, 1, 0]
";
    let camera = read(ros);
    assert_eq!((camera.size, camera.pinhole), (Some([2448, 2050]), [4827.94, 4835.62, 1223.5, 1024.5, 0.0]));
    assert_eq!(camera.lens.unwrap().values, [-0.41527, 0.31874, -0.00197, 0.00071, 0.0]);
}

#[test]
fn the_text_of_kalibrs_wiki() {
    let kalibr = "\
cam0:
  camera_model: pinhole
  intrinsics: [461.629, 460.152, 362.680, 246.049]
  distortion_model: radtan
  distortion_coeffs: [-0.27695497, 0.06712482, 0.00087538, 0.00011556]
  T_cam_imu:
  - [0.01779318, 0.99967549,-0.01822936, 0.07008565]
  - [-0.9998017, 0.01795239, 0.00860714,-0.01771023]
  - [0.00893160, 0.01807260, 0.99979678, 0.00399246]
  - [0.0, 0.0, 0.0, 1.0]
  timeshift_cam_imu: -8.121e-05
  rostopic: /cam0/image_raw
  resolution: [752, 480]
cam1:
  camera_model: omni
  intrinsics: [0.80065662, 833.006, 830.345, 373.850, 253.749]
  distortion_model: radtan
  distortion_coeffs: [-0.33518750, 0.13211436, 0.00055967, 0.00057686]
  resolution: [752, 480]
";
    let named = |name| parse_camera(Path::new("chain.yaml"), kalibr, Some(name)).unwrap();
    assert_eq!(named("cam0").lens.unwrap().piece, "brown_conrady");
    let omni = named("cam1");
    assert_eq!((omni.pinhole[0], omni.lens.unwrap().values[0]), (833.006, 0.80065662));
    assert!(fails(kalibr).contains("camera.yaml#NAME with one of cam0, cam1"), "{}", fails(kalibr));
    let none = parse_camera(Path::new("chain.yaml"), kalibr, Some("cam7")).unwrap_err().to_string();
    assert!(none.contains("no camera 'cam7', but cam0, cam1"), "{none}");
}

#[test]
fn the_text_of_mrcals_documentation() {
    let mrcal = "\
# generated with ...
{
    'lensmodel':  'LENSMODEL_OPENCV8',

    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....
    'intrinsics': [ 1761.181055, 1761.250444, 1965.706996, 1087.518797, -0.01266096516, 0.03590794372, -0.0002547045941,
0.0005275929652, 0.01968883397, 0.01482863541, -0.0562239888, 0.0500223357,],

    # R,t from ref to camera
    'extrinsics': [ 0., 0., 0., 0., 0., 0.,],
    'imagersize': [ 4000, 2200,],
    'optimization_inputs': b'P<0>a#{ ]}x,: y%',
}
";
    let camera = read(mrcal);
    assert_eq!((camera.size, camera.pinhole[2]), (Some([4000, 2200]), 1965.706996));
    assert_eq!(camera.lens.unwrap().values[7], 0.0500223357);
}

#[test]
fn the_text_of_colmaps_documentation() {
    let colmap = "\
# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
# Number of cameras: 3
1 SIMPLE_PINHOLE 3072 2304 2559.81 1536 1152
2 PINHOLE 3072 2304 2560.56 2560.56 1536 1152
3 SIMPLE_RADIAL 3072 2304 2559.69 1536 1152 -0.0218531
";
    let camera = parse_camera(Path::new("cameras.txt"), colmap, Some("3")).unwrap();
    assert_eq!(camera.pinhole, [2559.69, 2559.69, 1535.5, 1151.5, 0.0]);
    assert_eq!(camera.lens, Some(FileLens { piece: "brown_conrady", values: vec![-0.0218531] }));
    assert!(fails(colmap).contains("1, 2, 3"), "{}", fails(colmap));
}

#[test]
fn faults_are_named() {
    assert!(
        fails("a: 1\n").contains("none of the camera files that are read, it has the keys a: write `camera_matrix`")
    );
    assert!(fails("a: [1\n").contains("no valid YAML"), "{}", fails("a: [1\n"));
    assert!(fails("1 FOV 3 2 1 1 1 1 1\n").contains("model FOV is not supported"));
    assert!(fails("1 OPENCV 3 2 1 1\n").contains("2 numbers, expected 8"));
    let ros = |model: &str, d: &str| {
        format!(
            "camera_matrix: {{data: [1, 0, 1, 0, 1, 1, 0, 0, 1]}}\ndistortion_model: {model}\ndistortion_coefficients: {{data: [{d}]}}\n"
        )
    };
    assert!(fails(&ros("plumb_bob", "1, 2")).contains("`distortion_coefficients` has 2 numbers, expected 4 or 5"));
    assert!(fails(&ros("plumb_bob", "1, .nan, 3, 4")).contains("no list of finite numbers"));
    assert!(fails(&ros("fov", "1")).contains("model fov is not supported; plumb_bob"));
    let kalibr = "cam0:\n  camera_model: ds\n  intrinsics: [1]\n";
    assert!(fails(kalibr).contains("model ds is not supported; pinhole and omni are"), "{}", fails(kalibr));
    let mrcal = "{'lensmodel': 'LENSMODEL_OPENCV5', 'intrinsics': [1, 1, 1, 1]}";
    assert!(fails(mrcal).contains("has 4 numbers, expected 9"), "{}", fails(mrcal));
    let unreadable = read_camera("/nowhere/camera.yml").unwrap_err().to_string();
    assert!(unreadable.contains("cannot read /nowhere/camera.yml"), "{unreadable}");
}

#[test]
fn formats_have_names() {
    for format in CameraFormat::ALL {
        assert_eq!(format.name().parse::<CameraFormat>().unwrap(), format);
    }
    let message = "yaml".parse::<CameraFormat>().unwrap_err().to_string();
    assert!(
        message.contains("use one of opencv, opencv-xml, opencv-json, ros, ost, kalibr, mrcal, colmap, open3d"),
        "{message}"
    );
}

#[test]
fn numbers_that_are_none_are_refused() {
    let refused = |change: fn(&mut ExportCamera)| {
        let mut camera = export(camera_of(&[("brown_conrady", &BROWN)], 0.0));
        change(&mut camera);
        camera.export(CameraFormat::OpenCv).unwrap_err().to_string()
    };
    assert!(
        refused(|c| c.camera = Camera::new(640, 480, [f64::NAN, 1.0, 1.0, 1.0, 0.0], Vec::new()))
            .contains("pinhole.fx")
    );
    assert!(refused(|c| c.camera.width = 0).contains("`width`"));
    let lens = |c: &mut ExportCamera| c.camera = camera_of(&[("brown_conrady", &[0.0, 0.0, f64::INFINITY])], 0.0);
    assert!(refused(lens).contains("`brown_conrady.p1`"));
}

/// Every format holds these lenses: written and read they give the same pixels.
#[test]
fn what_a_format_holds_comes_back() {
    use CameraFormat::{
        Camodocal, Colmap, Kalibr, Mrcal, Nerf, OpenCv, OpenCvJson, OpenCvXml, OrbSlam3, Ost, RealSense, Ros,
    };
    let fisheye: &[f64] = &[0.03, -0.01, 0.004, -0.001];
    let cases: [(Lens<'_>, &[CameraFormat]); 9] = [
        (&[], &CameraFormat::ALL),
        (&[("brown_conrady", &[-0.1, 0.05, 1e-3, 2e-3])], &ALL_WITH_LENSES),
        (
            &[("brown_conrady", &[-0.1, 0.05, 1e-3, 2e-3, -0.02])],
            &[OpenCv, OpenCvXml, OpenCvJson, Ros, Ost, Mrcal, Colmap, Camodocal, OrbSlam3, RealSense],
        ),
        (
            &[("brown_conrady", &OPENCV14[..5]), ("rational_distortion", &OPENCV14[5..8])],
            &[OpenCv, OpenCvXml, OpenCvJson, Ros, Ost, Mrcal, Colmap, Camodocal],
        ),
        (&[("opencv_lens", &OPENCV14[..12])], &[OpenCv, OpenCvXml, OpenCvJson, Mrcal]),
        (&[("opencv_lens", &OPENCV14)], &[OpenCv, OpenCvXml, OpenCvJson]),
        (
            &[("kannala_brandt", fisheye)],
            &[OpenCv, OpenCvXml, OpenCvJson, Ros, Kalibr, Colmap, Camodocal, OrbSlam3, Nerf, RealSense],
        ),
        (&[("unified", &[0.8, -0.1, 0.05, 1e-3, 2e-3])], &[Kalibr, Camodocal]),
        (&[("cahvor", &[0.01, -0.02, 0.003, -0.1, 0.02])], &[Mrcal]),
    ];
    for (lens, formats) in cases {
        for format in formats {
            let camera = camera_of(lens, 0.0);
            let written = export(camera.clone()).export(*format).unwrap();
            assert_eq!(written.warnings, Vec::new(), "{format:?} holds {lens:?}");
            let error = error_px(&camera, &read(&written.text));
            assert!(error < 1e-9, "{format:?}, {lens:?}: {error:e} px");
        }
    }
}

/// A lens that a format cannot hold is replaced by the nearest, and the error that is told is the error of the file.
#[test]
fn what_a_format_cannot_hold_is_told_with_its_error() {
    let fisheye: &[f64] = &[0.03, -0.01, 0.004, -0.001];
    let cases: [(Lens<'_>, f64, CameraFormat, &str, f64); 9] = [
        (&[("brown_conrady", &[-0.15, 0.05, 1e-3, 2e-3, -0.02])], 0.0, CameraFormat::Kalibr, "k3", 0.5),
        (&[("brown_conrady", &BROWN)], 0.25, CameraFormat::OpenCv, "skew", 0.5),
        (&[("opencv_lens", &OPENCV14)], 0.0, CameraFormat::Ros, "tau_x", 5.0),
        (&[("division", &[-0.2])], 0.0, CameraFormat::OpenCv, "division", 0.05),
        (&[("kannala_brandt", fisheye)], 0.0, CameraFormat::Mrcal, "kannala_brandt", 0.05),
        (&[("unified", &[0.8, -0.1, 0.05, 1e-3, 2e-3])], 0.0, CameraFormat::Colmap, "unified", 2.0),
        (&[("cahvor", &[0.01, -0.02, 0.003, -0.1, 0.02])], 0.0, CameraFormat::OpenCv, "cahvor", 1.0),
        (
            &[("tilted_sensor", &[0.02, 0.01]), ("thin_prism", &[1e-3, 0.0, 1e-3])],
            0.0,
            CameraFormat::OpenCv,
            "thin_prism",
            0.1,
        ),
        (
            &[("kannala_brandt", fisheye), ("thin_prism", &[1e-3])],
            0.1,
            CameraFormat::Ros,
            "skew, kannala_brandt, thin_prism",
            1.0,
        ),
    ];
    for (lens, skew, format, named, most_px) in cases {
        let camera = camera_of(lens, skew);
        let written = export(camera.clone()).export(format).unwrap();
        let [ExportWarning::Approximated { lost, largest_px, .. }] = &written.warnings[..] else {
            panic!("{format:?}, {lens:?}: {:?}", written.warnings)
        };
        assert!(lost.join(", ").contains(named), "{format:?}, {lens:?}: {lost:?}");
        let error = error_px(&camera, &read(&written.text));
        assert!(
            (error - largest_px).abs() < 1e-9 * (1.0 + error),
            "{format:?}, {lens:?}: {error} told as {largest_px}"
        );
        assert!(error > 0.0 && error < most_px, "{format:?}, {lens:?}: {error} px");
        assert!(written.warnings[0].to_string().contains(" px over the image"), "{}", written.warnings[0]);
    }
}

#[test]
fn depth_pieces_are_written_or_warned_of() {
    let parameter =
        |name: &str, value| ParameterRecord { name: name.into(), unit: "1".into(), value, std_dev: None, fixed: false };
    let depth = PieceRecord {
        hook: HookKind::Depth,
        name: "projective".into(),
        parameters: vec![parameter("dx", 1.3406e-7), parameter("dw", 1.00604654)],
        of: Of::True,
        on: None,
        options: BTreeMap::from([("columns".to_owned(), 6.0)]),
        formula: None,
    };
    let camera = ExportCamera { camera: camera_of(&[], 0.0), depth: vec![depth] };
    let written = camera.export(CameraFormat::OpenCv).unwrap();
    let pieces = "\
depth_pieces:
   -
      name: \"projective\"
      options:
         - { name: \"columns\", value: 6.0 }
      parameters:
         - { name: \"dx\", unit: \"1\", value: 1.3406e-7 }
         - { name: \"dw\", unit: \"1\", value: 1.00604654 }
";
    assert!(written.text.ends_with(pieces) && written.warnings.is_empty(), "{}", written.text);
    for format in CameraFormat::ALL.into_iter().filter(|f| *f != CameraFormat::OpenCv) {
        let written = camera.export(format).unwrap();
        assert!(matches!(&written.warnings[..], [ExportWarning::Depth { pieces, .. }] if *pieces == ["projective"]));
    }
}

proptest! {
    /// Random cameras of OpenCV's and the fisheye model through the formats that hold them.
    #[test]
    fn random_cameras_come_back(k in prop::array::uniform14(-1.0..1.0_f64), count in prop::sample::select(vec![4, 5, 8, 12, 14])) {
        let scales = [0.05, 0.02, 1e-3, 1e-3, 0.01, 0.05, 0.02, 0.01, 1e-3, 1e-4, 1e-3, 1e-4, 0.01, 0.01];
        let mut values: Vec<f64> = k.iter().zip(scales).map(|(k, s)| k * s).collect();
        values.truncate(count);
        let camera = camera_of(&[("opencv_lens", &values)], 0.0);
        let formats: &[CameraFormat] = match count {
            4 => &ALL_WITH_LENSES,
            5 | 8 => &[CameraFormat::OpenCv, CameraFormat::Ros, CameraFormat::Mrcal, CameraFormat::Colmap, CameraFormat::Ost, CameraFormat::Camodocal],
            12 => &[CameraFormat::OpenCv, CameraFormat::Mrcal],
            _ => &[CameraFormat::OpenCv],
        };
        for format in formats {
            let written = export(camera.clone()).export(*format).unwrap();
            prop_assert!(written.warnings.is_empty());
            prop_assert!(error_px(&camera, &read(&written.text)) < 1e-9);
        }
    }
}

#[test]
fn a_calibration_gives_its_camera() {
    let piece = |hook, name: &str| PieceRecord {
        hook,
        name: name.into(),
        parameters: Vec::new(),
        of: Of::True,
        on: None,
        options: BTreeMap::new(),
        formula: None,
    };
    let mut calibration = crate::record::example();
    calibration.camera.pieces = vec![
        piece(HookKind::Board, "board_bow"),
        piece(HookKind::Lens, "brown_conrady"),
        piece(HookKind::Pixel, "pinhole"),
        piece(HookKind::Pixel, "depth_registration"),
        piece(HookKind::Depth, "projective"),
    ];
    let all = camera_of(&[("board_bow", &[1e-5]), ("brown_conrady", &BROWN), ("projective", &[1e-5])], 0.5);
    let exported = ExportCamera::new(&all, &calibration);
    let names: Vec<&str> = exported.camera.blocks().iter().map(|b| b.name()).collect();
    assert_eq!(names, ["brown_conrady", "pinhole"]);
    assert_eq!(exported.camera.pinhole()[4], 0.5);
    let depth: Vec<&str> = exported.depth.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(depth, ["depth_registration", "projective"]);
}
