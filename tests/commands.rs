//! The commands that need no board to be found: help and exit codes, export, apply, simulate.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::support::{
    self, BOARD, CALIBRATION, D, FRAMES, Folder, HEIGHT, PINHOLE, WIDTH, calibration_with, calibration_with_unit,
    depth, run, stderr, stdout, succeeds,
};
use depthcal::io::{Dataset, DepthImage, GrayImage, read_depth, read_json, write_depth, write_gray};
use depthcal_simulate::Truth;

#[test]
fn help_and_version() {
    let help = stdout(&succeeds(["--help"]));
    for command in ["detect", "calibrate", "diagnose", "compare", "evaluate", "apply", "simulate", "export", "man"] {
        assert!(help.contains(&format!("\n  {command}")), "{help}");
        for flag in ["--help", "-h"] {
            let text = stdout(&succeeds([command, flag]));
            assert!(text.contains(&format!("Usage: depthcal {command}")), "{text}");
        }
    }
    let effects = stdout(&succeeds(["simulate", "--help"]));
    assert!(["cyclic_depth", "board_bow", "smooth_map"].iter().all(|name| effects.contains(name)), "{effects}");
    assert!(stdout(&succeeds(["--version"])).starts_with("depthcal "));
    assert_eq!(run(["unknown"]).status.code(), Some(1));
    assert_eq!(run([""; 0]).status.code(), Some(1));
}

/// Every command's help ends with commands to copy, which name options that exist.
#[test]
fn help_teaches_by_examples() {
    let help = stdout(&succeeds(["--help"]));
    assert!(help.contains("Exit codes:") && help.contains("NO_COLOR") && help.contains("report.html"), "{help}");
    for command in
        ["detect", "calibrate", "diagnose", "evaluate", "compare", "apply", "export", "simulate", "completions", "man"]
    {
        let text = stdout(&succeeds([command, "--help"]));
        let (options, examples) =
            text.split_once("Examples:").unwrap_or_else(|| panic!("{command}: no examples\n{text}"));
        let lines = examples.lines().filter(|l| l.trim_start().starts_with(&format!("depthcal {command}")));
        let lines: Vec<&str> = lines.collect();
        assert!(!lines.is_empty(), "{command}: {examples}");
        for flag in lines.iter().flat_map(|l| l.split_whitespace()).filter(|w| w.starts_with("--")) {
            assert!(options.contains(flag), "{command} has no {flag}");
        }
    }
}

#[test]
fn completions_and_manual_pages() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = stdout(&succeeds(["completions", shell]));
        for word in ["calibrate", "diagnose", "cross-validate"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    assert_eq!(run(["completions", "tcsh"]).status.code(), Some(1));
    let page = stdout(&succeeds(["man"]));
    assert!(page.contains(".TH depthcal 1") && page.contains("Exit codes:"), "{page}");
    let folder = Folder::new();
    succeeds(["man", "--out", &folder.arg("man1")]);
    let names = folder.names("man1");
    assert!(
        ["depthcal.1", "depthcal-calibrate.1", "depthcal-man.1"].iter().all(|n| names.iter().any(|m| m == n)),
        "{names:?}"
    );
    let page = std::fs::read_to_string(folder.path("man1/depthcal-diagnose.1")).unwrap();
    assert!(page.contains("\\-\\-verify") && page.contains("Examples:"), "{page}");
}

/// With --json standard output is one JSON value, whatever happens; words are on standard error.
#[test]
fn results_and_failures_as_json() {
    let folder = Folder::new();
    folder.write("calibration.json", CALIBRATION);
    let (calibration, out) = (folder.arg("calibration.json"), folder.arg("camera.yml"));
    let output = succeeds(["export", &calibration, "--format", "opencv", "--out", &out, "--json"]);
    let value: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!((&value["command"], &value["exit_code"]), (&"export".into(), &0.into()));
    assert_eq!(value["written"][0].as_str(), Some(out.as_str()));
    assert!(stderr(&output).contains("written: "), "{}", stderr(&output));

    let output = run(["--json", "evaluate", &folder.arg("missing.json"), "captures", "--out", &folder.arg("check")]);
    assert_eq!(output.status.code(), Some(1));
    let value: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(value["exit_code"], 1);
    assert!(value["error"].as_str().unwrap().contains("missing.json"), "{value}");
    assert!(stderr(&output).contains("missing.json"));
}

/// Nothing but a terminal gets colours or progress.
#[test]
fn no_control_characters_in_files() {
    let folder = Folder::new();
    folder.write("calibration.json", CALIBRATION);
    for no_color in [false, true] {
        let mut command =
            support::command(["export", &folder.arg("missing.json"), "--format", "ros", "--out", "x", "-v"]);
        if no_color {
            command.env("NO_COLOR", "1");
        }
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        assert!(!output.stderr.contains(&0x1b) && !output.stdout.contains(&0x1b), "{}", stderr(&output));
        assert!(stderr(&output).starts_with("error: "), "{}", stderr(&output));
    }
}

/// Results have a folder where none is named, a folder of results stands for its calibration.json, and frames from standard input
/// need no folder at all.
#[test]
fn folders_may_be_left_out() {
    let folder = Folder::new();
    folder.write("result/calibration.json", calibration_with_unit(1.0));
    let (frame, _) = wall(1.0, 900.0);
    write_depth(folder.path("depth/a.png"), &frame).unwrap();
    let inside = |arguments: &[&str]| {
        let output = support::command(arguments).current_dir(folder.path("")).output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
        output
    };
    inside(&["apply", "result", "depth"]);
    assert!(folder.path("depthcal-out/apply/a.png").is_file());
    inside(&["export", "result", "--format", "opencv"]);
    assert!(folder.path("depthcal-out/export/camera.yml").is_file());
    inside(&["simulate", "--frames", "2"]);
    assert!(folder.path("depthcal-out/simulate/dataset.toml").is_file());

    let bytes: Vec<u8> = frame.data.iter().flat_map(|v| v.to_le_bytes()).collect();
    let corrected = support::run_with_input(["apply", &folder.arg("result"), "-"], &bytes);
    assert!(corrected.status.success(), "{}", stderr(&corrected));
    assert_eq!(corrected.stdout.len(), bytes.len());
    for command in ["calibrate", "diagnose", "compare", "evaluate", "diff", "fleet", "import", "live", "board"] {
        let help = stdout(&succeeds([command, "--help"]));
        let words = help.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.contains(&format!("[default: depthcal-out/{command}")), "{help}");
    }
}

#[test]
fn exports() {
    let folder = Folder::new();
    folder.write("calibration.json", CALIBRATION);
    let cases = [
        ("opencv", "camera_matrix: !!opencv-matrix", "depth_pieces"),
        ("ros", "distortion_model: plumb_bob", "projection_matrix"),
        ("kalibr", "camera_model: pinhole", "radtan"),
        ("mrcal", "LENSMODEL_OPENCV5", "imagersize"),
        ("colmap", "1 OPENCV ", "0.0"),
    ];
    for (format, first, second) in cases {
        let out = folder.arg(&format!("new/{format}"));
        let output = succeeds(["export", &folder.arg("calibration.json"), "--format", format, "--out", &out]);
        let text = std::fs::read_to_string(&out).unwrap();
        let centre = if format == "colmap" { "25.0" } else { "24.5" };
        for part in [first, second, "62", centre] {
            assert!(text.contains(part), "{format}: {part} is missing in {text}");
        }
        // Only OpenCV's format takes pieces of any kind.
        let warned = stderr(&output).contains("warning: ") && stderr(&output).contains("projective");
        assert_eq!(warned, format != "opencv", "{}", stderr(&output));
    }
    assert_eq!(folder.names("new"), ["colmap", "kalibr", "mrcal", "opencv", "ros"]);
}

/// A camera file of one program becomes that of another; what it does not say is asked for.
#[test]
fn exports_camera_files() {
    let folder = Folder::new();
    let matrix = "[525.0, 0.0, 319.5, 0.0, 525.0, 239.5, 0.0, 0.0, 1.0]";
    let stereo = format!("M1: {matrix}\nD1: [0.12, -0.25, 0.001, -0.002]\nM2: {matrix}\nD2: [0.0, 0.0, 0.0, 0.0]\n");
    folder.write("stereo.yml", stereo);
    folder.write("bare.json", format!("{{\"K\": {matrix}, \"lens\": [0.1]}}"));
    let [stereo, first, out] = ["stereo.yml", "stereo.yml#M1", "cameras.txt"].map(|name| folder.arg(name));
    let colmap = |file: &str, more: &[&str]| {
        let arguments = ["export", file, "--format", "colmap", "--out", &out];
        support::command(arguments.iter().chain(more)).output().unwrap()
    };
    let refused = |file: &str, more: &[&str], part: &str| {
        let output = colmap(file, more);
        assert_eq!(output.status.code(), Some(1));
        assert!(stderr(&output).contains(part), "{}", stderr(&output));
    };
    refused(&stereo, &[], "stereo.yml#NAME with one of M1, M2");
    refused(&first, &[], "give --size, such as --size 640x480");
    refused(&folder.arg("bare.json"), &[], "no lens is recognised beside `K`, only the keys K, lens");
    let output = colmap(&first, &["--size", "640x480"]);
    assert!(output.status.success() && !stderr(&output).contains("warning"), "{}", stderr(&output));
    let text = std::fs::read_to_string(&out).unwrap();
    assert!(text.ends_with("1 OPENCV 640 480 525.0 525.0 320.0 240.0 0.12 -0.25 0.001 -0.002\n"), "{text}");
    let json = folder.arg("camera.json");
    succeeds(["export", &out, "--format", "opencv-json", "--out", &json]);
    succeeds(["export", &json, "--format", "colmap", "--out", &out]);
    assert_eq!(std::fs::read_to_string(&out).unwrap(), text);
}

/// dx x + dy y + dz at a pixel, 1/mm: what `CALIBRATION` adds to inverse depth there.
fn a(index: usize) -> f64 {
    let [fx, fy, cx, cy] = PINHOLE;
    let [dx, dy, dz, _] = D;
    dx * ((index % WIDTH) as f64 - cx) / fx + dy * ((index / WIDTH) as f64 - cy) / fy + dz
}

fn measured(index: usize, z: f64) -> f64 {
    1.0 / (a(index) + D[3] / z)
}

fn corrected(index: usize, z: f64) -> f64 {
    D[3] / (1.0 / z - a(index))
}

/// A tilted wall with a hole, as the camera measures it, in steps of `unit` mm; and its true depth.
fn wall(unit: f64, far: f64) -> (DepthImage, Vec<f64>) {
    let truth: Vec<f64> = (0..WIDTH * HEIGHT).map(|i| far + 3.0 * (i % WIDTH) as f64 + (i / WIDTH) as f64).collect();
    let mut image = depth(0);
    for (i, z) in truth.iter().enumerate().skip(5) {
        image.data[i] = (measured(i, *z) / unit).round() as u16;
    }
    (image, truth)
}

#[test]
fn apply_removes_a_known_error_within_rounding() {
    let folder = Folder::new();
    let unit = 0.25;
    folder.write("calibration.json", calibration_with_unit(unit));
    let mut truths = BTreeMap::new();
    for (name, far) in [("near", 400.0), ("far.away", 2500.0)] {
        let (image, truth) = wall(unit, far);
        write_depth(folder.path(&format!("depth/{name}.png")), &image).unwrap();
        truths.insert(format!("{name}.png"), (image, truth));
    }
    let amplitude = |i: usize| 100 + i as u16;
    let image = GrayImage { data: (0..WIDTH * HEIGHT).map(amplitude).collect(), ..support::gray(0) };
    write_gray(folder.path("ir/near.png"), &image).unwrap();
    write_gray(folder.path("ir/far.away.png"), &image).unwrap();

    let (calibration, out) = (folder.arg("calibration.json"), folder.arg("out"));
    let images = folder.arg("ir");
    let output = succeeds(["apply", &calibration, &folder.arg("depth"), "--out", &out, "--cloud", "--image", &images]);
    let pixels = WIDTH * HEIGHT;
    let expected = format!("2 frames: {} pixels corrected, 10 without depth", 2 * (pixels - 5));
    assert!(stdout(&output).contains(&expected), "{}", stdout(&output));
    assert_eq!(stderr(&output), "");
    assert_eq!(folder.names("out"), ["far.away.ply", "far.away.png", "near.ply", "near.png"]);
    for (name, (input, truth)) in &truths {
        let image = read_depth(folder.path("out").join(name)).unwrap();
        assert_eq!(image.data[..5], [0; 5]);
        for i in 5..pixels {
            let z = f64::from(image.data[i]) * unit;
            let read = corrected(i, f64::from(input.data[i]) * unit);
            // Half a step, and the thousandth that f32 may be off.
            assert!((z - read).abs() <= 0.501 * unit, "{name} {i}: {z} {read}");
            // Half a step of the measured depth, as the model magnifies it, and half a step of the corrected one.
            let slope = D[3] / (1.0 - a(i) * measured(i, truth[i])).powi(2);
            assert!((z - truth[i]).abs() <= (0.51 * slope + 0.5) * unit, "{name} {i}: {z} {}", truth[i]);
        }
        let points = read_cloud(&folder.path("out").join(name).with_extension("ply"));
        assert_eq!(points.len(), pixels - 5);
        for (i, [x, y, z, intensity]) in (5..pixels).zip(points) {
            let expected = corrected(i, f64::from(input.data[i]) * unit);
            assert!((z - expected).abs() < 0.01, "{z} {expected}");
            let [fx, fy, cx, cy] = PINHOLE;
            assert!((x / z * fx + cx - (i % WIDTH) as f64).abs() < 1e-3);
            assert!((y / z * fy + cy - (i / WIDTH) as f64).abs() < 1e-3);
            assert_eq!(intensity, f64::from(amplitude(i)));
        }
    }

    // One file, another unit, no image.
    let out = folder.arg("single");
    succeeds(["apply", &calibration, &folder.arg("depth/near.png"), "--out", &out, "--unit-mm", "1", "--cloud"]);
    let image = read_depth(folder.path("single/near.png")).unwrap();
    let expected = corrected(700, f64::from(truths["near.png"].0.data[700]));
    assert_eq!(image.data[700], expected.round() as u16);
    assert_eq!(folder.names("single"), ["near.ply", "near.png"]);
}

/// x, y, z and the intensity of a binary PLY.
fn read_cloud(path: &Path) -> Vec<[f64; 4]> {
    let bytes = std::fs::read(path).unwrap();
    let end = b"end_header\n";
    let start = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    assert!(String::from_utf8_lossy(&bytes[..start]).contains("property float intensity"));
    let number = |b: &[u8]| f64::from(f32::from_le_bytes(b.try_into().unwrap()));
    bytes[start..].chunks_exact(16).map(|p| std::array::from_fn(|i| number(&p[4 * i..4 * i + 4]))).collect()
}

#[test]
fn apply_takes_unit_and_time_from_a_dataset() {
    let folder = Folder::dataset(&[BOARD, FRAMES, "metadata = \"frames.csv\"\n", "[depth]\nunit_mm = 2.0\n"]);
    folder.write("data/frames.csv", "frame,timestamp_s\n0,5000\n1,5100\n2,5200\n3,5600\n");
    // ρ_m = a + dw ρ, then ρ_m (1 + s g) with g = 1 − exp(−t / 100 s).
    let drift = r#"{ "hook": "depth", "name": "temporal_drift", "options": { "tau_s": 100.0 }, "parameters": [
        { "name": "s", "unit": "1", "value": 0.05, "fixed": false },
        { "name": "o", "unit": "1/mm", "value": 0.0, "fixed": false } ] }"#;
    folder.write("calibration.json", calibration_with(drift));
    let (calibration, out) = (folder.arg("calibration.json"), folder.arg("out"));
    let output = succeeds(["apply", &calibration, &folder.arg("data"), "--out", &out]);
    assert_eq!(stderr(&output), "");
    for (name, seconds) in [("0", 0.0), ("1", 100.0), ("2", 200.0), ("3", 600.0f64)] {
        let image = read_depth(folder.path(&format!("out/{name}.png"))).unwrap();
        let settled = 1.0 - (-seconds / 100.0).exp();
        for i in (0..WIDTH * HEIGHT).step_by(11) {
            let steps = corrected(i, 2000.0 * (1.0 + 0.05 * settled)) / 2.0;
            assert!((f64::from(image.data[i]) - steps).abs() <= 0.5 + 1e-6, "{name} {i}");
        }
    }
    // Loose files have no time: what depends on it is not corrected, which is said.
    let loose = folder.arg("data/depth");
    let output = succeeds(["apply", &calibration, &loose, "--unit-mm", "2", "--out", &folder.arg("loose")]);
    assert!(stderr(&output).contains("time") && stderr(&output).contains("timestamp_s"), "{}", stderr(&output));
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let inside = support::names(folder).into_iter().map(|name| folder.join(name));
    inside.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

#[test]
fn simulated_datasets_are_valid_and_do_not_tell_the_effect() {
    let folder = Folder::new();
    let truth = folder.arg("truth.json");
    let simulate = |out: &str, more: &[&str]| {
        let fixed = ["simulate", "--camera", "2", "--kind", "centered1", "--seed", "7", "--frames", "2"];
        succeeds(fixed.iter().chain(["--out", out].iter()).chain(more))
    };
    let effects = ["--effect", "cyclic_depth=4", "--effect", "thin_prism"];
    simulate(&folder.arg("one"), &[&effects[..], &["--truth", &truth]].concat());
    assert_eq!(folder.names("one"), ["dataset.toml", "depth", "frames.csv", "image"]);
    let dataset = Dataset::open(folder.path("one")).unwrap().into_only_camera().unwrap();
    assert_eq!(dataset.frames.len(), 2);
    assert!(dataset.frames.iter().all(|f| f.image.is_some() && f.metadata.temperature_c.is_some()));
    assert_eq!(dataset.camera, None);
    let image = read_depth(dataset.frames[0].depth.as_ref().unwrap()).unwrap();
    assert_eq!((image.width, image.height), (640, 480));

    let told: Truth = read_json(&truth).unwrap();
    let names: Vec<_> = told.effects.iter().map(|e| (e.name.as_str(), e.size)).collect();
    assert_eq!(names[0], ("cyclic_depth", 4.0));
    assert_eq!((names[1].0, names.len()), ("thin_prism", 2));
    for path in files(&folder.path("one")) {
        let bytes = std::fs::read(&path).unwrap();
        for word in ["cyclic", "prism", "effect", "truth"] {
            assert!(!bytes.windows(word.len()).any(|w| w == word.as_bytes()), "{}: {word}", path.display());
            assert!(!path.strip_prefix(folder.path("one")).unwrap().to_str().unwrap().contains(word));
        }
    }

    // The same seed gives the same bytes; without the effect the depth differs.
    simulate(&folder.arg("two"), &effects);
    simulate(&folder.arg("clean"), &["--effect", "none"]);
    let contents = |name: &str| -> Vec<Vec<u8>> {
        files(&folder.path(name)).iter().map(|path| std::fs::read(path).unwrap()).collect()
    };
    assert!(contents("one") == contents("two"));
    let depth_of = |name: &str| std::fs::read(folder.path(&format!("{name}/depth/0000.png"))).unwrap();
    assert!(depth_of("one") != depth_of("clean"));
}
