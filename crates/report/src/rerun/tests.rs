//! A recording is read back with rerun's own decoder and held against what was put in.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

use depthcal_calibration::observe::MeasuredDepth;
use depthcal_io::{DepthFrame, DepthImage, GrayImage};
use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};
use re_chunk::Chunk;
use re_log_encoding::DecoderApp;
use re_log_types::LogMsg;
use re_sdk_types::archetypes::{Points2D, Points3D, Scalars, Transform3D};

use super::{RecordedCapture, write};
use depthcal_calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal_calibration::judge::camera::{EvaluatedFrame, evaluate_camera};
use depthcal_calibration::observe::CameraFrames;

const FRAMES: usize = 8;

fn simulated() -> CameraFrames {
    let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 3).frames(FRAMES);
    depthcal_calibration::simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap())
}

/// All chunks of a file by entity.
fn read(path: &Path) -> BTreeMap<String, Vec<Chunk>> {
    let messages = DecoderApp::decode_eager(BufReader::new(File::open(path).unwrap())).unwrap();
    let mut chunks: BTreeMap<String, Vec<Chunk>> = BTreeMap::new();
    let mut stores = 0;
    for message in messages {
        match message.unwrap() {
            LogMsg::SetStoreInfo(_) => stores += 1,
            LogMsg::ArrowMsg(_, message) => {
                let chunk = Chunk::from_arrow_msg(&message).unwrap();
                chunks.entry(chunk.entity_path().to_string()).or_default().push(chunk);
            }
            LogMsg::BlueprintActivationCommand(_) => panic!("there is no blueprint"),
        }
    }
    assert_eq!(stores, 1);
    chunks
}

#[test]
fn a_recording_holds_what_was_measured_and_corrected() {
    let mut capture = simulated();
    let camera = calibrate_camera(&capture, &CameraOptions::default()).unwrap().camera;
    let evaluated = evaluate_camera(&camera, &capture);
    assert_eq!(evaluated.frames.len(), FRAMES);
    // Whole images in one frame alone: the others must not show them.
    let (width, height) = (capture.width, capture.height);
    let ramp: Vec<u16> = (0..width * height).map(|i| (i % 1000) as u16).collect();
    capture.frames[2].image = Some(GrayImage { width, height, data: ramp.clone(), bits: 16 }.into());
    capture.frames[2].depth = MeasuredDepth::Image(DepthFrame::from(DepthImage { width, height, data: ramp }).into());

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made/on the way/capture.rrd");
    write(&path, &camera, &[RecordedCapture { capture: &capture, evaluated: &evaluated }]).unwrap();
    let chunks = read(&path);

    let still = ["/__properties", "/about", "/world", "/world/camera", "/world/poses"];
    let moving = [
        "/depth",
        "/error/depth_rms_mm/corrected",
        "/error/depth_rms_mm/measured",
        "/error/dot_mm/corrected",
        "/error/dot_mm/measured",
        "/error/reprojection_px",
        "/frame",
        "/world/board",
        "/world/board/outline",
        "/world/board/points",
        "/world/camera/image",
        "/world/camera/image/found",
        "/world/camera/image/reprojected",
        "/world/cloud/corrected",
        "/world/cloud/measured",
    ];
    let mut expected: Vec<&str> = still.iter().chain(&moving).copied().collect();
    expected.sort_unstable();
    assert_eq!(chunks.keys().map(String::as_str).collect::<Vec<_>>(), expected);
    assert!(still.iter().all(|name| chunks[*name].len() == 1 && chunks[*name][0].is_static()));
    for name in moving {
        let times = chunks[name].iter().map(|c| {
            assert_eq!(c.timelines().len(), 1, "{name}");
            let (timeline, column) = c.timelines().iter().next().unwrap();
            assert_eq!(timeline.as_str(), "frame");
            column.times_raw()[0]
        });
        assert_eq!(times.collect::<Vec<_>>(), (0..FRAMES as i64).collect::<Vec<_>>(), "{name}");
    }

    for (i, frame) in evaluated.frames.iter().enumerate() {
        assert_frame(&chunks, i, frame, capture.frames[i].markers.iter().map(|marker| marker.pixel[0]));
    }
    // A frame without image clears that of the frame before.
    let shows = |name: &str, i: usize| chunks[name][i].components_identifiers().any(|c| c.as_str().contains("buffer"));
    for name in ["/world/camera/image", "/depth"] {
        assert_eq!((0..FRAMES).filter(|i| shows(name, *i)).collect::<Vec<_>>(), [2], "{name}");
    }
}

/// Asserts that the recording has pose, depth, dots and error of frame number `i`, whose markers have these columns, px.
fn assert_frame(
    chunks: &BTreeMap<String, Vec<Chunk>>,
    i: usize,
    frame: &EvaluatedFrame,
    columns: impl Iterator<Item = f64>,
) {
    // Metres, in the camera's frame.
    let translation = Transform3D::descriptor_translation().component;
    let placed = chunks["/world/board"][i].iter_slices::<[f32; 3]>(translation).next().unwrap()[0];
    let expected = frame.camera_from_board.translation.vector / 1000.0;
    assert!((0..3).all(|k| (f64::from(placed[k]) - expected[k]).abs() < 1e-6), "{placed:?} {expected}");
    // Every pixel has a point; its depth is the board's and the error.
    let positions = Points3D::descriptor_positions().component;
    for (name, after) in [("/world/cloud/measured", false), ("/world/cloud/corrected", true)] {
        let points = chunks[name][i].iter_slices::<[f32; 3]>(positions).next().unwrap();
        assert_eq!(points.len(), frame.pixels.len());
        for (point, p) in points.iter().zip(&frame.pixels) {
            let z = p.board_depth_mm + if after { p.after_mm } else { p.before_mm };
            assert!((1000.0 * f64::from(point[2]) - z).abs() < 1e-3, "{point:?} {z}");
        }
    }
    // Dots at pixel centres of the viewer's, and where the camera projects them.
    let positions = Points2D::descriptor_positions().component;
    let dots = |name: &str| chunks[name][i].iter_slices::<[f32; 2]>(positions).next().unwrap().to_vec();
    let (detected, projected) = (dots("/world/camera/image/found"), dots("/world/camera/image/reprojected"));
    let columns: Vec<f64> = columns.collect();
    assert_eq!(detected.len(), columns.len());
    for ((f, p), column) in detected.iter().zip(&projected).zip(columns) {
        assert!((f64::from(f[0]) - column - 0.5).abs() < 1e-4);
        assert!((f[0] - p[0]).hypot(f[1] - p[1]) < 2.0, "{f:?} {p:?}");
    }
    let scalars = Scalars::descriptor_scalars().component;
    let value = chunks["/error/depth_rms_mm/corrected"][i].iter_slices::<f64>(scalars).next().unwrap()[0];
    assert_eq!(value, frame.record().depth_rms_mm.unwrap().after);
}

#[test]
fn captures_follow_each_other_and_files_that_cannot_be_written_are_errors() {
    let capture = simulated();
    let camera = calibrate_camera(&capture, &CameraOptions::default()).unwrap().camera;
    let evaluated = evaluate_camera(&camera, &capture);
    let one = RecordedCapture { capture: &capture, evaluated: &evaluated };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.rrd");
    write(&path, &camera, &[one, one]).unwrap();
    assert_eq!(read(&path)["/frame"].len(), 2 * FRAMES);
    // A folder of that name is in the way.
    let error = write(folder.path(), &camera, &[one]).unwrap_err().to_string();
    assert!(error.contains(&*folder.path().to_string_lossy()), "{error}");
}
