//! Small files of every program that is read, with the camera that they are: f 525, c (319.5, 239.5), 640×480 px.

use std::path::Path;

use super::*;

const PINHOLE: [f64; 5] = [525.0, 525.0, 319.5, 239.5, 0.0];
const D: [f64; 5] = [0.12, -0.25, 0.001, -0.002, 0.05];
const K: &str = "[525., 0., 319.5, 0., 525., 239.5, 0., 0., 1.]";

/// Checks pinhole and lens of a text.
#[track_caller]
fn check(text: &str, name: Option<&str>, size: Option<[usize; 2]>, piece: Option<&str>, values: &[f64]) {
    let camera = parse_camera(Path::new("camera"), text, name).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!((camera.size, camera.pinhole), (size, PINHOLE), "{text}");
    assert_eq!(camera.lens.as_ref().map(|lens| lens.piece), piece, "{text}");
    assert_eq!(camera.lens.map_or(Vec::new(), |lens| lens.values), values, "{text}");
}

const SIZE: Option<[usize; 2]> = Some([640, 480]);

#[test]
fn keys_of_matrix_and_coefficients_in_all_spellings() {
    let coefficients = ["distortion_coefficients", "dist_coeffs", "D", "dist", "distCoeffs", "Distortion_Coefficients"];
    for matrix in
        ["K", "M", "mtx", "camera_matrix", "Camera_Matrix", "cameraMatrix", "CameraMatrix", "intrinsic_matrix"]
    {
        for lens in coefficients {
            let text = format!(
                "%YAML:1.0\n{matrix}: !!opencv-matrix\n   data: {K}\n{lens}: !!opencv-matrix\n   data: {D:?}\n"
            );
            check(&text, None, None, Some("brown_conrady"), &D);
        }
    }
    // Lists of lists, as numpy's tolist() makes them, and the size in a list.
    let rows = "camera_matrix:\n- - 525.0\n  - 0.0\n  - 319.5\n- [0.0, 525.0, 239.5]\n- [0, 0, 1]\n";
    check(&format!("{rows}dist_coeff:\n- {D:?}\nimg_size: [640, 480]\n"), None, SIZE, Some("brown_conrady"), &D);
    let json = format!("{{\n\t\"mtx\": [[525, 0, 319.5], [0, 525, 239.5], [0, 0, 1]],\n\t\"dist\": [{D:?}]\n}}");
    check(&json, None, None, Some("brown_conrady"), &D);
    // Coefficients by their own names.
    let named = format!("K: {K}\nk1: 0.12\nk2: -0.25\np1: 0.001\np2: -0.002\nk3: 0.05\n");
    check(&named, None, None, Some("brown_conrady"), &D);
    check(
        "fx: 525\nfy: 525\ncx: 319.5\ncy: 239.5\nk1: 0.12\nk2: -0.25\n",
        None,
        None,
        Some("brown_conrady"),
        &[0.12, -0.25, 0.0, 0.0],
    );
}

#[test]
fn opencvs_xml_and_json() {
    let xml = "<?xml version=\"1.0\"?>\n<opencv_storage>\n<calibration_Time>\"Fri Jan  1\"</calibration_Time>\n<image_Width>640</image_Width>\n\
               <image_Height>480</image_Height>\n<Camera_Matrix type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  <cols>3</cols>\n  <dt>d</dt>\n  <data>\n    \
               5.2500000000000000e+002 0. 319.5 0.\n 525. 239.5 0. 0. 1.</data></Camera_Matrix>\n<Distortion_Coefficients \
               type_id=\"opencv-matrix\">\n  <rows>5</rows>\n  <data>\n 0.12 -0.25 0.001 -0.002 0.05</data></Distortion_Coefficients>\n</opencv_storage>\n";
    check(xml, None, SIZE, Some("brown_conrady"), &D);
    let fisheye =
        xml.replace(" 0.05<", "<").replace("<Camera_Matrix", "<fisheye_model>1</fisheye_model><Camera_Matrix");
    check(&fisheye, None, SIZE, Some("kannala_brandt"), &D[..4]);
    let json = format!(
        "{{\"camera_matrix\": {{\"type_id\": \"opencv-matrix\", \"rows\": 3, \"data\": {}}}, \"distortion_coefficients\": \
         {{\"data\": {D:?}}}, \"image_width\": 640, \"image_height\": 480}}",
        K.replace(".,", ".0,").replace(".]", ".0]")
    );
    check(&json, None, SIZE, Some("brown_conrady"), &D);
}

#[test]
fn several_cameras_are_chosen_by_name() {
    let stereo = format!("M1: {K}\nD1: {D:?}\nM2: {}\nD2: [0.0, 0.0, 0.0, 0.0]\n", K.replace("525", "526"));
    check(&stereo, Some("M1"), None, Some("brown_conrady"), &D);
    let second = parse_camera(Path::new("stereo.yml"), &stereo, Some("M2")).unwrap();
    assert_eq!((second.pinhole[0], second.lens.unwrap().values), (526.0, vec![0.0; 4]));
    assert!(
        fails(&stereo).contains("has several cameras: write camera.yaml#NAME with one of M1, M2"),
        "{}",
        fails(&stereo)
    );
    let nested = format!("left:\n  K: {K}\n  dist: {D:?}\nright:\n  K: {K}\n  D: [0.0, 0.0, 0.0, 0.0]\n");
    check(&nested, Some("left"), None, Some("brown_conrady"), &D);
    assert!(fails(&nested).contains("with one of left, right"));
    let list = format!("{{\"cameras\": [{{\"K\": [[525, 0, 319.5], [0, 525, 239.5], [0, 0, 1]], \"dist\": {D:?}}}]}}");
    check(&list, None, None, Some("brown_conrady"), &D);
    check(&list, Some("cameras[0]"), None, Some("brown_conrady"), &D);
    let document = format!("[{{\"name\": 1, \"K\": [525, 0, 319.5, 0, 525, 239.5, 0, 0, 1], \"dist\": {D:?}}}]");
    check(&document, Some("[0]"), None, Some("brown_conrady"), &D);
    let only = format!("K: {K}\ndist: {D:?}\n");
    let named = parse_camera(Path::new("one.yml"), &only, Some("left")).unwrap_err().to_string();
    assert!(named.contains("has no camera 'left', but one without a name (leave #NAME out)"), "{named}");
    let sides = format!("mtxL: {K}\ndistL: {D:?}\nmtxR: {K}\ndistR: {D:?}\n");
    check(&sides, Some("mtxR"), None, Some("brown_conrady"), &D);
}

/// `rostopic echo` and `ros2 topic echo` of camera_info, which print a document for every message, and the last in part.
#[test]
fn messages_of_ros() {
    let lines = |numbers: &[f64]| numbers.iter().map(|n| format!("- {n:?}\n")).collect::<String>();
    let k = [525.0, 0.0, 319.5, 0.0, 525.0, 239.5, 0.0, 0.0, 1.0];
    let p = [525.0, 0.0, 319.5, 0.0, 0.0, 525.0, 239.5, 0.0, 0.0, 0.0, 1.0, 0.0];
    let ros2 = format!(
        "header:\n  stamp:\n    sec: 1\n  frame_id: c\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\nd:\n{}k:\n{}r:\n{}p:\n{}\
         binning_x: 0\nroi:\n  height: 0\n  width: 0\n  do_rectify: false\n---\n",
        lines(&D),
        lines(&k),
        lines(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        lines(&p)
    );
    check(&ros2, None, SIZE, Some("brown_conrady"), &D);
    check(&format!("{ros2}header:\n  stamp: [1,\n"), None, SIZE, Some("brown_conrady"), &D);
    let ros1 = format!(
        "header: \n  seq: 1\nheight: 480\nwidth: 640\ndistortion_model: \"plumb_bob\"\nD: {D:?}\nK: {K}\nR: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, \
         0.0, 1.0]\nP: {p:?}\nroi: \n  height: 0\n  width: 0\n---\n"
    );
    check(&ros1, None, SIZE, Some("brown_conrady"), &D);
    // Names of the RealSense SDK in its recordings, and of surplus zeros.
    check(&ros1.replace("plumb_bob", "Brown Conrady"), None, SIZE, Some("brown_conrady"), &D);
    let padded = ros1.replace("0.05]", "0.05, 0.0, 0.0, 0.0]");
    check(&padded, None, SIZE, Some("brown_conrady"), &D);
    let empty = ros1.replace("plumb_bob", "").replace(&format!("D: {D:?}"), "D: []");
    check(&empty, None, SIZE, None, &[]);
    let equidistant = ros1.replace("plumb_bob", "equidistant").replace(", 0.05]", "]");
    check(&equidistant, None, SIZE, Some("kannala_brandt"), &D[..4]);
}

#[test]
fn ost_of_cameracalibrator() {
    let camera = |name: &str| {
        format!(
            "[{name}]\n\ncamera matrix\n525.000000 0.000000 319.500000\n0.000000 525.000000 239.500000\n0.0 0.0 1.0\n\ndistortion\n0.12 -0.25 \
             0.001 -0.002 0.05\n\nrectification\n1 0 0\n0 1 0\n0 0 1\n\nprojection\n525 0 319.5 0\n0 525 239.5 0\n0 0 1 0\n\n"
        )
    };
    let image = "# oST version 5.0 parameters\n\n[image]\n\nwidth\n640\n\nheight\n480\n\n";
    check(&format!("{image}{}", camera("narrow_stereo")), None, SIZE, Some("brown_conrady"), &D);
    let stereo = format!("{image}{}{}", camera("narrow_stereo/left"), camera("narrow_stereo/right"));
    check(&stereo, Some("narrow_stereo/right"), SIZE, Some("brown_conrady"), &D);
    assert!(fails(&stereo).contains("one of narrow_stereo/left, narrow_stereo/right"));
}

#[test]
fn kalibr_of_any_dialect() {
    let chain = "cam0:\n  T_imu_cam: #rotation\n    - [1.0, 0.0, 0.0, 0.0]\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs: [0.12, \
                 -0.25, 0.001, -0.002]\n  distortion_model: radtan\n  intrinsics: [525.0, 525.0, 319.5, 239.5] #fu, fv, cu, cv\n  resolution: [640, \
                 480]\n";
    for directive in [
        "",
        "%YAML:1.0\n",
        "%YAML:1.0 # at the top!\n\n",
        "# a comment\n%YAML:1.0\n---\n",
        "%YAML 1.2\n---\n",
        "\u{feff}---\n",
    ] {
        check(&format!("{directive}{chain}"), None, SIZE, Some("brown_conrady"), &D[..4]);
    }
    // Anchors, and matrices of OpenCV.
    let anchored = chain.replace("resolution: [640, 480]", "resolution: &size [640, 480]\n  again: *size");
    check(&anchored, None, SIZE, Some("brown_conrady"), &D[..4]);
    let matrix = chain.replace(
        "[525.0, 525.0, 319.5, 239.5] #fu, fv, cu, cv",
        "!!opencv-matrix\n    data: [525., 525., 319.5, 239.5]",
    );
    check(&matrix, None, SIZE, Some("brown_conrady"), &D[..4]);
    let joined = chain.replace("pinhole", "pinhole-equi").replace("  distortion_model: radtan\n", "");
    check(&joined, None, SIZE, Some("kannala_brandt"), &D[..4]);
    // EuRoC's sensor.yaml has the camera in the document.
    let euroc = "sensor_type: camera\nresolution: [640, 480]\ncamera_model: pinhole\nintrinsics: [525, 525, 319.5, 239.5]\n\
                 distortion_model: radial-tangential\ndistortion_coefficients: [0.12, -0.25, 0.001, -0.002]\n";
    check(euroc, None, SIZE, Some("brown_conrady"), &D[..4]);
}

#[test]
fn realsense_and_orbbec() {
    let realsense = |model: &str, k: &str| {
        format!(
            "{{\"width\": 640, \"height\": 480, \"ppx\": 319.5, \"ppy\": 239.5, \"fx\": 525.0, \"fy\": 525.0, \"model\": \"{model}\", \"coeffs\": {k}}}"
        )
    };
    let k = format!("{D:?}");
    for model in ["distortion.brown_conrady", "RS2_DISTORTION_BROWN_CONRADY", "Brown Conrady"] {
        check(&realsense(model, &k), None, SIZE, Some("brown_conrady"), &D);
    }
    for model in ["distortion.inverse_brown_conrady", "Inverse Brown Conrady", "distortion.modified_brown_conrady"] {
        check(&realsense(model, &k), None, SIZE, Some("brown_conrady"), &D);
    }
    let fisheye = realsense("distortion.kannala_brandt4", "[0.12, -0.25, 0.001, -0.002, 0.0]");
    check(&fisheye, None, SIZE, Some("kannala_brandt"), &D[..4]);
    check(&realsense("distortion.none", "[0, 0, 0, 0, 0]"), None, SIZE, None, &[]);
    check(&realsense("OB_DISTORTION_BROWN_CONRADY", &k), None, SIZE, Some("brown_conrady"), &D);
    let unnamed = fails(&realsense("distortion.polynomial", &k));
    assert!(unnamed.contains("model distortion.polynomial is not supported; brown_conrady"), "{unnamed}");
    // Decentring as strong as no RealSense has it.
    let message = fails(&realsense("distortion.inverse_brown_conrady", "[0.5, -0.25, 0.02, -0.02, 0.05]"));
    assert!(
        message.contains("`model` differs by") && message.contains("px from Brown's and Conrady's lens"),
        "{message}"
    );

    let intrinsic = "{\"fx\": 525.0, \"fy\": 525.0, \"cx\": 319.5, \"cy\": 239.5, \"width\": 640, \"height\": 480}";
    let distortion = "{\"k1\": 0.12, \"k2\": -0.25, \"k3\": 0.05, \"k4\": 0.3, \"k5\": 0.0, \"k6\": 0.01, \"p1\": 0.001, \"p2\": -0.002}";
    let orbbec = format!(
        "{{\"depthIntrinsic\": {intrinsic}, \"rgbIntrinsic\": {intrinsic}, \"depthDistortion\": {}, \"rgbDistortion\": {distortion}}}",
        distortion.replace("0.3", "0.0").replace("0.01}", "0.0}").replace("\"k6\": 0.01", "\"k6\": 0.0")
    );
    check(&orbbec, Some("depthIntrinsic"), SIZE, Some("brown_conrady"), &D);
    let eight = [0.12, -0.25, 0.001, -0.002, 0.05, 0.3, 0.0, 0.01];
    check(&orbbec, Some("rgbIntrinsic"), SIZE, Some("opencv_lens"), &eight);
    assert!(fails(&orbbec).contains("with one of depthIntrinsic, rgbIntrinsic"));
}

/// Modes of the factory calibration; the parameters are cx cy fx fy k1 … k6 codx cody p2 p1, as shares of the sensor.
#[test]
fn azure_kinects_factory_calibration() {
    let camera = |purpose: &str, model: &str, p: [f64; 14]| {
        format!(
            "{{\"Intrinsics\":{{\"ModelParameterCount\":14,\"ModelParameters\":{p:?},\"ModelType\":\"CALIBRATION_LensDistortionModel{model}\"}},\
             \"Purpose\":\"CALIBRATION_CameraPurpose{purpose}\",\"SensorHeight\":1024,\"SensorWidth\":1024}}"
        )
    };
    let p = [0.5, 0.52, 0.49, 0.491, 6.0, 4.4, 0.23, 6.4, 6.41, 1.2, 0.0, 0.0, 6.5e-5, -5.5e-5];
    let file = |model: &str, p: [f64; 14]| {
        let cameras = [camera("Depth", model, p), camera("PhotoVideo", model, p)].join(",");
        format!("{{\"CalibrationInformation\":{{\"Cameras\":[{cameras}],\"InertialSensors\":[]}}}}\0")
    };
    let text = file("BrownConrady", p);
    let named = |name: &str| parse_camera(Path::new("factory_calibration.json"), &text, Some(name)).unwrap();
    let depth = named("depth-640x576");
    assert_eq!((depth.size, depth.pinhole[0], depth.pinhole[1]), (Some([640, 576]), 0.49 * 1024.0, 0.491 * 1024.0));
    assert_eq!(depth.pinhole[2..4], [512.0 - 192.0 - 0.5, 0.52 * 1024.0 - 180.0 - 0.5]);
    let lens = depth.lens.unwrap();
    assert_eq!((lens.piece, lens.values), ("opencv_lens", vec![6.0, 4.4, -5.5e-5, 6.5e-5, 0.23, 6.4, 6.41, 1.2]));
    let colour = named("colour-1920x1080");
    assert_eq!((colour.pinhole[0], colour.pinhole[1]), (0.49 * 1920.0, 0.491 * 1440.0));
    assert_eq!(colour.pinhole[3], 0.52 * 1440.0 - 180.0 - 0.5);
    assert!(fails(&text).contains("one of depth-640x576, depth-320x288, depth-1024x1024"), "{}", fails(&text));
    let refused = |text: &str| {
        let error = parse_camera(Path::new("factory.json"), text, Some("depth-640x576"));
        error.unwrap_err().to_string()
    };
    assert!(
        refused(&file("Rational6KT", p)).contains("decentring is not OpenCV's"),
        "{}",
        refused(&file("Rational6KT", p))
    );
    let displaced = refused(&file("BrownConrady", [p[0], p[1], p[2], p[3], 0.1, 0., 0., 0., 0., 0., 0.01, 0., 0., 0.]));
    assert!(displaced.contains("codx, cody"), "{displaced}");
}

#[test]
fn open3d_by_columns_and_nerf_with_its_pixels() {
    let open3d = "{\"width\": 640, \"height\": 480, \"intrinsic_matrix\": [525.0, 0, 0, 0, 525.0, 0, 319.5, 239.5, 1]}";
    check(open3d, None, SIZE, None, &[]);
    check(&format!("{{\"class_name\": \"PinholeCameraParameters\", \"intrinsic\": {open3d}}}"), None, SIZE, None, &[]);
    let nerf = |lens: &str| {
        format!(
            "{{\"w\": 640, \"h\": 480, \"fl_x\": 525.0, \"fl_y\": 525.0, \"cx\": 320.0, \"cy\": 240.0, {lens} \"frames\": []}}"
        )
    };
    check(&nerf(""), None, SIZE, None, &[]);
    let brown = "\"k1\": 0.12, \"k2\": -0.25, \"k3\": 0.0, \"k4\": 0, \"p1\": 0.001, \"p2\": -0.002,";
    check(
        &nerf(&format!("\"is_fisheye\": false, {brown}")),
        None,
        SIZE,
        Some("brown_conrady"),
        &[0.12, -0.25, 0.001, -0.002, 0.0],
    );
    let fisheye = "\"camera_model\": \"OPENCV_FISHEYE\", \"k1\": 0.12, \"k2\": -0.25, \"k3\": 0.001, \"k4\": -0.002,";
    check(&nerf(fisheye), None, SIZE, Some("kannala_brandt"), &D[..4]);
    let sphere = fails(&nerf("\"camera_model\": \"EQUIRECTANGULAR\","));
    assert!(sphere.contains("model EQUIRECTANGULAR is not supported; OPENCV"), "{sphere}");
    let message = fails(&nerf("\"camera_model\": \"OPENCV\", \"k1\": 0.12, \"k4\": -0.002,"));
    assert!(message.contains("`k4` stands without k5 and k6"), "{message}");
}

#[test]
fn camodocal_and_orb_slam() {
    let head = "%YAML:1.0\n---\nmodel_type: TYPE\ncamera_name: camera\nimage_width: 640\nimage_height: 480\n";
    let brown = "distortion_parameters:\n   k1: 0.12\n   k2: -0.25\n   p1: 0.001\n   p2: -0.002\n";
    let pinhole = "projection_parameters:\n   fx: 525.\n   fy: 525.\n   cx: 319.5\n   cy: 239.5\n";
    let text = head.replace("TYPE", "PINHOLE") + brown + pinhole;
    check(&text, None, SIZE, Some("brown_conrady"), &D[..4]);
    let mei = head.replace("TYPE", "MEI")
        + "mirror_parameters:\n   xi: 1.75\n"
        + brown
        + "projection_parameters:\n   gamma1: 525.\n   gamma2: 525.\n   u0: 319.5\n   v0: 239.5\n";
    check(&mei, None, SIZE, Some("unified"), &[1.75, 0.12, -0.25, 0.001, -0.002]);
    let fisheye = head.replace("TYPE", "KANNALA_BRANDT")
        + "projection_parameters:\n   k2: 0.12\n   k3: -0.25\n   k4: 0.001\n   k5: -0.002\n   mu: 525.\n   mv: 525.\n   u0: 319.5\n   v0: 239.5\n";
    check(&fisheye, None, SIZE, Some("kannala_brandt"), &D[..4]);
    assert!(fails(&text.replace("PINHOLE", "SCARAMUZZA")).contains("model SCARAMUZZA is not supported; PINHOLE"));

    let numbers = "Camera1.fx: 525.0\nCamera1.fy: 525.0\nCamera1.cx: 319.5\nCamera1.cy: 239.5\nCamera1.k1: 0.12\nCamera1.k2: -0.25\n";
    let size = "Camera.width: 640\nCamera.height: 480\nCamera.fps: 30\nORBextractor.nFeatures: 2000\n";
    let pinhole = format!(
        "%YAML:1.0\n\nFile.version: \"1.0\"\nCamera.type: \"PinHole\"\n{numbers}Camera1.p1: 0.001\nCamera1.p2: -0.002\n{size}"
    );
    check(&pinhole, None, SIZE, Some("brown_conrady"), &D[..4]);
    let orb_slam2 =
        pinhole.replace("Camera1.", "Camera.").replace("File.version: \"1.0\"\nCamera.type: \"PinHole\"\n", "");
    check(&orb_slam2, None, SIZE, Some("brown_conrady"), &D[..4]);
    let fisheye =
        format!("%YAML:1.0\nCamera.type: \"KannalaBrandt8\"\n{numbers}Camera1.k3: 0.001\nCamera1.k4: -0.002\n{size}");
    check(&fisheye, None, SIZE, Some("kannala_brandt"), &D[..4]);
    let stereo = format!("{fisheye}{}", numbers.replace("Camera1", "Camera2"));
    assert!(fails(&stereo).contains("with one of Camera1, Camera2"), "{}", fails(&stereo));
    check(&stereo, Some("Camera1"), SIZE, Some("kannala_brandt"), &D[..4]);
}

/// A file of any format converted to any other is the same camera, or off by as much as the warning says.
#[test]
fn any_format_converts_to_any_other() {
    let lenses: [Lens<'_>; 4] = [
        &[],
        &[("brown_conrady", &D)],
        &[("opencv_lens", &OPENCV14[..8])],
        &[("kannala_brandt", &[0.03, -0.01, 0.004, -0.001])],
    ];
    for (lens, first) in lenses.into_iter().flat_map(|lens| CameraFormat::ALL.map(|first| (lens, first))) {
        let from = read(&export(camera_of(lens, 0.0)).export(first).unwrap().text);
        let camera = from.camera([1, 1], &Register::builtin()).unwrap();
        for second in CameraFormat::ALL {
            let written = export(camera.clone()).export(second).unwrap();
            let told = match &written.warnings[..] {
                [] => 0.0,
                [ExportWarning::Approximated { largest_px, .. }] => *largest_px,
                others => panic!("{first:?} to {second:?}, {lens:?}: {others:?}"),
            };
            let error = error_px(&camera, &read(&written.text));
            assert!(
                (error - told).abs() < 1e-9 * (1.0 + error),
                "{first:?} to {second:?}, {lens:?}: {error} told as {told}"
            );
        }
    }
}
