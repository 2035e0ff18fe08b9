//! Chosen frames against random ones, and against fits to them.

use depthcal_model::{Camera, Pattern, Target};
use depthcal_simulate::{CameraTruth, DepthNoise, Kind, Noise, PointOptions, Simulation};
use nalgebra::Isometry3;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::{ChosenFrames, Planner, hold_out_views, pose_showing};
use crate::adjust::state::{CameraState, State};
use crate::calibrate::{CalibratedCamera, CameraOptions, calibrate_camera};
use crate::observe::CameraFrames;
use crate::simulated;

const FRAMES: usize = 16;

fn capture() -> CameraFrames {
    let noise = Noise { depth: DepthNoise::Disparity { sigma_rho: 2e-6 }, ..Noise::default() };
    let simulation =
        Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 5).frames(FRAMES).noise(noise);
    let options = PointOptions { depth_samples: 100, ..PointOptions::default() };
    simulated::capture(&simulation.observe_points(&options).unwrap())
}

fn fitted(capture: &CameraFrames) -> CalibratedCamera {
    calibrate_camera(capture, &CameraOptions { frame_planes: false, ..CameraOptions::default() }).unwrap()
}

fn planner(fit: &CalibratedCamera) -> Planner {
    let camera = CameraState::reference(fit.capture.clone(), fit.camera.clone(), fit.noise);
    Planner::new(&State::of_camera(camera), 0, fit.covariance.as_ref().unwrap()).unwrap()
}

#[test]
fn chosen_frames_are_worth_more_than_random_ones() {
    let fit = fitted(&capture());
    let n = fit.capture.frames.len();
    let planner = planner(&fit);
    let goal = planner.default_goal();
    let all: Vec<usize> = (0..n).collect();
    let whole = |frames: &[usize]| frames.iter().map(|frame| (*frame, 1.0)).collect::<Vec<_>>();
    let expected = |frames: &[usize]| planner.choose(&goal, &whole(frames), frames.len()).unwrap().of_all;
    let ChosenFrames { chosen, adds_nothing, of_all } = planner.choose(&goal, &whole(&all), 6).unwrap();
    // What is known before the first frame is 10⁻⁴ of what all frames say.
    let now = planner.plan(&goal, 0.0, 1).unwrap().now;
    assert!((of_all / now - 1.0).abs() < 0.01, "{of_all} {now}");
    assert!(chosen.windows(2).all(|pair| pair[1].1 < pair[0].1), "{chosen:?}");
    let best: Vec<usize> = chosen.iter().map(|(frame, _)| *frame).collect();
    assert!((expected(&best) / chosen[5].1 - 1.0).abs() < 1e-9);
    // A frame that hardly counts is not chosen.
    let mut doubtful = whole(&all);
    doubtful[best[0]].1 = 1e-3;
    let without = planner.choose(&goal, &doubtful, 6).unwrap().chosen;
    assert!(without.iter().all(|(frame, _)| *frame != best[0]), "{without:?} {best:?}");
    let mut generator = ChaCha8Rng::seed_from_u64(1);
    let mut random: Vec<f64> = (0..200)
        .map(|_| {
            let mut frames = all.clone();
            frames.shuffle(&mut generator);
            expected(&frames[..6])
        })
        .collect();
    random.sort_by(f64::total_cmp);
    // The greedy choice is not the best of all subsets, but hardly any random one is better.
    assert!(chosen[5].1 < random[10] && chosen[5].1 < 0.9 * random[100], "{} {:?}", chosen[5].1, &random[..20]);
    for frame in all.iter().filter(|frame| !best.contains(frame)) {
        let gain = 1.0 - expected(&[&best[..], &[*frame]].concat()) / chosen[5].1;
        assert_eq!(adds_nothing.contains(frame), gain < 0.002, "{frame}: {gain}");
    }
}

/// Two fits tell of their own uncertainty: that to the chosen half of the frames, and that to the other half.
#[test]
fn a_fit_to_the_chosen_half_is_the_more_certain_one() {
    let capture = capture();
    let fit = fitted(&capture);
    let planner_of_all = planner(&fit);
    let goal = planner_of_all.default_goal();
    let all: Vec<(usize, f64)> = (0..fit.capture.frames.len()).map(|frame| (frame, 1.0)).collect();
    let chosen = planner_of_all.choose(&goal, &all, all.len() / 2).unwrap().chosen;
    let names: Vec<&str> = chosen.iter().map(|(frame, _)| fit.capture.frames[*frame].name.as_str()).collect();
    let now = |is_chosen: bool| {
        let half = capture.subset(|_, frame| names.contains(&frame.name.as_str()) == is_chosen);
        planner(&fitted(&half)).plan(&goal, 0.0, 1).unwrap().now
    };
    let [chosen, others] = [now(true), now(false)];
    assert!(chosen < others, "{chosen} {others}");
}

#[test]
fn held_out_frames_are_at_all_distances_and_their_twins_are_named() {
    let camera = Camera::new(640, 480, [600.0, 600.0, 319.5, 239.5, 0.0], Vec::new());
    let target = Target { pattern: Pattern::Chessboard, columns: 6, rows: 4, spacing_mm: 30.0 };
    let pose = |distance, u| pose_showing(&camera, &target, distance, [u, 239.5], [0.0; 2]).unwrap();
    let poses: Vec<Isometry3<f64>> = (0..10).map(|i| pose(500.0 + 100.0 * f64::from(i), 319.5)).collect();
    let held = hold_out_views(&camera, &target, &poses, 2);
    assert_eq!((held.held_out, held.like), (vec![2, 7], vec![]), "1.2 and 1.3 m are 8 % apart");
    // At the same distance, but elsewhere in the image.
    let twins = [pose(500.0, 100.0), pose(800.0, 100.0), pose(801.0, 110.0), pose(802.0, 500.0), pose(1500.0, 319.5)];
    let held = hold_out_views(&camera, &target, &twins, 1);
    assert_eq!((held.held_out, held.like), (vec![2], vec![[1, 2]]));
    assert!(hold_out_views(&camera, &target, &twins, 0).held_out.is_empty());
    assert_eq!(hold_out_views(&camera, &target, &twins[..1], 3).held_out, [0]);
}
