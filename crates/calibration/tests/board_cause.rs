//! Boards that are found in part because they are not as declared.

#![cfg(feature = "detect")]
#![allow(
    unexpected_cfgs,
    dead_code,
    reason = "what it shares with tests of depthcal-detect asks for the configuration of that crate"
)]

#[path = "../../detect/tests/common/mod.rs"]
mod common;

use common::{Camera, Pose, Scene, Style, Texture};
use depthcal_calibration::cause::{BoardFault, board_cause_of_few_markers};
use depthcal_calibration::observe::{MarkerObservation, RawFrame};
use depthcal_detect::{DetectOptions, Detector, detect};
use depthcal_model::Target;

/// Views of a printed board, the first of so many of its columns alone.
fn views(printed: &Target, columns: f64) -> Vec<RawFrame> {
    let texture = Texture::with_tags(printed.clone(), 8.0, Style::default());
    let camera = Camera::thesis();
    let [low, high] = printed.marker_rectangle();
    let middle = [0, 1].map(|axis| (low[axis] + high[axis]) / 2.0);
    let centre = [camera.width as f64, camera.height as f64].map(|size| size / 2.0);
    let z = 1.9 * camera.f * (high[0] - low[0]) / camera.width as f64;
    let view = |number: u64| {
        let (tilt, direction) = (0.15 + 0.1 * number as f64, number as f64);
        let pose = Pose::looking(&camera, middle, centre, z, tilt, direction, 0.1);
        let mut image = Scene::new(camera, pose, &texture, number).render();
        let shown = (columns * image.width as f64) as usize;
        image.data.chunks_exact_mut(image.width).for_each(|row| row[shown..].fill(120));
        RawFrame { name: number.to_string(), image: Some(image.into()), ..RawFrame::default() }
    };
    (0..4).map(view).collect()
}

/// The cause, given the markers that are found of the declared board.
fn faults(declared: &Target, frames: &[RawFrame]) -> Option<Vec<BoardFault>> {
    let options = DetectOptions { refine: false, detector: Detector::BuiltIn, ..DetectOptions::default() };
    let markers = |frame: &RawFrame| -> Vec<MarkerObservation> {
        let image = frame.image.as_ref().expect("an image").get().expect("in memory");
        let detection = detect(&image, declared, &options).expect("a board that can be");
        let observed = detection.iter().flat_map(|detection| &detection.markers);
        observed.map(|m| MarkerObservation { index: m.index, pixel: m.pixel, std_px: 1.0 }).collect()
    };
    let markers: Vec<_> = frames.iter().map(markers).collect();
    board_cause_of_few_markers(declared, frames, &markers).map(|cause| cause.faults)
}

#[test]
fn a_board_of_which_only_a_part_fits_its_declaration_is_refused() {
    let board = |columns, rows| common::charuco(columns, rows, 28.0, 21.0, "DICT_4X4_50");
    let printed = board(8, 6);
    let frames = views(&printed, 1.0);
    let is_size = |faults: Option<Vec<BoardFault>>, explained: &str| matches!(faults.as_deref(), Some([BoardFault::Size { columns: 8, rows: 6, explanation }]) if explanation.contains(explained));
    assert_eq!(faults(&printed, &frames), None);
    let exchanged = faults(&board(6, 8), &frames);
    assert!(is_size(exchanged.clone(), "exchanged"), "{exchanged:?}");
    let inner = faults(&board(7, 5), &frames);
    assert!(is_size(inner.clone(), "not inner corners"), "{inner:?}");
}

/// Half of a board is no sign of another one.
#[test]
fn a_board_that_is_seen_in_part_is_as_declared() {
    let printed = common::charuco(8, 6, 28.0, 21.0, "DICT_4X4_50");
    assert_eq!(faults(&printed, &views(&printed, 0.55)), None);
}
