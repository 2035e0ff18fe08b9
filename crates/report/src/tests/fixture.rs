//! A calibration of simulated observations, and its errors on frames that it saw and that it did not.

use std::sync::OnceLock;

use depthcal_simulate::{CameraTruth, Effect, Kind, PointOptions, Simulation};
use nalgebra::Point3;

use super::super::{Made, ReportCamera, ReportDataset, ReportInput, Role, render};
use depthcal_calibration::calibrate::{CalibratedCamera, CameraOptions, calibrate_camera};
use depthcal_calibration::judge::camera::{EvaluatedCamera, EvaluatedFrame};
use depthcal_calibration::judge::depth_errors::{DepthErrors, PixelError};
use depthcal_calibration::observe::board_plane::BoardPlane;
use depthcal_calibration::observe::{CameraFrames, DepthPixel, DetectedFrame, DroppedFrame, MeasuredDepth};
use depthcal_calibration::start::{FrameMarkers, estimate_pose};
use depthcal_model::{Camera, ModelSpec};

/// Frames of a capture in the thesis.
const FRAMES: usize = 27;

/// Everything that a full report needs.
#[derive(Debug, Clone)]
pub(super) struct Fixture {
    pub title: String,
    pub calibrated: CalibratedCamera,
    pub fitted: EvaluatedCamera,
    pub held: EvaluatedCamera,
}

fn observe(effects: &[Effect], samples: usize, frames: usize, seed: u64) -> CameraFrames {
    let camera = CameraTruth::published(1).unwrap();
    let options = PointOptions { depth_samples: samples, ..PointOptions::default() };
    let simulation = Simulation::new(camera, Kind::General(1), effects, seed).frames(frames);
    depthcal_calibration::simulated::capture(&simulation.observe_points(&options).unwrap())
}

/// Errors at the depth samples, which stand in for the pixels of a depth image.
fn frame(camera: &Camera, bare: &Camera, capture: &CameraFrames, frame: &DetectedFrame) -> Option<EvaluatedFrame> {
    let markers = FrameMarkers { name: &frame.name, markers: &frame.markers };
    let pose = estimate_pose(camera, &capture.target, &markers).ok()?.camera_from_board;
    let plane = BoardPlane::new(&pose);
    let pixel = |s: &DepthPixel| {
        let (ray, _) = bare.correct(&s.context, 1.0, 1.0 / s.depth_mm).ok()?;
        let cos = plane.cos_incidence(ray);
        let (after_ray, rho) = camera.correct(&s.context, cos, 1.0 / s.depth_mm).ok()?;
        let board_depth_mm = plane.depth(ray)?;
        let place = plane.to_board(ray, board_depth_mm);
        Some(PixelError {
            context: s.context,
            board_depth_mm,
            board: [place.x, place.y],
            cos_incidence: cos,
            before_mm: s.depth_mm - board_depth_mm,
            after_mm: 1.0 / rho - plane.depth(after_ray)?,
            height_before_mm: plane.to_board(ray, s.depth_mm).z,
            height_after_mm: plane.to_board(after_ray, 1.0 / rho).z,
        })
    };
    let pixels: Vec<PixelError> = frame.depth_pixels().iter().filter_map(pixel).collect();
    let errors = frame.markers.iter().filter_map(|m| {
        let p = capture.target.point(m.index);
        let projected = camera.project(&(pose * Point3::new(p[0], p[1], 0.0)).coords)?;
        Some([m.pixel[0], m.pixel[1], m.pixel[0] - projected[0], m.pixel[1] - projected[1]])
    });
    let dots = pixels.iter().take(40).map(|p| [p.before_mm.abs(), p.after_mm.abs()]).collect();
    Some(EvaluatedFrame {
        name: frame.name.clone(),
        camera_from_board: pose,
        reprojection: errors.collect(),
        wrong_markers: 0,
        dots,
        markers: Vec::new(),
        depth: DepthErrors::of(&pixels),
        pixels,
        outliers: 0,
        outlier_limit_mm: Some(50.0),
        uncorrectable: 0,
    })
}

fn evaluate(camera: &Camera, capture: &CameraFrames) -> EvaluatedCamera {
    let bare = camera.filtered(|b| b.hook() != depthcal_model::hook::HookKind::Depth);
    let frames: Vec<EvaluatedFrame> = capture.frames.iter().filter_map(|f| frame(camera, &bare, capture, f)).collect();
    evaluated(&capture.name, &frames)
}

/// A dataset of some frames.
pub(super) fn evaluated(name: &str, frames: &[EvaluatedFrame]) -> EvaluatedCamera {
    EvaluatedCamera { name: name.to_owned(), frames: frames.to_vec(), dropped: Vec::new() }
}

fn build(effects: &[Effect], samples: usize, frames: usize, seed: u64) -> Fixture {
    let capture = observe(effects, samples, frames, seed);
    let train = capture.subset(|i, _| i % 3 != 2);
    let mut fit = train.clone();
    for frame in &mut fit.frames {
        let pixels = frame.depth_pixels()[..frame.depth_pixels().len().min(500)].to_vec();
        frame.depth = MeasuredDepth::Pixels(pixels);
    }
    let mut calibrated = calibrate_camera(&fit, &CameraOptions::default()).unwrap();
    let reason = "the board was not found".to_owned();
    calibrated.capture.dropped.push(DroppedFrame { name: "0031".into(), reason: reason.clone() });
    let mut held = evaluate(&calibrated.camera, &capture.subset(|i, _| i % 3 == 2));
    held.dropped.push(DroppedFrame { name: "0032".into(), reason });
    let fitted = evaluate(&calibrated.camera, &train);
    Fixture { title: "Camera 1, general1".to_owned(), calibrated, fitted, held }
}

impl Fixture {
    /// Camera 1 of the thesis with effects that the model does not have; the clean one is made once.
    pub(super) fn simulated(effects: &[Effect]) -> Self {
        static CLEAN: OnceLock<Fixture> = OnceLock::new();
        if effects.is_empty() {
            CLEAN.get_or_init(|| build(&[], 500, FRAMES, 7)).clone()
        } else {
            build(effects, 3000, FRAMES, 7)
        }
    }

    /// Another capture of the same camera.
    pub(super) fn seeded(effects: &[Effect], seed: u64) -> Self {
        build(effects, 300, FRAMES, seed)
    }

    /// As many frames and pixels as a large capture has.
    pub(super) fn large() -> Self {
        build(&[], 3000, 51, 7)
    }

    pub(super) fn input<'a>(&'a self, evaluations: &[ReportDataset<'a>]) -> ReportInput<'a> {
        let both = [
            ReportDataset { evaluated: &self.fitted, role: Role::Fitted },
            ReportDataset { evaluated: &self.held, role: Role::HeldOut },
        ];
        let evaluations = if evaluations.is_empty() { &both[..] } else { evaluations };
        ReportInput {
            title: self.title.clone(),
            made: Made {
                command_line: "depthcal calibrate captures --hold-out 3 --out result".to_owned(),
                ..Made::default()
            },
            cameras: vec![ReportCamera {
                calibrated: Some(&self.calibrated),
                evaluations: evaluations.to_vec(),
                ..ReportCamera::default()
            }],
            ..ReportInput::default()
        }
    }

    pub(super) fn render(&self, story: &[String]) -> String {
        render(&ReportInput { story, ..self.input(&[]) }).unwrap()
    }
}

/// A calibration without depth, and its errors.
pub(super) fn image_only() -> (CalibratedCamera, EvaluatedCamera) {
    let mut capture = observe(&[], 10, FRAMES, 7);
    capture.frames.iter_mut().for_each(|f| f.depth = MeasuredDepth::None);
    let calibrated =
        calibrate_camera(&capture, &CameraOptions { model: ModelSpec::none(), ..CameraOptions::default() }).unwrap();
    let evaluated = evaluate(&calibrated.camera, &capture);
    (calibrated, evaluated)
}
