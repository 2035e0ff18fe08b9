use std::collections::BTreeMap;

use depthcal_model::hook::HookKind;
use depthcal_model::{Of, On, Pattern};
use proptest::prelude::*;
use serde_json::json;

use super::super::camera::{NoiseRecord, ParameterRecord};
use super::super::extrinsics::{ExtrinsicsRecord, ExtrinsicsStdDev};
use super::*;
use crate::file::parse_versioned;

fn parameter(name: &str, unit: &str, value: f64, std_dev: Option<f64>) -> ParameterRecord {
    ParameterRecord { name: name.into(), unit: unit.into(), value, std_dev, fixed: std_dev.is_none() }
}

pub(crate) fn example() -> Calibration {
    let pinhole = PieceRecord {
        hook: HookKind::Pixel,
        name: "pinhole".into(),
        parameters: vec![
            parameter("fx", "px", 476.9, Some(0.1)),
            parameter("fy", "px", 0.1 + 0.2, Some(0.1)),
            parameter("skew", "px", 0.0, None),
        ],
        of: Of::True,
        on: None,
        options: BTreeMap::new(),
        formula: None,
    };
    let spline = PieceRecord {
        hook: HookKind::Depth,
        name: "bspline".into(),
        parameters: vec![parameter("a_0_0", "1/mm", 1.3406e-4, Some(1e-7))],
        of: Of::Measured,
        on: Some(On::Factor),
        options: BTreeMap::from([("columns".into(), 6.0), ("tau_s".into(), f64::INFINITY)]),
        formula: None,
    };
    Calibration {
        camera: CameraRecord {
            noise: NoiseRecord {
                pixel_sigma: 0.05,
                inverse_depth_sigma_a: Some(3e-6),
                inverse_depth_sigma_b: Some(4.0),
                correlation_length_px: Some(3.5),
                other: BTreeMap::new(),
            },
            depth_unit_mm: Some(0.25),
            frames_used: 1,
            reprojection_rms_px: Some(0.1),
            depth_rms_mm: Some(6.4),
            ..CameraRecord::unnamed([640, 480], vec![pinhole, spline])
        },
        others: Vec::new(),
        covariance: Some(CovarianceRecord {
            parameters: vec!["pinhole.fx".into(), "pinhole.fy".into()],
            matrix: vec![vec![0.01, 0.002], vec![0.002, 0.01]],
        }),
        fit: FitRecord {
            estimator: "joint".into(),
            lens_comparison: None,
            model: "projective".into(),
            prior: None,
            reprojection_rms_px: 0.1,
            depth_rms_mm: Some(6.4),
            frames_used: 1,
            frames_dropped: vec![DroppedFrame { name: "0002".into(), reason: "board not found".into() }],
            declarations: Vec::new(),
            termination: "converged".into(),
            cost: 12.5,
            iterations: 7,
        },
        frames: vec![FrameRecord {
            name: "0001".into(),
            rotation: [0.6, 0.0, 0.8, 0.0],
            translation_mm: [1.0, 2.0, 1000.0 / 3.0],
            reprojection_rms_px: 0.1,
            depth_rms_mm: None,
            metadata: FrameMetadata { timestamp_s: Some(0.5), ..FrameMetadata::default() },
        }],
        dataset: FileReference { path: "captures".into(), digest: "ab".into() },
        target: Target {
            pattern: Pattern::AsymmetricCircles { circle_diameter_mm: 20.0 },
            columns: 4,
            rows: 11,
            spacing_mm: 36.0,
        },
        observations: None,
    }
}

fn round_trip(calibration: &Calibration) -> Result<Calibration, FileError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out/calibration.json");
    calibration.write(&path)?;
    Calibration::read(&path)
}

#[test]
fn reads_back_what_was_written() {
    let example = example();
    assert_eq!(round_trip(&example).unwrap(), example);
    assert_eq!(example.value("pinhole", "fx"), Some(476.9));
    assert_eq!(example.value("pinhole", "fz"), None);
    assert_eq!(example.covariance.unwrap().get("pinhole.fy", "pinhole.fx"), Some(0.002));
}

#[test]
fn the_file_has_the_fields_of_the_contract() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("calibration.json");
    example().write(&path).unwrap();
    let json: serde_json::Value = crate::file::read_json(&path).unwrap();
    assert_eq!(json["format"], "depthcal-calibration");
    assert_eq!(json["version"], 2);
    assert_eq!(json["camera"]["pieces"][0]["hook"], "pixel");
    assert_eq!(json["camera"]["pieces"][0]["parameters"][0]["std_dev"], 0.1);
    let options = &json["camera"]["pieces"][1]["options"];
    assert_eq!((&options["columns"], &options["tau_s"]), (&6.0.into(), &"inf".into()));
    assert_eq!(json["covariance"]["parameters"][1], "pinhole.fy");
    assert_eq!(json["fit"]["frames_dropped"][0]["reason"], "board not found");
    assert_eq!(json["frames"][0]["metadata"]["timestamp_s"], 0.5);
    assert_eq!(json["target"]["kind"], "asymmetric-circles");
}

fn fault_of(change: impl FnOnce(&mut Calibration)) -> String {
    let mut calibration = example();
    change(&mut calibration);
    round_trip(&calibration).unwrap_err().to_string()
}

#[test]
fn faults_name_the_field() {
    let cases = [
        (fault_of(|c| c.camera.pieces[0].parameters[1].value = f64::NAN), "camera.pieces[0].parameters[1].value"),
        (fault_of(|c| c.fit.cost = f64::INFINITY), "fit.cost"),
        (fault_of(|c| c.camera.width = 0), "camera.width"),
        (fault_of(|c| c.camera.pieces[1].name = "pinhole".into()), "camera.pieces"),
        (fault_of(|c| c.frames[0].rotation[0] = 1.0), "frames[0].rotation"),
        (fault_of(|c| c.camera.noise.pixel_sigma = -1.0), "noise.pixel_sigma"),
        (fault_of(|c| c.camera.depth_unit_mm = Some(0.0)), "depth_unit_mm"),
        (fault_of(|c| c.camera.pieces[0].parameters[0].std_dev = Some(-1.0)), "parameters[0].std_dev"),
        (fault_of(|c| c.covariance.as_mut().unwrap().matrix[0].truncate(1)), "covariance.matrix"),
        (fault_of(|c| c.covariance.as_mut().unwrap().matrix[1][0] = 0.003), "covariance.matrix[1][0]"),
    ];
    for (message, field) in cases {
        assert!(message.contains(field) && message.contains("calibration.json"), "{message}");
    }
}

/// Corrections have tables of the image's size, and detections one of the board's.
#[test]
fn sizes_that_would_fill_the_memory_are_refused() {
    let huge = |c: &mut Calibration| (c.camera.width, c.camera.height) = (usize::MAX, 2);
    assert!(fault_of(huge).contains("`camera.width` is 18446744073709551615"));
    assert!(fault_of(|c| (c.camera.width, c.camera.height) = (1 << 20, 1 << 20)).contains("268435456 px"));
    assert!(fault_of(|c| c.target.columns = usize::MAX).contains("`target.columns` is 18446744073709551615"));
    let several = |c: &mut Calibration| {
        let board = depthcal_model::Target { rows: 1001, ..c.target.clone() };
        let part = depthcal_model::NumberedBoard { name: "a".into(), first_tag: 0, board };
        c.target = depthcal_model::Target::several(vec![part]);
    };
    assert!(fault_of(several).contains("`target.boards[0].board.rows` is 1001"));
    let nested = |c: &mut Calibration| {
        let inner = depthcal_model::NumberedBoard { name: "b".into(), first_tag: 0, board: c.target.clone() };
        let board = depthcal_model::Target::several(vec![inner]);
        let part = depthcal_model::NumberedBoard { name: "a".into(), first_tag: 0, board };
        c.target = depthcal_model::Target::several(vec![part]);
    };
    let message = fault_of(nested);
    assert!(message.contains("is several boards again"), "{message}");
}

fn parse(text: &str) -> Result<Calibration, FileError> {
    parse_versioned(Path::new("c.json"), text.as_bytes())
}

#[test]
fn another_format_or_version_is_refused() {
    let message = parse("{\"datasets\": []}").unwrap_err().to_string();
    assert!(message.contains("c.json") && message.contains("missing"), "{message}");
    let message = parse("{\"format\": \"depthcal-calibration\", \"version\": 4}").unwrap_err().to_string();
    assert!(message.contains("version") && message.contains("versions 1 to 3"), "{message}");
    let message = parse("{\"format\": \"depthcal-calibration\", \"version\": 1}").unwrap_err().to_string();
    assert!(message.contains("camera"), "{message}");
}

proptest! {
    #[test]
    fn any_text_is_an_error_and_no_panic(text in ".*", bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(parse(&text).is_err());
        prop_assert!(parse_versioned::<Calibration>(Path::new("c.json"), &bytes).is_err());
    }
}

/// Files of one camera stay what they were, to the version; those of a rig say that they are.
#[test]
fn a_rig_raises_the_version() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("calibration.json");
    let written = |calibration: &Calibration| {
        calibration.write(&path).unwrap();
        crate::file::read_json::<serde_json::Value>(&path).unwrap()
    };
    let one = written(&example());
    assert_eq!(one["version"], 2);
    assert!(one.get("cameras").is_none());
    let colour = CameraRecord {
        name: "colour".into(),
        camera_from_rig: ExtrinsicsRecord {
            translation_mm: [-50.0, 0.0, 0.1],
            std_dev: Some(ExtrinsicsStdDev { rotation_rad: [1e-5; 3], translation_mm: [0.01; 3] }),
            ..ExtrinsicsRecord::REFERENCE
        },
        frames_used: 3,
        reprojection_rms_px: Some(0.1),
        ..CameraRecord::unnamed([640, 480], example().camera.pieces)
    };
    let mut rig = Calibration { others: vec![colour], ..example() };
    rig.camera.name = "infrared".into();
    let file = written(&rig);
    assert_eq!(file["version"], 3);
    let extrinsics = &file["cameras"][1]["camera_from_rig"];
    assert_eq!(extrinsics["translation_mm"][0], -50.0);
    assert_eq!(extrinsics["std_dev"]["rotation_rad"][2], 1e-5);
    // Programs that know one camera read the reference.
    assert_eq!((&file["camera"]["width"], &file["noise"]["pixel_sigma"]), (&json!(640), &json!(0.05)));
    assert_eq!(Calibration::read(&path).unwrap(), rig);
    // One camera that has a name keeps it.
    let named = Calibration { others: Vec::new(), ..rig.clone() };
    assert_eq!(written(&named)["version"], 3);
    assert_eq!(Calibration::read(&path).unwrap(), named);
    rig.others[0].camera_from_rig.rotation[0] = 2.0;
    let message = rig.write(&path).unwrap_err().to_string();
    assert!(message.contains("cameras[1].camera_from_rig.rotation"), "{message}");
}
