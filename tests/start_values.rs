//! Start values: recovered where the captures determine them, refused with a reason where they do not.

use depthcal::calibration::observe::{CameraFrames, MarkerObservation};
use depthcal::calibration::simulated;
use depthcal::calibration::start::{FrameMarkers, StartError, estimate_pose, homography, start_values};
use depthcal::model::{Block, Camera, Register};
use depthcal_simulate::{CameraTruth, Kind, PointObservations, PointOptions, Pose, Simulation};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

fn exact() -> PointOptions {
    PointOptions { sigma_px: 0.0, depth_samples: 0, ..PointOptions::default() }
}

fn observe(simulation: &Simulation, options: &PointOptions) -> (PointObservations, CameraFrames) {
    let observed = simulation.observe_points(options).unwrap();
    let capture = simulated::capture(&observed);
    (observed, capture)
}

fn start(capture: &CameraFrames) -> Result<(Camera, Vec<Isometry3<f64>>), StartError> {
    let frames: Vec<FrameMarkers<'_>> =
        capture.frames.iter().map(|f| FrameMarkers { name: &f.name, markers: &f.markers }).collect();
    let register = Register::builtin();
    start_values(&capture.target, capture.width, capture.height, &frames, "brown_conrady", &register)
}

/// The true camera of the simulation, as the model has it.
fn true_camera(camera: &CameraTruth) -> Camera {
    let [fx, fy] = camera.focal_px;
    let [cx, cy] = camera.centre_px;
    let mut lens = Register::builtin().block("brown_conrady", None).unwrap();
    lens.theta.copy_from_slice(&camera.lens);
    Camera::from_blocks(camera.width, camera.height, Block::pinhole([fx, fy, cx, cy, camera.skew_px]), vec![lens])
}

fn isometry(pose: &Pose) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.matrix()));
    Isometry3::from_parts(Translation3::from(Vector3::from(pose.translation)), rotation)
}

/// Boards at given rotation vectors, 700 mm away.
fn posed(rotations: &[[f64; 3]]) -> Simulation {
    let pose = |(i, r): (usize, &[f64; 3])| {
        let m: Matrix3<f64> = Rotation3::from_scaled_axis(Vector3::from(*r)).into_inner();
        let shift = 12.0 * i as f64;
        Pose {
            rotation: [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)])),
            translation: [-100.0 + shift, -90.0 + shift, 700.0 + 10.0 * shift],
        }
    };
    let poses: Vec<Pose> = rotations.iter().enumerate().map(pose).collect();
    let camera = CameraTruth::ideal(640, 480, 480.0);
    Simulation::new(camera, Kind::General(1), &[], 1).frames(poses.len()).poses(poses)
}

#[test]
fn an_ideal_camera_is_recovered_exactly() {
    let camera = CameraTruth { lens: [0.0; 5], ..CameraTruth::published(1).unwrap() };
    let (_, capture) = observe(&Simulation::new(camera, Kind::General(1), &[], 3), &exact());
    let (started, poses) = start(&capture).unwrap();
    let [fx, fy, cx, cy, _] = started.pinhole();
    assert!((fx - camera.focal_px[0]).abs() < 1e-5 && (fy - camera.focal_px[1]).abs() < 1e-5, "{fx}, {fy}");
    assert!((cx - camera.centre_px[0]).abs() < 1e-5 && (cy - camera.centre_px[1]).abs() < 1e-5, "{cx}, {cy}");
    assert_eq!(poses.len(), capture.frames.len());
}

/// A lens that the closed form does not know moves its answer by some per cent, from where the adjustment converges.
#[test]
fn a_distorted_camera_starts_within_some_per_cent() {
    for number in 1..=4 {
        let camera = CameraTruth::published(number).unwrap();
        let (_, capture) = observe(&Simulation::new(camera, Kind::General(1), &[], 4), &PointOptions::default());
        let (started, _) = start(&capture).unwrap();
        let [fx, fy, ..] = started.pinhole();
        assert!(
            (fx / camera.focal_px[0] - 1.0).abs() < 0.1 && (fy / camera.focal_px[1] - 1.0).abs() < 0.1,
            "{fx}, {fy}"
        );
    }
}

/// Of a plane's two poses the right one is found, under the true camera, also with noise.
#[test]
fn poses_are_the_true_ones() {
    let camera = CameraTruth::published(1).unwrap();
    let (observed, capture) = observe(&Simulation::new(camera, Kind::General(1), &[], 5), &PointOptions::default());
    let model = true_camera(&camera);
    for (frame, truth) in capture.frames.iter().zip(&observed.truth.frames) {
        let markers = FrameMarkers { name: &frame.name, markers: &frame.markers };
        let fit = estimate_pose(&model, &capture.target, &markers).unwrap();
        let true_pose = isometry(&truth.pose);
        let angle = fit.camera_from_board.rotation.angle_to(&true_pose.rotation).to_degrees();
        assert!(angle < 1.0, "{}: {angle}°", frame.name);
        let shift = (fit.camera_from_board * Point3::origin() - true_pose * Point3::origin()).norm();
        assert!(shift < 5e-3 * truth.pose.translation[2], "{}: {shift} mm", frame.name);
        assert!(fit.rms_px < 0.12, "0.05 px of noise in each coordinate: {}", fit.rms_px);
    }
}

#[test]
fn homographies_map_markers_onto_their_pixels() {
    let (_, capture) = observe(&posed(&[[0.3, 0.2, 0.1], [0.6, -0.4, 1.0], [-0.5, 0.3, 3.0]]), &exact());
    for frame in &capture.frames {
        let h = homography(&capture.target, &FrameMarkers { name: &frame.name, markers: &frame.markers }).unwrap();
        for m in &frame.markers {
            let [x, y] = capture.target.point(m.index);
            let p = h * Vector3::new(x, y, 1.0);
            assert!((p.x / p.z - m.pixel[0]).hypot(p.y / p.z - m.pixel[1]) < 1e-8);
        }
    }
}

#[test]
fn too_few_frames_are_refused() {
    let (_, capture) = observe(&posed(&[[0.3, 0.2, 0.1]]), &exact());
    let error = start(&capture).unwrap_err();
    assert!(matches!(error, StartError::TooFewFrames { found: 1, needed: 3 }));
    assert!(error.to_string().contains("tilted"), "{error}");
}

#[test]
fn parallel_boards_are_refused_whether_frontal_or_tilted() {
    for r in [[0.0, 0.0, 0.0], [0.4, 0.3, 0.0]] {
        // Turned about their own normal, which keeps them parallel.
        let turned = |angle: f64| {
            let rotation =
                Rotation3::from_scaled_axis(Vector3::from(r)) * Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
            rotation.scaled_axis().into()
        };
        let (_, capture) =
            observe(&posed(&[turned(0.0), turned(0.3), turned(0.6), turned(-0.3)]), &PointOptions::default());
        let error = start(&capture).unwrap_err();
        assert!(matches!(error, StartError::ParallelBoards { frames: 4, .. }), "{error}");
        assert!(error.to_string().contains("20° to 45°"), "{error}");
    }
}

#[test]
fn collinear_and_too_few_markers_are_refused() {
    let (_, mut capture) = observe(&posed(&[[0.3, 0.2, 0.1], [-0.3, 0.4, 0.2], [0.2, -0.4, 0.1]]), &exact());
    let all = capture.frames[1].markers.clone();
    // The dots of one column of even rows lie on a line.
    let line = |m: &&MarkerObservation| m.index.is_multiple_of(8);
    capture.frames[1].markers = all.iter().filter(line).copied().collect();
    assert!(matches!(start(&capture).unwrap_err(), StartError::Collinear { frame } if frame == capture.frames[1].name));
    capture.frames[1].markers = all[..5].to_vec();
    assert!(matches!(start(&capture).unwrap_err(), StartError::TooFewMarkers { found: 5, .. }));
}
