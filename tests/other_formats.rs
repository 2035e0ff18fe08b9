//! The commands on datasets and depth of other formats than PNG.

use std::fmt::Write as _;

use crate::support::{self, BOARD, Folder, HEIGHT, WIDTH, calibration_with_unit, depth, fails, stdout, succeeds};
use depthcal::io::{
    Calibration, DepthFrame, DepthImage, DepthValues, Observations, read_depth, read_depth_frame, read_json,
    write_depth, write_depth_frame,
};
use depthcal_simulate::{Board, CameraTruth, Kind, Pattern, Rendering, Simulation};

/// Floating-point depth in metres, with pixels that are no measurement.
fn metres() -> DepthFrame {
    let mut values: Vec<f32> = (0..WIDTH * HEIGHT).map(|i| 0.7 + i as f32 / 3000.0).collect();
    (values[0], values[1], values[2]) = (f32::NAN, 0.0, f32::INFINITY);
    DepthFrame { width: WIDTH, height: HEIGHT, values: DepthValues::Float(values) }
}

fn floats(frame: &DepthFrame) -> &[f32] {
    match &frame.values {
        DepthValues::Float(values) => values,
        DepthValues::Steps(_) => panic!("whole steps"),
    }
}

#[test]
fn apply_keeps_the_format_and_floats_are_not_rounded() {
    let folder = Folder::new();
    folder.write("calibration.json", calibration_with_unit(1000.0));
    let calibration = folder.arg("calibration.json");
    for extension in ["tiff", "npy", "exr"] {
        write_depth_frame(folder.path(&format!("depth/{extension}1.{extension}")), &metres()).unwrap();
    }
    let output = succeeds(["apply", &calibration, &folder.arg("depth"), "--out", &folder.arg("out"), "--cloud=pcd"]);
    assert!(stdout(&output).contains("3 frames"), "{}", stdout(&output));
    let names = ["exr1.exr", "exr1.pcd", "npy1.npy", "npy1.pcd", "tiff1.pcd", "tiff1.tiff"];
    assert_eq!(folder.names("out"), names);
    let first = read_depth_frame(folder.path("out/exr1.exr")).unwrap();
    let (corrected, measured) = (floats(&first), metres());
    let measured = floats(&measured);
    assert!(corrected[0].is_nan() && corrected[1] == 0.0 && corrected[2].is_infinite());
    for name in ["npy1.npy", "tiff1.tiff"] {
        let other = read_depth_frame(folder.path("out").join(name)).unwrap();
        assert!(floats(&other).iter().zip(corrected).all(|(a, b)| a.to_bits() == b.to_bits()), "{name}");
    }
    // The inverse of the hand-written D: 1/z = (1/z_m − dx x − dy y − dz) / dw, with pixel centres at integers.
    let [dx, dy, dz, dw] = support::D;
    let [fx, fy, cx, cy] = support::PINHOLE;
    for i in (3..WIDTH * HEIGHT).step_by(7) {
        let (x, y) = (((i % WIDTH) as f64 - cx) / fx, ((i / WIDTH) as f64 - cy) / fy);
        let rho = (1.0 / (1000.0 * f64::from(measured[i])) - dx * x - dy * y - dz) / dw;
        let error_mm = 1000.0 * f64::from(corrected[i]) - 1.0 / rho;
        assert!(error_mm.abs() < 0.002, "{i}: {error_mm} mm");
    }

    // Whole steps into other formats; --float keeps what rounding would lose.
    folder.write("calibration.json", calibration_with_unit(1.0));
    write_depth_frame(folder.path("steps/a.png"), &depth(1000).into()).unwrap();
    let apply = |format: &[&str], out: &str| {
        let arguments = ["apply", &calibration, &folder.arg("steps"), "--out", &folder.arg(out)].map(str::to_owned);
        succeeds(arguments.into_iter().chain(format.iter().map(|f| (*f).to_owned())));
    };
    apply(&["--format", "npy"], "whole");
    apply(&["--format", "tiff", "--float"], "float");
    let whole = read_depth_frame(folder.path("whole/a.npy")).unwrap();
    let exact = read_depth_frame(folder.path("float/a.tiff")).unwrap();
    let DepthValues::Steps(whole) = &whole.values else { panic!("rounded") };
    assert!(floats(&exact).iter().any(|z| z.fract() != 0.0));
    assert!(floats(&exact).iter().zip(whole).all(|(z, step)| (z - f32::from(*step)).abs() <= 0.501));

    fails(
        ["apply", &calibration, &folder.arg("depth/npy1.npy"), "--format", "png", "--out", &folder.arg("png")],
        &["PNG", "TIFF"],
    );
    fails(
        ["apply", &calibration, &folder.arg("steps"), "--unit-mm", "1000", "--out", &folder.arg("m")],
        &["1000 mm", "unit_mm"],
    );
}

/// The raw disparities of a Kinect 1, d = 1091.5 − 348 m / z: refused as depth, with what to write; so they are calibrated.
#[test]
fn disparities_are_named_and_with_their_declaration_calibrated() {
    let folder = Folder::new();
    let board = Board::new(Pattern::Chessboard, 8, 5, 40.0);
    let rendering = Rendering { depth_unit_mm: 1.0, ..Rendering::default() };
    let simulation = Simulation::new(CameraTruth::ideal(320, 240, 310.0), Kind::Filling1, &[], 5);
    simulation.board(board).frames(9).rendering(rendering).write_dataset(folder.path("data")).unwrap();
    for name in folder.names("data/depth") {
        let path = folder.path(&format!("data/depth/{name}"));
        let mut image = read_depth(&path).unwrap();
        for value in &mut image.data {
            let disparity = 1091.5 - 348_000.0 / f64::from(*value);
            *value =
                if DepthImage::is_measurement(*value) { disparity.round().clamp(0.0, 2047.0) as u16 } else { 2047 };
        }
        write_depth(&path, &image).unwrap();
    }
    let (data, result) = (folder.arg("data"), folder.arg("result"));
    fails(["calibrate", &data, "--out", &result], &["hold disparities", "disparity = [3.1", "under [depth]"]);
    let declared = std::fs::read_to_string(folder.path("data/dataset.toml")).unwrap();
    let disparity = "kind = \"disparity\"\ndisparity = [3.1365e-3, -2.8736e-6]";
    folder.write("data/dataset.toml", declared.replace("unit_mm = 1.0", disparity));
    succeeds(["calibrate", &data, "--out", &result]);
    let calibration: Calibration = read_json(folder.path("result/calibration.json")).unwrap();
    let rms_mm = calibration.camera.depth_rms_mm.or(calibration.fit.depth_rms_mm).unwrap();
    // A step of the disparity is 1 mm at 600 mm; its rounding alone 0.3 mm.
    assert!(rms_mm < 3.0 && calibration.camera.depth_unit_mm.is_none(), "{rms_mm} mm");
    let json = folder.arg("result/calibration.json");
    fails(["apply", &json, &data, "--out", &folder.arg("png")], &["--format tiff"]);
    succeeds(["apply", &json, &data, "--out", &folder.arg("tiff"), "--format", "tiff"]);
    let corrected = read_depth_frame(folder.path("tiff").join(&folder.names("tiff")[0])).unwrap();
    let mut valid: Vec<f64> = (0..corrected.len()).filter_map(|i| corrected.measurement(i)).collect();
    valid.sort_by(f64::total_cmp);
    assert!((200.0..3000.0).contains(&valid[valid.len() / 2]), "{} mm", valid[valid.len() / 2]);
    // Files without a dataset are taken as what the calibration's camera writes.
    let depth = folder.arg("data/depth");
    fails(["apply", &json, &depth, "--out", &folder.arg("no")], &["--format tiff"]);
    succeeds(["apply", &json, &depth, "--out", &folder.arg("bare"), "--format", "tiff"]);
    let name = &folder.names("tiff")[0];
    let [of_dataset, bare] = ["tiff", "bare"].map(|out| std::fs::read(folder.path(out).join(name)).unwrap());
    assert!(of_dataset == bare, "{name} differs");
}

#[test]
fn strays_of_a_dataset_are_listed() {
    let folder = Folder::dataset(&[
        BOARD,
        "[frames]\ndepth = \"depth/*.png\"\nimage = \"image/*.png\"\n[depth]\nunit_mm = 1.0\n",
    ]);
    folder.write("calibration.json", calibration_with_unit(1.0));
    std::fs::remove_file(folder.path("data/image/2.png")).unwrap();
    let output = succeeds(["apply", &folder.arg("calibration.json"), &folder.arg("data"), "--out", &folder.arg("out")]);
    assert!(stdout(&output).contains("not corrected: depth/2.png (no image pairs with it)"), "{}", stdout(&output));
    assert_eq!(folder.names("out"), ["0.png", "1.png", "3.png"]);
}

/// The markers that `detect` found, as any program might write them: the calibration is that of the detector, but for the
/// weights, which the file does not have.
#[test]
fn markers_of_another_detector_take_the_place_of_ours() {
    let folder = Folder::new();
    let [captures, corners] = ["captures", "corners.vnl"].map(|name| folder.arg(name));
    succeeds(["simulate", "--frames", "12", "--out", &captures]);
    let observations = |out: &str, extra: &[&str]| -> Observations {
        let out = folder.arg(out);
        succeeds(["detect", &captures, "--no-cache", "--out", &out].iter().chain(extra).copied());
        Observations::read(format!("{out}/observations.json")).unwrap()
    };
    let detected = observations("detected", &[]);
    let mut text = "# filename x y level\n".to_owned();
    for frame in &detected.frames {
        for index in 0..detected.target.len() {
            let pixel = frame.markers.iter().find(|m| m.index == index).map(|m| m.pixel);
            let cells = pixel.map_or("- - -".to_owned(), |[u, v]| format!("{u} {v} 0"));
            writeln!(text, "elsewhere/image/{}.png {cells}", frame.name).unwrap();
        }
    }
    folder.write("corners.vnl", text);
    let given = observations("given", &["--markers", &corners]);
    let pixels = |o: &Observations| -> Vec<_> {
        o.frames.iter().flat_map(|f| f.markers.iter().map(|m| (f.name.clone(), m.index, m.pixel))).collect()
    };
    assert!(pixels(&detected).len() > 400);
    assert_eq!(pixels(&given), pixels(&detected));

    let camera = |out: &str, extra: &[&str]| {
        let out = folder.arg(out);
        succeeds(["calibrate", &captures, "--no-cache", "--out", &out].iter().chain(extra).copied());
        Calibration::read(format!("{out}/calibration.json")).unwrap()
    };
    let (ours, theirs) = (camera("ours", &[]), camera("theirs", &["--markers", &corners]));
    for (ours, theirs) in ours.camera.pieces.iter().zip(&theirs.camera.pieces) {
        for (a, b) in ours.parameters.iter().zip(&theirs.parameters).filter(|(a, _)| !a.fixed) {
            let (difference, std) = ((a.value - b.value).abs(), a.std_dev.unwrap());
            assert!(difference < 0.5 * std, "{}: {} or {}, standard deviation {std}", a.name, a.value, b.value);
        }
    }
}

#[test]
fn boards_are_written_with_their_section() {
    let folder = Folder::new();
    for (kind, out) in [("asymmetric-circles", "dots.pdf"), ("chessboard", "chess.svg")] {
        let output = succeeds(["board", "--kind", kind, "--out", &folder.arg(out)]);
        assert!(stdout(&output).contains("print at 100 %"), "{}", stdout(&output));
        let section = std::fs::read_to_string(folder.path(out).with_extension("toml")).unwrap();
        assert!(section.starts_with("[board]\n") && section.contains(kind) && !section.contains("frames"), "{section}");
    }
    assert!(std::fs::read(folder.path("dots.pdf")).unwrap().starts_with(b"%PDF-"));
    for kind in ["asymmetric-circles", "symmetric-circles", "chessboard", "charuco", "aprilgrid"] {
        for paper in ["a4", "letter"] {
            succeeds(["board", "--kind", kind, "--paper", paper, "--out", &folder.arg(&format!("{kind}-{paper}.pdf"))]);
        }
    }
    fails(["board", "--kind", "chessboard", "--out", &folder.arg("a.png")], &[".pdf or .svg"]);
    fails(
        ["board", "--kind", "chessboard", "--spacing-mm", "300", "--paper", "a4", "--out", &folder.arg("a.pdf")],
        &["3000", "210"],
    );
    fails(["board", "--kind", "charuco", "--marker-mm", "40", "--out", &folder.arg("a.pdf")], &["marker_mm"]);
}

#[test]
fn schemas_are_printed() {
    for name in ["dataset", "calibration", "evaluation", "diagnosis", "comparison", "observations", "effects"] {
        let text = stdout(&succeeds(["schema", name]));
        let schema: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert!(schema["$schema"].as_str().unwrap().contains("2020-12"), "{name}");
    }
    assert_eq!(support::run(["schema", "nothing"]).status.code(), Some(1));
}
