//! Recall, accuracy and time (of one core) of the built-in detector and of OpenCV on rendered boards and on measured captures, as
//! a Markdown table.
//!
//!     cargo run --release -p depthcal-studies --features opencv --bin detectors [FRAMES]
//!
//! FRAMES is the number of rendered frames per row, 40 by default. Measured captures are looked for in `DEPTHCAL_DATA`. Without
//! the feature `opencv` there are no columns of OpenCV.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]
#![allow(
    unexpected_cfgs,
    reason = "what it shares with tests of depthcal-detect asks for the configuration of that crate"
)]

#[path = "../../../crates/detect/tests/common/mod.rs"]
mod common;
#[cfg(feature = "opencv")]
#[path = "../../../crates/detect/tests/common/opencv_circles.rs"]
mod opencv_circles;

use common::{Camera, Pose, Scene, Style, Texture};
use depthcal_detect::{BoardMap, DetectOptions, Detection, Detector, detect};
use depthcal_io::GrayImage;
use depthcal_model::target::Target;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A row of the table: distances and tilts of the board, blur and noise of the image.
struct Condition {
    name: &'static str,
    /// Range of the distance at which the board's longer side spans so many px.
    span_px: [f64; 2],
    tilt_deg: [f64; 2],
    blur_px: f64,
    noise: f64,
}

const CONDITIONS: [Condition; 6] = [
    Condition { name: "near", span_px: [320.0, 500.0], tilt_deg: [0.0, 30.0], blur_px: 0.7, noise: 0.015 },
    Condition { name: "far", span_px: [170.0, 260.0], tilt_deg: [0.0, 30.0], blur_px: 0.7, noise: 0.015 },
    Condition { name: "very far", span_px: [110.0, 170.0], tilt_deg: [0.0, 30.0], blur_px: 0.7, noise: 0.015 },
    Condition { name: "tilted", span_px: [300.0, 450.0], tilt_deg: [45.0, 65.0], blur_px: 0.7, noise: 0.015 },
    Condition { name: "blurred", span_px: [320.0, 500.0], tilt_deg: [0.0, 30.0], blur_px: 2.5, noise: 0.015 },
    Condition { name: "noisy", span_px: [320.0, 500.0], tilt_deg: [0.0, 30.0], blur_px: 0.7, noise: 0.08 },
];

fn boards() -> Vec<(&'static str, Target, Texture)> {
    let plain = |target: Target, margin: f64| Texture::new(target, margin);
    let asymmetric = common::asymmetric(4, 11, 17.0, 11.5);
    let symmetric = common::symmetric(8, 5, 25.0, 12.5);
    let chessboard = common::chessboard(9, 6, 25.0);
    let charuco = common::charuco(9, 6, 28.0, 21.0, "DICT_5X5_250");
    let small = common::charuco(12, 9, 20.0, 15.0, "DICT_4X4_250");
    let tags = common::aprilgrid(6, 5, 32.0, 24.0);
    let legacy = Style { legacy: true, ..Style::default() };
    let kalibr = Style { kalibr: true, ..Style::default() };
    vec![
        ("asymmetric circles 4 x 11", asymmetric.clone(), plain(asymmetric, 17.0)),
        ("symmetric circles 8 x 5", symmetric.clone(), plain(symmetric, 25.0)),
        ("chessboard 9 x 6", chessboard.clone(), plain(chessboard, 10.0)),
        ("ChArUco 9 x 6", charuco.clone(), Texture::with_tags(charuco.clone(), 8.0, Style::default())),
        ("ChArUco 9 x 6, legacy", charuco.clone(), Texture::with_tags(charuco, 8.0, legacy)),
        ("ChArUco 12 x 9", small.clone(), Texture::with_tags(small, 8.0, Style::default())),
        ("AprilGrid 6 x 5", tags.clone(), Texture::with_tags(tags.clone(), 8.0, Style::default())),
        ("AprilGrid 6 x 5, Kalibr", tags.clone(), Texture::with_tags(tags, 8.0, kalibr)),
    ]
}

/// A pose with the whole board in the image.
fn pose(camera: &Camera, target: &Target, condition: &Condition, rng: &mut ChaCha8Rng) -> Pose {
    let extent = target.points().into_iter().fold([0.0f64; 2], |e, p| [e[0].max(p[0]), e[1].max(p[1])]);
    let middle = extent.map(|e| e / 2.0);
    let turn = std::f64::consts::TAU;
    loop {
        let span = rng.random_range(condition.span_px[0]..condition.span_px[1]);
        let z = camera.f * extent[0].max(extent[1]) / span;
        let tilt = rng.random_range(condition.tilt_deg[0]..condition.tilt_deg[1]).to_radians();
        let pixel = [rng.random_range(0.0..camera.width as f64), rng.random_range(0.0..camera.height as f64)];
        let roll = rng.random_range(0.0..turn);
        let pose = Pose::looking(camera, middle, pixel, z, tilt, rng.random_range(0.0..turn), roll);
        let border = 0.1 * extent[0].max(extent[1]);
        let corners = [
            [-border, -border],
            [extent[0] + border, -border],
            [extent[0] + border, extent[1] + border],
            [-border, extent[1] + border],
        ];
        let inside = corners.iter().all(|&p| {
            let x = pose.apply(p);
            let [u, v] = camera.project(x);
            x.z > 50.0 && u > 3.0 && v > 3.0 && u < camera.width as f64 - 4.0 && v < camera.height as f64 - 4.0
        });
        if inside {
            return pose;
        }
    }
}

/// Counts and errors of a detector over frames.
#[derive(Default)]
struct Score {
    frames: usize,
    found: usize,
    markers: usize,
    expected: usize,
    wrong: usize,
    errors: Vec<f64>,
    seconds: f64,
}

impl Score {
    fn add(&mut self, detection: Option<Detection>, seconds: f64, target: &Target, truth: impl Fn(usize) -> [f64; 2]) {
        self.frames += 1;
        self.expected += target.len();
        self.seconds += seconds;
        let Some(detection) = detection else { return };
        self.found += 1;
        self.markers += detection.markers.len();
        // Boards that look the same after half a turn may be labelled either way.
        let distances = |index: &dyn Fn(usize) -> usize| -> Vec<f64> {
            let markers = detection.markers.iter();
            let all = markers.map(|m| (m.pixel, truth(index(m.index))));
            all.map(|(p, t)| (p[0] - t[0]).hypot(p[1] - t[1])).collect()
        };
        let (plain, turned) = (distances(&|i| i), distances(&|i| target.len() - 1 - i));
        let best =
            if common::rms(plain.iter().copied()) <= common::rms(turned.iter().copied()) { plain } else { turned };
        self.wrong += best.iter().filter(|e| **e > 2.0).count();
        self.errors.extend(best.into_iter().filter(|e| *e <= 2.0));
    }

    fn columns(&self) -> String {
        let percent = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
        let wrong = if self.wrong > 0 { format!(" ({} wrong)", self.wrong) } else { String::new() };
        format!(
            " {:.0} % | {:.1} %{wrong} | {:.4} | {:.1} ",
            percent(self.found, self.frames),
            percent(self.markers, self.expected),
            common::rms(self.errors.iter().copied()) / 2f64.sqrt(),
            1e3 * self.seconds / self.frames.max(1) as f64
        )
    }
}

/// Time that this thread has had a core for, s: other programs do not count.
fn cpu_seconds() -> f64 {
    let statistics = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    statistics.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).expect("nanoseconds") * 1e-9
}

fn timed(image: &GrayImage, target: &Target, detector: Detector) -> (Option<Detection>, f64) {
    let options = DetectOptions { detector, ..DetectOptions::default() };
    let start = cpu_seconds();
    #[cfg(feature = "opencv")]
    if detector == Detector::OpenCv && target.has_circles() {
        let detection = opencv_circles::find(image, target);
        return (detection, cpu_seconds() - start);
    }
    let detection = detect(image, target, &options).expect("no error");
    (detection, cpu_seconds() - start)
}

fn detectors() -> Vec<Detector> {
    let mut all = vec![Detector::BuiltIn];
    if cfg!(feature = "opencv") {
        all.push(Detector::OpenCv);
    }
    all
}

fn rendered(frames: u64) {
    let names = ["built-in", "OpenCV"];
    let heads: String =
        detectors().iter().zip(names).map(|(_, n)| format!(" {n}: found | markers | rms px | ms |")).collect();
    println!("| board | views |{heads}\n|---|---|{}", "---|---|---|---|".repeat(detectors().len()));
    // The lens of the thesis folds in the corners of the image.
    let camera = Camera { lens: [-0.05, 0.01, 0.0005, -0.0005, 0.0], ..Camera::thesis() };
    for (name, target, texture) in boards() {
        for (number, condition) in CONDITIONS.iter().enumerate() {
            let mut scores: Vec<Score> = detectors().iter().map(|_| Score::default()).collect();
            for seed in 0..frames {
                let mut rng = ChaCha8Rng::seed_from_u64(1000 * number as u64 + seed);
                let pose = pose(&camera, &target, condition, &mut rng);
                let mut scene = Scene::new(camera, pose, &texture, seed);
                (scene.blur, scene.noise) = (condition.blur_px, condition.noise);
                let image = scene.render();
                for (score, detector) in scores.iter_mut().zip(detectors()) {
                    let (detection, seconds) = timed(&image, &target, detector);
                    score.add(detection, seconds, &target, |i| scene.truth(target.point(i)));
                }
            }
            let columns: Vec<String> = scores.iter().map(Score::columns).collect();
            println!("| {name} | {} |{}|", condition.name, columns.join("|"));
        }
    }
}

/// Frames with the board, markers in all, median over the frames of the rms distance of the markers from a smooth map of the
/// board (a homography and a cubic), per coordinate, and time.
fn measured() {
    println!(
        "\n| capture | frames | detector | found | markers | rms px from a smooth map | ms |\n|---|---|---|---|---|---|---|"
    );
    for name in [
        "chessboard",
        "kinect2",
        "truedepth/iphone11pro/calib",
        "truedepth/iphone11pro/check",
        "truedepth/ipad4/calib",
        "truedepth/ipad4/check",
    ] {
        let Some(capture) = common::measured::capture(name) else { continue };
        for detector in detectors() {
            let (mut boards, mut markers, mut seconds, mut rms) = (0, 0, 0.0, Vec::new());
            for (frame, image) in &capture.frames {
                let (detection, time) = timed(image, &capture.target, detector);
                seconds += time;
                let count = detection.as_ref().map_or(0, |d| d.markers.len());
                if std::env::var_os("FRAMES").is_some() {
                    eprintln!("{name} {frame} {detector:?} {count} {:.1} ms", 1e3 * time);
                }
                let Some(detection) = detection else { continue };
                boards += 1;
                markers += count;
                let pairs: Vec<_> =
                    detection.markers.iter().map(|m| (capture.target.point(m.index), m.pixel)).collect();
                if pairs.len() > 30
                    && let Some(map) = BoardMap::fit(&pairs)
                {
                    rms.push(map.rms_px() / 2f64.sqrt());
                }
            }
            rms.sort_by(f64::total_cmp);
            let median = rms.get(rms.len() / 2).copied().unwrap_or(f64::NAN);
            println!(
                "| {name} | {} | {} | {boards} | {markers} | {median:.4} | {:.0} |",
                capture.frames.len(),
                if detector == Detector::BuiltIn { "built-in" } else { "OpenCV" },
                1e3 * seconds / capture.frames.len() as f64
            );
        }
    }
}

fn main() {
    #[cfg(feature = "opencv")]
    opencv::core::set_num_threads(1).expect("OpenCV");
    let frames = std::env::args().nth(1).map_or(40, |text| text.parse().expect("a number of frames"));
    if frames > 0 {
        rendered(frames);
    }
    measured();
}
