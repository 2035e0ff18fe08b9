//! Cameras that expose at other moments than their times say, before a board that moves.

use std::fmt::Debug;
use std::sync::{Arc, Mutex};

use crate::support;
use depthcal_calibration::calibrate::CalibrateError;
use depthcal_calibration::calibrate::{CalibrateOptions, calibrate};
use depthcal_calibration::observe::Capture;
use depthcal_calibration::rig_simulated::{errors, rig_capture, squared_error};
use depthcal_simulate::{Kind, PointOptions, RigCamera, RigPoints, RigSimulation, Waved};
use depthcal_statistics::chi_squared_tail;
use tracing::field::Field;
use tracing::span::{Attributes, Id, Record};
use tracing::subscriber::with_default;
use tracing::{Event, Level, Metadata, Subscriber};

/// Frames of the videos, a twenty-fifth of a second apart.
const FRAMES: usize = 60;

fn video(second: RigCamera, seed: u64) -> RigPoints {
    let rig = RigSimulation::new(vec![support::infrared(), second], Kind::General(1), seed);
    let options = PointOptions::default();
    rig.waved(Waved::default(), FRAMES).observe_points(&options).expect("a simulation")
}

fn options(offset_of: &[&str]) -> CalibrateOptions {
    let time_offsets = offset_of.iter().map(|name| (*name).to_owned()).collect();
    CalibrateOptions { lens: Some("brown-conrady:full".to_owned()), time_offsets, ..CalibrateOptions::default() }
}

fn errors_of(capture: &Capture, truth: &RigPoints) -> Vec<(String, f64, f64)> {
    let fit = calibrate(capture, &options(&["colour"])).expect("a fit");
    let names = fit.parameters();
    let errors = errors(&fit, &truth.truth);
    let (squared, freedom) = squared_error(&fit, &errors).expect("a covariance");
    let tail = chi_squared_tail(squared, freedom);
    assert!(tail > 1e-3, "squared error {squared} of {freedom}");
    let with_sigma = |(row, error): &(usize, f64)| (names[*row].0.clone(), *error, fit.std_dev(*row));
    errors.iter().map(with_sigma).collect()
}

/// Offset, extrinsics and intrinsics are within three standard deviations of the truth, and the offset is known to a small part
/// of itself, for cameras that expose earlier and later.
#[test]
fn the_offset_of_a_moving_board_is_found() {
    for (seed, offset_s) in [(1, 0.012), (2, -0.025)] {
        let points = video(support::colour().time_offset(offset_s), seed);
        let errors = errors_of(&rig_capture(&points), &points);
        let (_, _, sigma) = errors.iter().find(|(name, ..)| name == "colour/time_offset.dt").expect("the offset");
        assert!(*sigma < 0.02 * offset_s.abs(), "known to {sigma} s");
        for (name, error, sigma) in &errors {
            assert!(error.abs() < 3.5 * sigma, "{name}: {error} ± {sigma}");
        }
    }
}

/// Without an offset in the model the colour camera's place is wrong by many standard deviations, or its frames contradict.
#[test]
fn what_the_offset_is_for() {
    let points = video(support::colour().time_offset(0.012), 3);
    let Ok(fit) = calibrate(&rig_capture(&points), &options(&[])) else { return };
    let errors = errors(&fit, &points.truth);
    let (squared, freedom) = squared_error(&fit, &errors).expect("a covariance");
    assert!(squared > 10.0 * freedom as f64, "{squared} of {freedom}");
}

/// A camera that is out of step is named with its offset, and one in step is not.
#[test]
fn an_offset_that_was_not_asked_for_is_proposed() {
    for (offset_s, words) in [(0.012, Some("colour exposes 12")), (0.0, None)] {
        let points = video(support::colour().time_offset(offset_s), 5);
        let log = Warnings::default();
        // Whether the cameras contradict each other is another question.
        let _ = with_default(log.clone(), || calibrate(&rig_capture(&points), &options(&[])));
        let warnings = log.0.lock().expect("no other thread").clone();
        let proposed = warnings.iter().find(|warning| warning.contains("--with colour:time_offset"));
        assert_eq!(proposed.is_some(), words.is_some(), "{warnings:?}");
        assert!(words.is_none_or(|words| proposed.is_some_and(|warning| warning.contains(words))), "{warnings:?}");
    }
}

/// The messages of all warnings.
#[derive(Clone, Default)]
struct Warnings(Arc<Mutex<Vec<String>>>);

impl Subscriber for Warnings {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() == Level::WARN
    }

    fn event(&self, event: &Event<'_>) {
        let mut message = String::new();
        event.record(&mut |field: &Field, value: &dyn Debug| {
            if field.name() == "message" {
                message = format!("{value:?}");
            }
        });
        self.0.lock().expect("no other thread").push(message);
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

/// Times that differ by a known amount are part of the model: what is left to find is the rest.
#[test]
fn known_times_count() {
    let points = video(support::colour().time_offset(0.012), 4);
    let mut capture = rig_capture(&points);
    for frame in &mut capture.cameras[1].capture.frames {
        frame.raw.metadata.timestamp_s = frame.metadata.timestamp_s.map(|t| t + 0.010);
    }
    let fit = calibrate(&capture, &options(&["colour"])).expect("a fit");
    let offset = fit.camera("colour").and_then(|camera| camera.time_offset).expect("an offset");
    assert!((offset.value_s - 0.002).abs() < 3.5 * offset.std_dev_s, "{offset:?}");
}

#[test]
fn what_leaves_the_offset_open_is_refused() {
    let refused = |capture: &Capture, of: &str| calibrate(capture, &options(&[of])).expect_err("no fit");
    let still = rig_capture(&support::two_cameras(5, Kind::General(1)));
    let error = refused(&still, "colour");
    assert!(matches!(error, CalibrateError::TimeOffset { .. }) && error.to_string().contains("timestamp_s"), "{error}");
    let error = refused(&still, "infrared").to_string();
    assert!(error.contains("reference"), "{error}");
}
