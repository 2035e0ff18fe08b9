//! Mistakes of a user end with exit code 1, a message that names the file, the field and the remedy, and nothing written.

use crate::support::{
    self, BOARD, CALIBRATION, FRAMES, Folder, HEIGHT, UNIT, WIDTH, calibration_with, calibration_with_unit, command,
    depth, fails, gray, succeeds,
};
use depthcal::io::{GrayImage, read_depth, write_depth, write_gray};

/// `calibrate` on the folder's dataset ends with these words and leaves no result.
fn calibrate_fails(folder: &Folder, parts: &[&str]) {
    fails(["calibrate", &folder.arg("data"), "--no-cache", "--out", &folder.arg("out")], parts);
    assert_eq!(folder.names("out"), [""; 0]);
}

#[test]
fn dataset_files() {
    let folder = Folder::new();
    calibrate_fails(&folder, &["dataset.toml", "[board]"]);
    let cases: [(&[&str], &[&str]); 8] = [
        (&[BOARD, FRAMES], &["dataset.toml", "`depth.unit_mm` is missing", "millimetres per step", "never guessed"]),
        (&[BOARD, FRAMES, "[depth]"], &["dataset.toml", "`depth.unit_mm` is missing"]),
        (&[BOARD, FRAMES, "[depth]\nunit_mm = nan"], &["dataset.toml:13", "`depth.unit_mm`", "nan"]),
        (&[BOARD, FRAMES, "[depth]\nunit_mm = 0.001"], &["dataset.toml:13", "`depth.unit_mm`", "0.001"]),
        (&[FRAMES, UNIT], &["dataset.toml", "`board` is missing", "columns, rows, spacing_mm"]),
        (&[BOARD, UNIT], &["dataset.toml", "`frames` is missing", "image/*.png"]),
        (&[BOARD, &FRAMES.replace("image/*", "picture/*"), UNIT], &["`frames.image`", "picture/*.png", "no file"]),
        (&["[board", FRAMES], &["dataset.toml:1", "not TOML"]),
    ];
    for (sections, parts) in cases {
        calibrate_fails(&Folder::dataset(sections), parts);
    }
    let board_cases = [
        (BOARD.replace("36.0", "nan"), ["dataset.toml:5", "`board.spacing_mm`", "give the grid spacing in mm"]),
        (BOARD.replace("asymmetric-circles", "circles"), ["dataset.toml:2", "`board.kind` \"circles\"", "symmetric"]),
        (BOARD.replace("columns", "colums"), ["dataset.toml:3", "`board.colums`", "did you mean `board.columns`"]),
    ];
    for (board, parts) in board_cases {
        calibrate_fails(&Folder::dataset(&[&board, FRAMES, UNIT]), &parts);
    }
    let folder = Folder::dataset(&[BOARD, FRAMES, "metadata = \"frames.csv\"\n", UNIT]);
    folder.write("data/frames.csv", "frame,timestamp_s\n0,1.0\n1,NaN\n2,2.0\n3,3.0\n");
    calibrate_fails(&folder, &["frames.csv:3", "timestamp_s", "finite number"]);
}

#[test]
fn images() {
    let dataset = || Folder::dataset(&[BOARD, FRAMES, UNIT]);
    let folder = dataset();
    folder.truncate("data/image/1.png");
    calibrate_fails(&folder, &["image/1.png", "damaged", "anew"]);
    let folder = dataset();
    folder.truncate("data/depth/3.png");
    calibrate_fails(&folder, &["depth/3.png", "damaged", "anew"]);
    let folder = dataset();
    folder.write("data/image/0.png", "");
    calibrate_fails(&folder, &["image/0.png", "empty"]);

    let folder = dataset();
    write_gray(folder.path("data/depth/1.png"), &GrayImage { bits: 8, ..gray(100) }).unwrap();
    calibrate_fails(&folder, &["depth/1.png", "16-bit grey PNG", "8"]);

    let half = || GrayImage { width: WIDTH / 2, height: HEIGHT, data: vec![9; WIDTH / 2 * HEIGHT], bits: 16 };
    let folder = dataset();
    write_gray(folder.path("data/image/2.png"), &half()).unwrap();
    calibrate_fails(&folder, &["image/2.png: the image has 32×48", "64×48", "leave this frame out"]);
    for name in folder.names("data/image") {
        write_gray(folder.path("data/image").join(name), &half()).unwrap();
    }
    calibrate_fails(&folder, &["image/0.png has 32×48", "depth/0.png has 64×48", "register"]);

    let folder = Folder::dataset(&[BOARD, "[frames]\nimage = \"image/*.png\"\n"]);
    write_gray(folder.path("data/image/2.png"), &half()).unwrap();
    calibrate_fails(&folder, &["image/2.png", "one size"]);
    let folder = Folder::dataset(&[BOARD, "[frames]\ndepth = \"depth/*.png\"\n", UNIT]);
    calibrate_fails(&folder, &["frames.image"]);
}

#[cfg(feature = "detect")]
#[test]
fn no_board_in_any_frame() {
    let folder = Folder::dataset(&[BOARD, FRAMES, UNIT]);
    calibrate_fails(&folder, &["not found in any of the 4 frames", "columns, rows and kind", "dataset.toml"]);
    fails(["detect", &folder.arg("data"), "--no-cache"], &["not found in any of the 4 frames"]);
}

#[cfg(not(feature = "detect"))]
#[test]
fn a_program_without_detection_says_so() {
    let folder = Folder::dataset(&[BOARD, FRAMES, UNIT]);
    calibrate_fails(&folder, &["without detection", "default features"]);
}

#[test]
fn names_of_models_and_effects() {
    let folder = Folder::dataset(&[BOARD, FRAMES, UNIT]);
    let (data, out) = (folder.arg("data"), folder.arg("out"));
    let calibrate = |more: &[&str], parts: &[&str]| {
        fails(["calibrate", &data, "--no-cache", "--out", &out].iter().chain(more), parts);
    };
    calibrate(&["--model", "projectiv"], &["--model", "'projectiv'", "projective", "quadratic_depth"]);
    calibrate(&["--model", "projective:q"], &["--model", "'q'", "dx, dy, dz, dw"]);
    calibrate(&["--model", "thin_prism"], &["--model", "'thin_prism'", "lens"]);
    calibrate(&["--with", "range_ofset"], &["--with", "'range_ofset'", "did you mean 'range_offset'?"]);
    calibrate(&["--lens", "fisheye"], &["--lens", "fisheye", "brown-conrady"]);
    calibrate(&["--estimator", "best"], &["--estimator", "joint"]);
    assert_eq!(folder.names("out"), [""; 0]);
}

#[test]
fn arguments() {
    fails(["calibrat", "data"], &["calibrat", "calibrate"]);
    fails(["calibrate", "data"], &["data", "dataset.toml"]);
    fails(["calibrate", "data", "--outt", "x"], &["--outt", "--out"]);
    fails(["evaluate", "calibration.json", "--out", "x"], &["DATASETS"]);
    fails(["apply", "calibration.json", "--out", "x"], &["DEPTH"]);
    fails(["export", "calibration.json", "--format", "matlab", "--out", "x"], &["matlab", "opencv", "kalibr"]);
    fails([""; 0], &["Usage"]);
    fails(["export", "c.json", "--format", "ros", "--out", "x", "--threads", "0"], &["--threads", "at least 1"]);
}

#[test]
fn calibration_files() {
    let folder = Folder::dataset(&[BOARD, FRAMES, UNIT]);
    let foreign_parameters = CALIBRATION.replace("\"dw\"", "\"scale\"");
    let flat = "{ \"hook\": \"depth\", \"name\": \"flatness\", \"parameters\": [] }";
    let cases: [(String, &[&str]); 9] = [
        ("not json".into(), &["calibration.json"]),
        (CALIBRATION[..CALIBRATION.len() / 2].into(), &["calibration.json", "line"]),
        ("{\"datasets\": []}".into(), &["calibration.json", "`format` is missing", "depthcal-calibration"]),
        (
            CALIBRATION.replace("\"version\": 1", "\"version\": 7"),
            &["calibration.json", "`version` is 7", "versions 1 to 3"],
        ),
        (CALIBRATION.replace("\"width\": 64, ", ""), &["calibration.json", "camera", "width"]),
        (CALIBRATION.replace("1.02", "\"much\""), &["calibration.json", "camera.pieces[1].parameters[3].value"]),
        (calibration_with(flat), &["calibration.json", "'flatness'", "projective"]),
        (foreign_parameters, &["calibration.json", "'projective'", "scale", "calibrate again"]),
        (calibration_with_unit(-1.0), &["calibration.json", "depth_unit_mm"]),
    ];
    for (content, parts) in cases {
        folder.write("calibration.json", content);
        fails(["apply", &folder.arg("calibration.json"), &folder.arg("data"), "--out", &folder.arg("out")], parts);
        assert_eq!(folder.names("out"), [""; 0]);
    }
    for command in ["apply", "evaluate"] {
        fails([command, &folder.arg("lost.json"), &folder.arg("data"), "--out", &folder.arg("out")], &["lost.json"]);
    }
    let no_pinhole = CALIBRATION.replace("\"name\": \"fx\"", "\"name\": \"f\"");
    folder.write("calibration.json", no_pinhole);
    let arguments = ["export", &folder.arg("calibration.json"), "--format", "ros", "--out", &folder.arg("out/x.yaml")];
    fails(arguments, &["calibration.json", "'pinhole'", "f, fy", "expects fx, fy"]);
    assert_eq!(folder.names("out"), [""; 0]);
}

#[test]
fn depth_to_apply_to() {
    let folder = Folder::dataset(&[BOARD, FRAMES, UNIT]);
    folder.write("calibration.json", CALIBRATION);
    let apply = |more: &[&str], parts: &[&str]| {
        let calibration = folder.arg("calibration.json");
        fails(["apply", &calibration, "--out", &folder.arg("out")].iter().chain(more), parts);
        assert_eq!(folder.names("out"), [""; 0]);
    };
    let (loose, images) = (folder.arg("data/depth"), folder.arg("data/image"));
    apply(&[&loose], &["data/depth", "depth unit is unknown", "calibration.json", "--unit-mm"]);
    for unit in ["0", "-1", "nan", "inf"] {
        apply(&[&loose, &format!("--unit-mm={unit}")], &["--unit-mm", "millimetres per step"]);
    }
    apply(&[&loose, "--unit-mm", "wide"], &["--unit-mm", "wide"]);
    apply(&[&folder.arg("data"), "--unit-mm", "2"], &["dataset.toml", "`depth.unit_mm` is 1", "--unit-mm is 2"]);
    apply(&[&folder.arg("lost.png"), "--unit-mm", "1"], &["lost.png", "no such file"]);
    folder.write("bare/note.txt", "nothing");
    apply(&[&folder.arg("bare"), "--unit-mm", "1"], &["bare", "no images", "png"]);
    apply(&[&loose, &folder.arg("data/depth/1.png"), "--unit-mm", "1"], &["depth/1.png", "the stem \"1\""]);
    std::fs::remove_file(folder.path("data/image/3.png")).unwrap();
    apply(&[&loose, "--unit-mm", "1", "--image", &images], &["depth/3.png", "--image", "stem \"3\""]);
    // A depth image of a dataset that pairs with no image is told, the others are corrected.
    let out = folder.arg("paired");
    let output = succeeds(["apply", &folder.arg("calibration.json"), "--out", &out, &folder.arg("data")]);
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.contains("not corrected: depth/3.png (no image pairs with it)"), "{told}");
    assert_eq!(folder.names("paired").len(), 3);

    // Good frames before a bad one are not written either.
    folder.truncate("data/depth/2.png");
    apply(&[&loose, "--unit-mm", "1", "--cloud"], &["depth/2.png", "damaged"]);
    write_gray(folder.path("data/depth/2.png"), &GrayImage { bits: 8, ..gray(100) }).unwrap();
    apply(&[&loose, "--unit-mm", "1"], &["depth/2.png", "16-bit grey PNG"]);
    let large = depthcal::io::DepthImage { width: 8, height: 4, data: vec![1; 32] };
    write_depth(folder.path("data/depth/2.png"), &large).unwrap();
    apply(&[&loose, "--unit-mm", "1"], &["depth/2.png", "8×4", "64×48"]);
    write_depth(folder.path("data/depth/2.png"), &depth(5)).unwrap();
    write_gray(folder.path("data/image/2.png"), &GrayImage { width: 8, height: 4, data: vec![1; 32], bits: 8 })
        .unwrap();
    let frame = folder.arg("data/depth/2.png");
    apply(
        &[&frame, "--unit-mm", "1", "--image", &folder.arg("data/image/2.png")],
        &["image/2.png has 8×4", "register"],
    );

    // Originals are not replaced.
    let before = std::fs::read(folder.path("data/depth/0.png")).unwrap();
    let arguments = ["apply", &folder.arg("calibration.json"), &loose, "--unit-mm", "1", "--out", &loose];
    fails(arguments, &["depth/0.png", "replace", "another folder"]);
    assert_eq!(std::fs::read(folder.path("data/depth/0.png")).unwrap(), before);
}

#[test]
fn simulations() {
    let folder = Folder::new();
    let simulate = |more: &[&str], parts: &[&str]| {
        fails(["simulate", "--out", &folder.arg("out")].iter().chain(more), parts);
        assert!(!folder.path("out").exists());
    };
    simulate(&["--effect", "range_ofset"], &["--effect", "range_ofset", "range_offset", "board_bow"]);
    simulate(&["--effect", "range_offset=far"], &["--effect", "range_offset", "far", "mm"]);
    simulate(&["--kind", "diagonal1"], &["--kind", "diagonal1", "sameheight2"]);
    simulate(&["--camera", "9"], &["--camera", "9", "1, 2, 3 and 4"]);
    simulate(&["--camera", "one"], &["--camera", "one"]);
    simulate(&["--frames", "0"], &["frames", "positive"]);
    simulate(&["--truth", &folder.arg("out/truth.json")], &["--truth", "outside"]);
    simulate(&["--truth", &folder.arg("out/../out/image/truth.json")], &["--truth", "outside"]);

    folder.write("mine/notes.txt", "precious");
    let arguments = ["simulate", "--frames", "1", "--out", &folder.arg("mine")];
    fails(arguments, &["mine", "not empty", "notes.txt", "empty folder"]);
    assert_eq!(folder.names("mine"), ["notes.txt"]);
    fails(["simulate", "--frames", "1", "--out", &folder.arg("mine/notes.txt")], &["notes.txt"]);
    assert_eq!(std::fs::read(folder.path("mine/notes.txt")).unwrap(), b"precious");
}

#[test]
fn an_interrupted_simulation_leaves_no_dataset_and_can_be_repeated() {
    let folder = Folder::new();
    let out = folder.arg("out");
    let staged = folder.path("out/.depthcal-dataset.tmp/image");
    let mut process = command(["simulate", "--frames", "200", "--out", &out]).spawn().unwrap();
    while support::names(&staged).is_empty() {
        assert!(process.try_wait().unwrap().is_none(), "it ended before it could be interrupted");
        std::thread::yield_now();
    }
    process.kill().unwrap();
    process.wait().unwrap();
    assert_eq!(folder.names("out"), [".depthcal-dataset.tmp"]);
    succeeds(["simulate", "--frames", "1", "--out", &out]);
    assert_eq!(folder.names("out"), ["dataset.toml", "depth", "frames.csv", "image"]);
}

#[test]
fn an_interrupted_correction_leaves_no_half_file() {
    let folder = Folder::new();
    folder.write("calibration.json", calibration_with_unit(1.0));
    for i in 0..300 {
        write_depth(folder.path(&format!("depth/{i:03}.png")), &depth(1000 + i)).unwrap();
    }
    let arguments = ["apply", &folder.arg("calibration.json"), &folder.arg("depth"), "--out", &folder.arg("out")];
    let mut process = command(arguments).spawn().unwrap();
    while folder.names("out").iter().all(|name| name.starts_with('.')) {
        assert!(process.try_wait().unwrap().is_none(), "it ended before it could be interrupted");
        std::thread::yield_now();
    }
    process.kill().unwrap();
    process.wait().unwrap();
    let visible: Vec<_> = folder.names("out").into_iter().filter(|name| !name.starts_with('.')).collect();
    assert!(!visible.is_empty());
    for name in visible {
        let image = read_depth(folder.path("out").join(&name)).unwrap();
        assert!(image.data.iter().all(|z| *z > 0), "{name}");
    }
}

/// Before the images are read, so that nobody waits for a refusal.
#[cfg(not(feature = "rerun"))]
#[test]
fn recordings_need_their_feature() {
    let folder = Folder::dataset(&[BOARD, FRAMES, UNIT]);
    folder.write("calibration.json", CALIBRATION);
    let parts = ["--rrd", "capture.rrd", "without the feature 'rerun'", "--features rerun"];
    let (calibration, data, out) = (folder.arg("calibration.json"), folder.arg("data"), folder.arg("out"));
    for command in [&["calibrate"][..], &["diagnose"], &["evaluate", calibration.as_str()]] {
        let options = [data.as_str(), "--no-cache", "--rrd", "capture.rrd", "--out", out.as_str()];
        fails(command.iter().copied().chain(options), &parts);
        assert_eq!(folder.names("out"), [""; 0]);
    }
}

/// `evaluate` refuses a folder that holds another calibration.
#[test]
fn an_evaluation_is_not_written_beside_another_calibration() {
    let folder = Folder::new();
    folder.write("given.json", CALIBRATION).write("out/calibration.json", calibration_with_unit(1.0));
    let [given, out] = ["given.json", "out"].map(|name| folder.arg(name));
    fails(
        ["evaluate", &given, "missing", "--out", &out],
        &[&out, "a calibration other than", &given, "another folder"],
    );
    assert_eq!(folder.names("out"), ["calibration.json"]);
    let calibration = folder.arg("out/calibration.json");
    fails(["evaluate", &calibration, "missing", "--out", &out], &["missing", "dataset.toml"]);
}

/// Every command that uses depth holds it against the boards that the images show, not `calibrate` alone.
#[test]
fn depth_that_contradicts_its_images_is_refused_by_every_command() {
    let folder = Folder::new();
    let [good, spoiled, out] = ["good", "spoiled", "out"].map(|name| folder.arg(name));
    for data in [&good, &spoiled] {
        succeeds(["simulate", "--camera", "1", "--kind", "general1", "--frames", "12", "--seed", "3", "--out", data]);
    }
    for name in folder.names("spoiled/depth") {
        let path = folder.path("spoiled/depth").join(&name);
        let mut depth = read_depth(&path).unwrap();
        depth.data.chunks_exact_mut(depth.width).for_each(<[u16]>::reverse);
        write_depth(&path, &depth).unwrap();
    }
    succeeds(["calibrate", &good, "--out", &out]);
    let parts = ["mirrored"];
    fails(["calibrate", &spoiled, "--estimator", "linear"], &parts);
    fails(["evaluate", &out, &spoiled], &parts);
    fails(["compare", &spoiled, "--models", "none,projective", "--learning", "0"], &parts);
    fails(["diagnose", &good, "--verify", &spoiled], &parts);
}

/// Depth images without any measurement, and a cross-validation in more parts than there are frames.
#[test]
fn empty_depth_and_too_many_parts_are_refused() {
    let folder = Folder::new();
    let data = folder.arg("data");
    succeeds(["simulate", "--camera", "1", "--kind", "general1", "--frames", "10", "--seed", "3", "--out", &data]);
    fails(["calibrate", &data, "--cross-validate", "11"], &["--cross-validate", "11", "10"]);
    for name in folder.names("data/depth") {
        let path = folder.path("data/depth").join(&name);
        let mut depth = read_depth(&path).unwrap();
        depth.data.fill(0);
        write_depth(&path, &depth).unwrap();
    }
    fails(["calibrate", &data], &["none of the 10 depth images", "any measurement"]);
}
