//! `apply` on streams, and its runs that are interrupted.

use std::process::Output;

use crate::support::{
    self, CALIBRATION, D, Folder, HEIGHT, PINHOLE, WIDTH, fails, run_with_input, stderr, stdout, succeeds,
};
use depthcal::io::{DepthImage, DepthValues, read_depth, read_depth_frame, write_depth};

const PIXELS: usize = WIDTH * HEIGHT;

fn corrected(index: usize, z: f64) -> f64 {
    let [fx, fy, cx, cy] = PINHOLE;
    let (x, y) = (((index % WIDTH) as f64 - cx) / fx, ((index / WIDTH) as f64 - cy) / fy);
    D[3] / (1.0 / z - (D[0] * x + D[1] * y + D[2]))
}

/// Runs `apply CALIBRATION -` on the bytes.
fn stream(folder: &Folder, input: &[u8], more: &[&str]) -> Output {
    let calibration = folder.arg("calibration.json");
    run_with_input([&["apply", calibration.as_str(), "-"][..], more].concat(), input)
}

fn frames(count: usize) -> Vec<u16> {
    (0..count * PIXELS).map(|i| if i % 97 == 0 { 0 } else { 500 + (i * 7 % 1500) as u16 }).collect()
}

#[test]
fn a_stream_is_corrected_frame_by_frame() {
    let folder = Folder::new();
    folder.write("calibration.json", CALIBRATION);
    let measured = frames(5);
    let bytes: Vec<u8> = measured.iter().flat_map(|z| z.to_le_bytes()).collect();
    let output = stream(&folder, &bytes, &["--unit-mm", "2", "--stream-output", "u16", "--stream-size", "64x48"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("5 frames"), "{}", stderr(&output));
    let steps: Vec<u16> = output.stdout.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b)).collect();
    assert_eq!(steps.len(), measured.len());
    for (i, (z, m)) in steps.iter().zip(&measured).enumerate() {
        let expected = corrected(i % PIXELS, 2.0 * f64::from(*m)) / 2.0;
        assert!(if *m == 0 { *z == 0 } else { (f64::from(*z) - expected).abs() <= 0.501 }, "{i}: {z} {expected}");
    }

    let f32_bytes: Vec<u8> = measured.iter().flat_map(|z| (f32::from(*z) * 2.0).to_le_bytes()).collect();
    let of_steps = stream(&folder, &bytes, &["--unit-mm", "2", "--stream-output", "xyz"]);
    let of_f32 = stream(&folder, &f32_bytes, &["--stream-input", "f32", "--stream-output", "xyz"]);
    assert!(of_steps.status.success() && of_f32.status.success(), "{}", stderr(&of_f32));
    for output in [of_steps, of_f32] {
        let points: Vec<f32> = output.stdout.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        assert_eq!(points.len(), 3 * measured.len());
        for (i, m) in measured.iter().enumerate() {
            let z = points[3 * i + 2];
            let expected = corrected(i % PIXELS, 2.0 * f64::from(*m));
            assert!(if *m == 0 { z.is_nan() } else { (f64::from(z) - expected).abs() < 0.01 }, "{i}: {z} {expected}");
        }
    }
    let back = stream(&folder, &f32_bytes, &["--unit-mm", "2", "--stream-input", "f32", "--stream-output", "u16"]);
    let again: Vec<u16> = back.stdout.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b)).collect();
    // Rounded from f32 here, from f64 there.
    assert!(again.len() == steps.len() && again.iter().zip(&steps).all(|(a, b)| a.abs_diff(*b) <= 1));
}

#[test]
fn faults_of_a_stream_are_named() {
    let folder = Folder::new();
    folder.write("calibration.json", CALIBRATION);
    let bytes: Vec<u8> = frames(2).iter().flat_map(|z| z.to_le_bytes()).collect();
    let cases: [(&[u8], &[&str], &[&str]); 5] = [
        (
            &bytes[..bytes.len() - 3],
            &["--unit-mm", "1", "--stream-output", "u16"],
            &["standard input", "after 1 frame of"],
        ),
        (&bytes, &["--stream-output", "u16"], &["depth unit", "--unit-mm"]),
        (&bytes, &["--unit-mm", "1", "--stream-output", "u16", "--stream-size", "48x64"], &["48x64", "64x48"]),
        (&bytes, &["--unit-mm", "1", "--stream-output", "u16", "--stream-fps", "0"], &["--stream-fps", "per second"]),
        (&bytes, &["--unit-mm", "1", "--stream-output", "u16", "--cloud"], &["--cloud"]),
    ];
    for (input, arguments, parts) in cases {
        let output = stream(&folder, input, arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        let message = stderr(&output);
        assert!(parts.iter().all(|part| message.contains(part)), "{arguments:?}: {message}");
    }
    assert!(stream(&folder, &[], &["--unit-mm", "1", "--stream-output", "u16"]).status.success());
}

#[test]
fn an_interrupted_run_goes_on_where_it_ended() {
    let folder = Folder::new();
    folder.write("calibration.json", CALIBRATION);
    for name in ["a", "b", "c"] {
        let depth = DepthImage { width: WIDTH, height: HEIGHT, data: vec![1000; PIXELS] };
        write_depth(folder.path(&format!("depth/{name}.png")), &depth).unwrap();
    }
    let apply = |unit: &str| {
        let (calibration, depth, out) = (folder.arg("calibration.json"), folder.arg("depth"), folder.arg("out"));
        succeeds(["apply", &calibration, &depth, "--unit-mm", unit, "--out", &out])
    };
    assert!(stdout(&apply("1")).contains("3 frames"));
    assert_eq!(folder.names("out"), ["a.png", "b.png", "c.png"]);

    // As if it had been interrupted before c: a mark that another frame could not be written leaves the word of the run.
    std::fs::remove_file(folder.path("out/c.png")).unwrap();
    std::fs::create_dir(folder.path("out/c.png")).unwrap();
    std::fs::write(folder.path("out/c.png/in the way"), "").unwrap();
    let (calibration, depth, out) = (folder.arg("calibration.json"), folder.arg("depth"), folder.arg("out"));
    let interrupted = support::run(["apply", &calibration, &depth, "--unit-mm", "1", "--out", &out]);
    assert_eq!(interrupted.status.code(), Some(1));
    std::fs::remove_dir_all(folder.path("out/c.png")).unwrap();
    // Complete frames are kept, which the mark in one of them shows.
    let mark = DepthImage { width: WIDTH, height: HEIGHT, data: vec![7; PIXELS] };
    write_depth(folder.path("out/a.png"), &mark).unwrap();
    write_depth(folder.path("out/b.png"), &mark).unwrap();
    let text = stdout(&apply("1"));
    assert!(text.contains("2 of 3 frames were complete already") && text.contains("\n1 frame: "), "{text}");
    assert_eq!(read_depth(folder.path("out/a.png")).unwrap(), mark);
    assert_eq!(folder.names("out"), ["a.png", "b.png", "c.png"]);

    // A run that ended is not gone on with, nor one with other settings.
    assert!(!stdout(&apply("2")).contains("already"));
    assert_ne!(read_depth(folder.path("out/a.png")).unwrap(), mark);
}

/// The second run would mix its results with those of the first.
#[test]
fn two_runs_into_one_folder_do_not_mix() {
    let folder = Folder::new();
    folder.write("calibration.json", CALIBRATION);
    let depth = DepthImage { width: WIDTH, height: HEIGHT, data: vec![1000; PIXELS] };
    write_depth(folder.path("depth/a.png"), &depth).unwrap();
    // The list of a run that is alive is locked.
    folder.write("out/.depthcal-apply.journal", "");
    let list = std::fs::File::options().append(true).open(folder.path("out/.depthcal-apply.journal")).unwrap();
    list.lock().unwrap();
    let (calibration, depth, out) = (folder.arg("calibration.json"), folder.arg("depth"), folder.arg("out"));
    let arguments = ["apply", &calibration, &depth, "--unit-mm", "1", "--out", &out];
    support::fails(arguments, &["another run of apply", "wait for its end"]);
    assert_eq!(folder.names("out"), [".depthcal-apply.journal"]);
    drop(list);
    succeeds(arguments);
    assert_eq!(folder.names("out"), ["a.png"]);
}

/// Without a covariance σ is that of noise alone: b mm in measured depth, times the slope of the correction.
#[test]
fn uncertainty_and_support_lie_beside_the_corrected_images() {
    let folder = Folder::new();
    let with_noise = CALIBRATION.replace("\"pixel_sigma\"", "\"inverse_depth_sigma_b\": 2.0, \"pixel_sigma\"");
    assert_ne!(with_noise, CALIBRATION);
    folder.write("calibration.json", &with_noise);
    folder.write("without.json", CALIBRATION);
    let mut data = vec![1000; PIXELS];
    data[5] = 0;
    write_depth(folder.path("depth/a.png"), &DepthImage { width: WIDTH, height: HEIGHT, data }).unwrap();
    let (depth, out) = (folder.arg("depth"), folder.arg("out"));
    let further = ["--unit-mm", "1", "--out", out.as_str(), "--uncertainty", "--mask"];
    let refused = support::run([&["apply", &folder.arg("without.json"), &depth][..], &further].concat());
    assert_eq!(refused.status.code(), Some(1));
    assert!(stderr(&refused).contains("no noise of depth"), "{}", stderr(&refused));

    succeeds([&["apply", &folder.arg("calibration.json"), &depth][..], &further].concat());
    let sigma = depthcal::io::read_depth_frame(folder.path("out/sigma/a.tiff")).unwrap();
    let depthcal::io::DepthValues::Float(sigma) = sigma.values else { panic!("σ is floating-point") };
    let mask = depthcal::io::read_gray(folder.path("out/mask/a.png")).unwrap();
    for index in 0..PIXELS {
        if index == 5 {
            assert!(sigma[index].is_nan() && mask.data[index] == 0);
            continue;
        }
        let slope = (corrected(index, 1001.0) - corrected(index, 999.0)) / 2.0;
        assert!((f64::from(sigma[index]) / (2.0 * slope) - 1.0).abs() < 0.02, "{}: {slope}", sigma[index]);
        assert!(mask.data[index] > 0);
    }
}

/// Boards were seen at 0.6 and 1.2 m: depth far beyond is told, depth in metres that is taken for mm is refused.
#[test]
fn depth_beyond_the_boards_of_a_calibration_is_told() {
    let folder = Folder::new();
    let frame = |z: f64| {
        format!(
            r#"{{ "name": "{z}", "rotation": [1, 0, 0, 0], "translation_mm": [-90, -60, {z}], "reprojection_rms_px": 0.1 }}"#
        )
    };
    let frames = format!("\"frames\": [{}, {}]", frame(600.0), frame(1200.0));
    folder.write("calibration.json", CALIBRATION.replace("\"frames\": []", &frames));
    let apply = |name: &str, of_pixel: &dyn Fn(usize) -> u16| {
        let data = (0..PIXELS).map(of_pixel).collect();
        write_depth(folder.path(&format!("{name}/a.png")), &DepthImage { width: WIDTH, height: HEIGHT, data }).unwrap();
        let (depth, out) = (folder.arg(name), folder.arg("out"));
        support::run(["apply", &folder.arg("calibration.json"), &depth, "--unit-mm", "1", "--out", &out])
    };
    let within = apply("within", &|i| 600 + (i % 600) as u16);
    assert!(within.status.success() && !stderr(&within).contains("warning"), "{}", stderr(&within));
    let beyond = apply("beyond", &|i| if i % 4 == 0 { 4000 } else { 900 });
    let message = stderr(&beyond);
    assert!(beyond.status.success(), "{message}");
    for part in ["25.0 % of the pixels", "farther (25.0 %)", "extrapolates", "--mask"] {
        assert!(message.contains(part), "{message}");
    }
    let metres = apply("metres", &|i| 1 + (i % 2) as u16);
    assert_eq!(metres.status.code(), Some(1));
    let message = stderr(&metres);
    assert!(message.contains("metres") && message.contains("--unit-mm 1000"), "{message}");
}

/// The files of a camera whose dataset held disparities hold them, too: 1/z = a + b d.
#[test]
fn bare_files_of_a_disparity_camera_are_disparities() {
    let folder = Folder::new();
    let [a, b] = [3.1365e-3, -2.8736e-6];
    let record = CALIBRATION.replace("\"frames\": []", &format!("\"disparity\": [{a}, {b}], \"frames\": []"));
    folder.write("calibration.json", record);
    let disparities: Vec<u16> = (0..PIXELS).map(|i| if i % 97 == 0 { 2047 } else { 500 + (i % 400) as u16 }).collect();
    let raw = DepthImage { width: WIDTH, height: HEIGHT, data: disparities.clone() };
    write_depth(folder.path("raw/0001.png"), &raw).unwrap();
    let [calibration, depth, out] = ["calibration.json", "raw", "out"].map(|name| folder.arg(name));
    let apply = ["apply", &calibration, &depth, "--out", &out];
    succeeds([&apply[..], &["--format", "tiff"]].concat());
    let DepthValues::Float(mm) = read_depth_frame(folder.path("out/0001.tiff")).unwrap().values else {
        panic!("steps")
    };
    for (i, (z, d)) in mm.iter().zip(&disparities).enumerate() {
        let expected = corrected(i, 1.0 / (a + b * f64::from(*d)));
        assert!(if *d == 2047 { !(*z > 0.0) } else { (f64::from(*z) - expected).abs() < 0.01 }, "{i}: {z} {expected}");
    }
    fails(apply, &["PNG and PGM cannot hold", "--format tiff"]);
    fails([&apply[..], &["--format", "tiff", "--unit-mm", "1"]].concat(), &["disparities", "leave --unit-mm out"]);
    let stream = stream(&folder, &[], &["--unit-mm", "1", "--stream-output", "u16"]);
    assert_eq!(stream.status.code(), Some(1));
    assert!(stderr(&stream).contains("--stream-input f32"), "{}", stderr(&stream));
}
