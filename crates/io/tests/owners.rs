//! Camera files against the programs that own the formats: `cv2.FileStorage` and mrcal, where Python has them, and mrcal's
//! projections. `DEPTHCAL_PYTHON` names the interpreter, `python3` where it is not set. Without these modules the tests say that
//! they are skipped.

use std::io::Write;
use std::process::{Command, Stdio};

use depthcal_io::{CameraFormat, ExportCamera, read_camera};
use depthcal_model::{Camera, Register};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};

/// Output of a Python program; `None`, with a message, where its modules are missing.
fn python(test: &str, modules: &str, program: &str, input: &str) -> Option<String> {
    let interpreter = std::env::var("DEPTHCAL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let run = |program: &str| {
        let mut command = Command::new(&interpreter);
        command.args(["-c", program]).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().ok()?;
        child.stdin.take()?.write_all(input.as_bytes()).ok();
        child.wait_with_output().ok()
    };
    if !run(&format!("import {modules}")).is_some_and(|output| output.status.success()) {
        eprintln!("SKIPPED: {test}: {interpreter} has no {modules}");
        return None;
    }
    let output = run(program).unwrap();
    assert!(output.status.success(), "{test}: {}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap())
}

const PINHOLE: [f64; 5] = [476.9, 475.1, 312.9, 242.5, 0.0];
const COEFFICIENTS: [f64; 14] =
    [-0.1, 0.05, 1e-3, -2e-3, 0.02, 0.05, -0.03, 0.01, 1e-3, -5e-4, 2e-3, 3e-4, 0.02, -0.03];
const FISHEYE: [f64; 4] = [0.03, -0.01, 0.004, -0.001];
const CAHVOR: [f64; 5] = [0.01, -0.02, 0.003, -0.1, 0.02];

fn camera(piece: &str, values: &[f64]) -> Camera {
    let mut block = Register::builtin().block(piece, None).unwrap();
    block.theta[..values.len()].copy_from_slice(values);
    Camera::new(640, 480, PINHOLE, vec![block])
}

/// Largest distance over the image between the pixels of two cameras, px.
fn error_px(a: &Camera, b: &Camera) -> f64 {
    let (rays, pixels) = a.rays_over_image(41, 31);
    assert!(rays.len() > 1200);
    let error = |(r, p): (&[f64; 2], &[f64; 2])| {
        let [u, v] = b.project(&Vector3::new(r[0], r[1], 1.0)).unwrap();
        (u - p[0]).hypot(v - p[1])
    };
    rays.iter().zip(&pixels).map(error).fold(0.0, f64::max)
}

/// OpenCV reads what is written and writes it again; that is read here.
#[test]
fn opencv_reads_and_writes_the_same_camera() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        ("brown_conrady", &COEFFICIENTS[..5]),
        ("opencv_lens", &COEFFICIENTS[..8]),
        ("opencv_lens", &COEFFICIENTS[..12]),
        ("opencv_lens", &COEFFICIENTS[..]),
        ("kannala_brandt", &FISHEYE[..]),
    ];
    let formats = [(CameraFormat::OpenCv, "yml"), (CameraFormat::OpenCvXml, "xml"), (CameraFormat::OpenCvJson, "json")];
    for ((piece, values), (format, ending)) in cases.into_iter().flat_map(|case| formats.map(|format| (case, format))) {
        let camera = camera(piece, values);
        let path = |name: &str| folder.path().join(format!("{name}_{piece}{}.{ending}", values.len()));
        let [ours, theirs] = ["ours", "theirs"].map(path);
        let export = ExportCamera { camera: camera.clone(), depth: Vec::new() }.export(format).unwrap();
        assert!(export.warnings.is_empty());
        std::fs::write(&ours, export.text).unwrap();
        let program = format!(
            "import cv2\nf = cv2.FileStorage({ours:?}, cv2.FILE_STORAGE_READ)\ng = cv2.FileStorage({theirs:?}, cv2.FILE_STORAGE_WRITE)\n\
             for k in ('image_width', 'image_height', 'fisheye_model'):\n    g.write(k, int(f.getNode(k).real()))\n\
             for k in ('camera_matrix', 'distortion_coefficients'):\n    g.write(k, f.getNode(k).mat())\ng.release()\n"
        );
        if python("FileStorage", "cv2", &program, "").is_none() {
            return;
        }
        let read = read_camera(&theirs).unwrap();
        assert_eq!(read.size, Some([640, 480]));
        let error = error_px(&camera, &read.camera([0, 0], &Register::builtin()).unwrap());
        assert!(error < 1e-6, "{piece}, {ending}: {error:e} px");
    }
}

/// mrcal reads what is written and writes it again; and projects ten thousand random points as the pieces do.
#[test]
fn mrcal_reads_writes_and_projects_the_same_camera() {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(21);
    let point = |_| {
        let (angle, azimuth) =
            (rng.random_range(0.0..40.0_f64).to_radians(), rng.random_range(0.0..std::f64::consts::TAU));
        let z: f64 = rng.random_range(100.0..5000.0);
        [z * angle.tan() * azimuth.cos(), z * angle.tan() * azimuth.sin(), z]
    };
    let points: Vec<[f64; 3]> = (0..10_000).map(point).collect();
    let input: String = points.iter().map(|p| format!("{:?} {:?} {:?}\n", p[0], p[1], p[2])).collect();
    let cases = [
        ("brown_conrady", &COEFFICIENTS[..5]),
        ("opencv_lens", &COEFFICIENTS[..8]),
        ("opencv_lens", &COEFFICIENTS[..12]),
        ("cahvor", &CAHVOR[..]),
    ];
    for (i, (piece, values)) in cases.into_iter().enumerate() {
        let camera = camera(piece, values);
        let [ours, theirs] = ["ours", "theirs"].map(|name| folder.path().join(format!("{name}{i}.cameramodel")));
        let export = ExportCamera { camera: camera.clone(), depth: Vec::new() }.export(CameraFormat::Mrcal).unwrap();
        assert!(export.warnings.is_empty());
        std::fs::write(&ours, export.text).unwrap();
        let program = format!(
            "import sys, numpy, mrcal\nm = mrcal.cameramodel({ours:?})\nm.write({theirs:?})\n\
             p = numpy.loadtxt(sys.stdin)\nfor q in mrcal.project(p, *m.intrinsics()):\n    print(repr(float(q[0])), repr(float(q[1])))\n"
        );
        let Some(output) = python("mrcal", "mrcal, numpy", &program, &input) else { return };
        let error = error_px(&camera, &read_camera(&theirs).unwrap().camera([0, 0], &Register::builtin()).unwrap());
        assert!(error < 1e-6, "{piece}: {error:e} px");
        let mut compared = 0;
        for (p, line) in points.iter().zip(output.lines()) {
            let theirs: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
            let Some([u, v]) = camera.project(&Vector3::from(*p)) else { continue };
            let error = (u - theirs[0]).hypot(v - theirs[1]);
            assert!(error <= 1e-9, "{piece}: {error:e} px at {p:?}");
            compared += 1;
        }
        assert!(compared > 9000, "{piece}: {compared} points");
    }
}
