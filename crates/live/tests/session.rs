//! Which frames a session keeps, and that they stay.

use std::fs;
use std::path::Path;

use depthcal_calibration::load::{LoadOptions, load};
use depthcal_detect::DetectOptions;
use depthcal_io::Dataset;
use depthcal_live::{Arrival, Session, fit};

use crate::captures::{arrivals, board, live_fit};

fn open(folder: &Path) -> Session {
    Session::open(folder, &board(), DetectOptions::default()).unwrap()
}

fn frames(folder: &Path) -> Vec<String> {
    let camera = Dataset::open(folder).unwrap().into_only_camera().unwrap();
    assert!(camera.frames.iter().all(|frame| frame.image.is_some() && frame.depth.is_some()));
    camera.frames.iter().map(|frame| frame.name.clone()).collect()
}

/// A view several times, as a video has it of a board at rest.
fn at_rest(arrival: &Arrival) -> Vec<Arrival> {
    vec![arrival.clone(); 4]
}

#[test]
fn different_frames_with_a_board_are_kept_and_can_be_calibrated() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    let (mut count, mut with_board) = (0, 0);
    for arrival in arrivals(false) {
        let again = arrival.clone();
        let seen = session.see(arrival).unwrap();
        with_board += usize::from(seen.markers > 0);
        count += usize::from(seen.kept.is_some());
        assert_eq!(session.see(again).unwrap().kept, None, "it is kept already, or was not worth it");
    }
    assert!(count >= 8 && count <= with_board, "{count} of {with_board}");
    assert_eq!(session.kept(), frames(folder.path()));
    // Every value of the files is that of the frame.
    let loaded = load(folder.path(), &LoadOptions::default()).unwrap();
    assert_eq!(loaded.cameras[0].capture.frames.len(), count);
    let outcome = fit(session.fit_job().unwrap(), &live_fit());
    let fitted = outcome.result.clone().unwrap();
    let focal = fitted.camera.pinhole()[0];
    assert!((focal / 290.0 - 1.0).abs() < 0.02, "the simulated focal length is 290 px, not {focal}");
    let summary = &fitted.summary;
    assert!(
        summary.held_px.unwrap() > 0.5 * summary.fitted_px.unwrap() && summary.held_mm.unwrap() > 0.0,
        "{summary:?}"
    );
    let plan = summary.plan.as_ref().unwrap();
    assert!(plan.goal == "depth" && plan.now_95 > 0.0, "{plan:?}");
    session.fitted(outcome);
    let state = session.page_state();
    assert!(
        state.wanted.unwrap().outline.len() >= 30 && state.kept.len() == count && state.cells.iter().sum::<u32>() > 100
    );
}

#[test]
fn a_killed_session_goes_on_with_all_that_it_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    let mut frames_to_come = arrivals(false).into_iter();
    while session.kept().len() < 4 {
        session.see(frames_to_come.next().unwrap()).unwrap();
    }
    let before = session.kept();
    // A run that was killed while it kept a fifth frame: depth and the row are there, the image is not.
    let depth = folder.path().join("depth/0005.png");
    fs::copy(folder.path().join("depth/0004.png"), &depth).unwrap();
    let table = folder.path().join("frames.csv");
    fs::write(&table, fs::read_to_string(&table).unwrap() + "0005,1.5,\n").unwrap();
    fs::write(folder.path().join("image/.0005.png.x1.depthcal.tmp"), "half").unwrap();
    drop(session);
    assert_eq!(frames(folder.path()), before, "what is half written is no frame");
    let mut session = open(folder.path());
    assert_eq!(session.kept(), before);
    assert_eq!(session.page_state().kept.len(), 4);
    let fifth = frames_to_come.find_map(|arrival| session.see(arrival).unwrap().kept).unwrap();
    assert_eq!(fifth, "0005");
    assert_eq!(frames(folder.path()), session.kept());
    assert_eq!(session.kept().len(), 5);
}

#[test]
fn killed_before_the_first_frame_it_begins_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    session.see(arrivals(false).remove(0)).unwrap();
    assert_eq!(session.kept(), ["0001"]);
    drop(session);
    fs::remove_file(folder.path().join("image/0001.png")).unwrap();
    let mut session = open(folder.path());
    assert!(session.kept().is_empty());
    session.see(arrivals(false).remove(0)).unwrap();
    assert_eq!(frames(folder.path()), ["0001"]);
}

#[test]
fn the_last_frame_can_be_taken_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    assert_eq!(session.take_back(), None);
    let all = arrivals(false);
    for arrival in all.iter().cloned() {
        session.see(arrival).unwrap();
    }
    let before = session.kept();
    let last = session.take_back().unwrap();
    assert_eq!(Some(&last), before.last());
    assert_eq!(frames(folder.path()), before[..before.len() - 1]);
    assert!(!folder.path().join(format!("depth/{last}.png")).exists());
    let table = fs::read_to_string(folder.path().join("frames.csv")).unwrap();
    assert!(!table.contains(&last), "{table}");
    // The frame that is shown can be kept after all.
    session.take_back();
    session.see(all[0].clone()).unwrap();
    let again = session.capture().unwrap();
    assert_eq!((session.capture(), session.take_back()), (None, Some(again.clone())));
    assert_eq!(session.capture(), Some(again));
    while session.take_back().is_some() {}
    assert!(session.kept().is_empty() && session.fit_job().is_none());
    session.see(all[0].clone()).unwrap();
    assert_eq!(frames(folder.path()), ["0001"]);
}

#[test]
fn of_a_video_only_frames_at_rest_are_kept_and_any_by_the_key() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    let all = arrivals(true);
    for arrival in all.iter().cloned() {
        assert_eq!(session.see(arrival).unwrap().kept, None, "the board jumps from frame to frame");
    }
    assert!(session.capture().is_some() || session.page_state().board.is_none());
    let is_kept: Vec<bool> =
        at_rest(&all[3]).into_iter().map(|frame| session.see(frame).unwrap().kept.is_some()).collect();
    assert_eq!(is_kept, [false, false, false, true]);
    assert_eq!(session.capture(), None, "it is kept already");
    assert!(session.page_state().message.contains("already"));
}

/// After a fit a video keeps nothing but the wanted pose, which is then no longer wanted.
#[test]
fn after_a_fit_a_video_keeps_the_wanted_pose_alone() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    let all = arrivals(false);
    for arrival in all.iter().take(8).cloned() {
        session.see(arrival).unwrap();
    }
    let mut outcome = fit(session.fit_job().unwrap(), &live_fit());
    // The pose of a frame that is still to come is wanted, instead of the planner's.
    let views = depthcal_calibration::load::load(crate::captures::folder(), &LoadOptions::default()).unwrap();
    let frame = &views.cameras[0].capture.frames.iter().find(|frame| frame.name == all[10].name).unwrap();
    let fitted = outcome.result.as_mut().unwrap();
    let markers = depthcal_calibration::start::FrameMarkers { name: &frame.name, markers: &frame.markers };
    let pose = depthcal_calibration::start::estimate_pose(&fitted.camera, &board(), &markers).unwrap();
    fitted.poses.truncate(1);
    fitted.poses[0].1 = pose.camera_from_board;
    session.fitted(outcome);
    let video = |number: usize| Arrival { is_video: true, ..all[number].clone() };
    for frame in at_rest(&video(9)).into_iter().chain(at_rest(&video(11))) {
        assert_eq!(session.see(frame).unwrap().kept, None, "another pose is wanted");
    }
    assert!(!session.page_state().wanted.unwrap().is_reached);
    let is_kept: Vec<bool> =
        at_rest(&video(10)).into_iter().map(|frame| session.see(frame).unwrap().kept.is_some()).collect();
    assert_eq!(is_kept, [false, false, false, true]);
    assert_eq!(session.page_state().wanted, None);
    // No pose is left: whatever differs is kept again.
    assert!(at_rest(&video(11)).into_iter().any(|frame| session.see(frame).unwrap().kept.is_some()));
}

#[test]
fn a_pose_that_cannot_be_reached_is_given_up() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    session.see(arrivals(false).remove(0)).unwrap();
    let wanted = |session: &Session| session.page_state().wanted.map(|wanted| wanted.words);
    let first = wanted(&session);
    session.skip();
    assert!(first.is_some() && wanted(&session).is_some() && wanted(&session) != first);
    (0..20).for_each(|_| session.skip());
    assert_eq!(wanted(&session), None);
}

#[test]
fn frames_that_do_not_fit_the_others_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    let all = arrivals(false);
    session.see(all[0].clone()).unwrap();
    let without_depth = Arrival { depth: None, unit_mm: None, ..all[1].clone() };
    let other_unit = Arrival { unit_mm: Some(0.25), ..all[1].clone() };
    for (arrival, word) in [(without_depth, "depth"), (other_unit, "unit")] {
        assert_eq!(session.see(arrival).unwrap().kept, None);
        let message = session.page_state().message;
        assert!(message.contains("not kept") && message.contains(word), "{message}");
    }
    assert_eq!(frames(folder.path()), ["0001"]);
}

#[test]
fn folders_of_others_are_left_alone() {
    let open = |folder: &Path| Session::open(folder, &board(), DetectOptions::default()).map(drop);
    let error = open(crate::captures::folder()).map(|()| "opened").unwrap_or("refused");
    assert_eq!(error, "opened", "a dataset of this layout and board can be continued");
    let folder = tempfile::tempdir().unwrap();
    let session = Session::open(folder.path(), &board(), DetectOptions::default()).unwrap();
    let error = open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("another session"), "{error}");
    drop(session);
    fs::create_dir_all(folder.path().join("image")).unwrap();
    fs::write(folder.path().join("image/holiday.png"), "x").unwrap();
    let error = open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("no dataset.toml"), "{error}");
    let mut board = board();
    board.columns += 1;
    let error = Session::open(crate::captures::folder(), &board, DetectOptions::default()).unwrap_err().to_string();
    assert!(error.contains("another board"), "{error}");
}
