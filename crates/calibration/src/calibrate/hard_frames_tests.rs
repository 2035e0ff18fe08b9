//! Frames that carry no pose, wrong markers, markers that do not reach the border, models that the captures leave undetermined.

use depthcal_model::{Camera, PieceSpec};
use depthcal_simulate::{CameraTruth, Kind, Noise, PointOptions, Pose, Simulation};

use super::lens_order::LensOrder;
use super::{CalibrateError, CameraOptions, calibrate_camera, calibrate_image};
use crate::observe::{CameraFrames, MarkerObservation};
use crate::simulated;

const SIGMA_PX: f64 = 0.05;

fn capture(camera: CameraTruth, seed: u64) -> CameraFrames {
    let simulation = Simulation::new(camera, Kind::General(1), &[], seed);
    simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap())
}

fn published() -> CameraTruth {
    CameraTruth::published(1).unwrap()
}

/// Markers of the frame whose board coordinates satisfy a condition.
fn keep(capture: &mut CameraFrames, frame: usize, condition: impl Fn([f64; 2]) -> bool) {
    let target = capture.target.clone();
    capture.frames[frame].markers.retain(|m| condition(target.point(m.index)));
}

/// Largest error of fx, fy, cx, cy and k1 … k3, in standard deviations.
fn largest_error(result: &super::CalibratedCamera<crate::observe::PosedFrame>, truth: &CameraTruth) -> f64 {
    let truth = simulated::true_theta(truth);
    let errors = result.camera.theta().into_iter().zip(truth).zip(result.std_devs());
    errors.filter_map(|((found, truth), std)| Some((found - truth).abs() / std?)).fold(0.0, f64::max)
}

#[test]
fn frames_without_a_pose_are_dropped_and_the_others_calibrated() {
    for seed in 0..4 {
        let mut hard = capture(published(), seed);
        hard.frames.truncate(14);
        let spacing = hard.target.spacing_mm;
        let [first, last] = [0, hard.target.points().len() - 1].map(|i| hard.target.point(i));
        let middle = 0.5 * (first[0] + last[0]);
        // Every fourth frame or so is useless: too few markers, a line, none. A cluster and a line with one marker beside it.
        hard.frames[1].markers.truncate(5);
        keep(&mut hard, 4, |p| (p[0] - first[0]).abs() < 1e-6);
        hard.frames[7].markers.clear();
        let beside =
            hard.frames[10].markers.iter().find(|m| hard.target.point(m.index)[0] > first[0] + spacing).copied();
        keep(&mut hard, 10, |p| (p[0] - first[0]).abs() < 1e-6);
        hard.frames[10].markers.extend(beside);
        let names: Vec<String> = [1, 4, 7, 10].iter().map(|i| hard.frames[*i].name.clone()).collect();
        // A half of the board is enough.
        keep(&mut hard, 12, |p| p[0] < middle);
        let result = calibrate_image(&hard, &CameraOptions::default()).unwrap();
        let dropped: Vec<&str> = result.capture.dropped.iter().map(|d| d.name.as_str()).collect();
        assert_eq!(dropped, names, "seed {seed}: {:?}", result.capture.dropped);
        let reason = |i: usize| result.capture.dropped[i].reason.clone();
        assert!(
            reason(0).contains("only 5 markers") && reason(1).contains("on a line"),
            "{:?}",
            result.capture.dropped
        );
        // Nine parameters of ten frames: beyond 4 standard deviations once in some two thousand captures.
        assert!(largest_error(&result, &published()) < 4.0, "seed {seed}: {}", largest_error(&result, &published()));
    }
}

/// With six markers a wrong one can be seen, because six residuals are left over.
#[test]
fn a_thinned_frame_with_a_wrong_marker_is_dropped() {
    for seed in 0..6 {
        let mut hard = capture(published(), 20 + seed);
        let markers = &hard.frames[3].markers;
        let n = markers.len() - 1;
        // Spread over the board: not on one line.
        let chosen: Vec<MarkerObservation> = [0, n / 7, 2 * n / 5, n / 2, 6 * n / 7, n].map(|i| markers[i]).to_vec();
        hard.frames[3].markers = chosen;
        let name = hard.frames[3].name.clone();
        let wrong = &mut hard.frames[3].markers[(seed % 6) as usize].pixel;
        wrong[(seed % 2) as usize] += 20.0;
        let result = calibrate_image(&hard, &CameraOptions::default()).unwrap();
        let dropped: Vec<&str> = result.capture.dropped.iter().map(|d| d.name.as_str()).collect();
        assert_eq!(dropped, [name.as_str()], "seed {seed}: {:?}", result.capture.dropped);
        assert!(largest_error(&result, &published()) < 4.0, "seed {seed}: {}", largest_error(&result, &published()));
    }
}

/// Corners on specks and reflections, two or three pixels from the board's: they are left out and counted, and the frames stay.
#[test]
fn markers_in_the_wrong_place_are_left_out() {
    for seed in 0..4 {
        let mut hard = capture(published(), 60 + seed);
        let mut wrong = Vec::new();
        for (k, frame) in hard.frames.iter_mut().enumerate().step_by(5) {
            let marker = (7 * k + seed as usize) % frame.markers.len();
            frame.markers[marker].pixel[k % 2] += if k % 3 == 0 { 2.0 } else { -3.0 };
            wrong.push((frame.name.clone(), frame.markers[marker].index));
        }
        let result = calibrate_image(&hard, &CameraOptions::default()).unwrap();
        let frames = &result.capture.frames;
        let left_out = frames.iter().flat_map(|f| f.wrong_markers.iter().map(|m| (f.name.clone(), m.index)));
        assert_eq!(left_out.collect::<Vec<_>>(), wrong, "seed {seed}");
        assert!(result.capture.dropped.is_empty(), "seed {seed}: {:?}", result.capture.dropped);
        assert!(largest_error(&result, &published()) < 4.0, "seed {seed}: {}", largest_error(&result, &published()));
    }
}

/// Markers in the middle half of the image alone: the corners are left to the lens' terms of high order.
#[test]
fn the_order_of_a_lens_follows_the_data() {
    let truth = CameraTruth { lens: [-0.05, 0.02, 0.0, 0.0, 0.0], ..published() };
    let [width, height] = [truth.width as f64, truth.height as f64];
    let (mut wins, mut chosen_lower) = (0, 0);
    for seed in 0..8 {
        let mut narrow = capture(truth, 40 + seed);
        for frame in &mut narrow.frames {
            frame.markers.retain(|m| {
                (m.pixel[0] - 0.5 * width).abs() < 0.2 * width && (m.pixel[1] - 0.5 * height).abs() < 0.2 * height
            });
        }
        let chosen = calibrate_image(&narrow, &CameraOptions::default()).unwrap();
        let full = CameraOptions { lens: "brown-conrady:full".to_owned(), ..CameraOptions::default() };
        let full = calibrate_image(&narrow, &full);
        let choice = chosen.lens_choice.clone().expect("the corners are undetermined");
        chosen_lower += usize::from(choice.order < LensOrder::Full);
        assert_eq!(choice.candidates.len(), 4);
        let lens = chosen.camera.block("brown_conrady").unwrap();
        assert_eq!(lens.free, choice.order.free());
        assert!(lens.theta.iter().zip(&lens.free).all(|(value, free)| *free || *value == 0.0));
        let corner = |camera: &Camera| {
            let ray = true_ray(&truth, [width - 1.0, height - 1.0]);
            let pixel = camera.project(&nalgebra::Vector3::new(1000.0 * ray[0], 1000.0 * ray[1], 1000.0));
            pixel.map_or(f64::INFINITY, |p| (p[0] - width + 1.0).hypot(p[1] - height + 1.0))
        };
        let errors = [corner(&chosen.camera), full.map_or(f64::INFINITY, |f| corner(&f.camera))];
        println!(
            "seed {seed}: {} chosen, at the corner {:.2} px instead of {:.2} px",
            choice.order, errors[0], errors[1]
        );
        wins += usize::from(errors[0] < errors[1]);
    }
    assert!(chosen_lower >= 6 && wins >= 6, "lower orders {chosen_lower}, better corners {wins}, of 8");
}

/// The ray of a pixel under the true lens, by Newton's method on the truth's own formula.
fn true_ray(truth: &CameraTruth, pixel: [f64; 2]) -> [f64; 2] {
    let register = depthcal_model::Register::builtin();
    let mut lens = register.block("brown_conrady", None).unwrap();
    lens.theta.copy_from_slice(&truth.lens);
    let [[fx, fy], [cx, cy]] = [truth.focal_px, truth.centre_px];
    let camera = Camera::new(truth.width, truth.height, [fx, fy, cx, cy, truth.skew_px], vec![lens]);
    camera.ray(pixel, 1e-3).unwrap()
}

/// Terms that the markers determine are all fitted, also where the true lens, of the first camera, folds at the corners.
#[test]
fn a_lens_that_is_determined_is_fitted_whole() {
    for number in 1..=4 {
        let result = calibrate_image(&capture(CameraTruth::published(number).unwrap(), 60), &CameraOptions::default());
        let result = result.unwrap();
        println!("camera {number}: {:?}", result.lens_choice);
        assert_eq!(result.camera.block("brown_conrady").unwrap().free, [true; 5], "camera {number}");
    }
}

fn undetermined(result: Result<super::CalibratedCamera, CalibrateError>) -> (String, super::UndeterminedModel) {
    match result {
        Err(error) if error.is_untrusted_fit() => match &error {
            CalibrateError::Undetermined(model) => (error.to_string(), (**model).clone()),
            other => panic!("{other}"),
        },
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("the captures determine the model"),
    }
}

/// D twice.
#[test]
fn parameters_that_do_the_same_are_named() {
    let options = CameraOptions { effects: vec![PieceSpec::new("projective")], ..CameraOptions::default() };
    let (text, model) = undetermined(calibrate_camera(&capture(published(), 5), &options));
    assert!(model.parameters.iter().all(|p| p.starts_with("projective.d")) && model.combinations == 4, "{model:?}");
    assert!(text.lines().count() <= 5 && text.contains("--with fixed:projective.d"), "{text}");
}

/// Exact boards at one distance do not tell an offset of inverse depth from its scale.
#[test]
fn what_a_single_distance_leaves_open_is_explained() {
    let truth = CameraTruth::ideal(640, 480, 480.0);
    let pose = |i: usize| Pose {
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        translation: [-150.0 + 12.0 * i as f64, -90.0, 700.0],
    };
    let simulation = Simulation::new(truth, Kind::General(1), &[], 1).frames(6).poses((0..6).map(pose).collect());
    let exact = PointOptions { sigma_px: 0.0, ..PointOptions::default() };
    let observed = simulation.noise(Noise::none()).observe_points(&exact).unwrap();
    let camera = Camera::new(640, 480, [480.0, 480.0, truth.centre_px[0], truth.centre_px[1], 0.0], Vec::new());
    let options = CameraOptions { camera: Some(camera.map_blocks(|b| b.hold())), ..CameraOptions::default() };
    let (text, model) = undetermined(calibrate_camera(&simulated::capture(&observed), &options));
    assert!(["projective.dz", "projective.dw"].iter().all(|p| model.parameters.iter().any(|q| p == q)), "{model:?}");
    assert!(text.contains("700 mm") && text.contains("farthest distance"), "{text}");
}

#[test]
fn held_parameters_keep_their_values() {
    let held = ["brown_conrady.k3", "pinhole.cx", "projective.dz"].map(|h| h.parse().unwrap()).to_vec();
    let options = CameraOptions { held, ..CameraOptions::default() };
    let result = calibrate_camera(&capture(published(), 6), &options).unwrap();
    let middle = (result.camera.width as f64 - 1.0) / 2.0;
    for (block, parameter, value) in
        [("brown_conrady", "k3", 0.0), ("pinhole", "cx", middle), ("projective", "dz", 0.0)]
    {
        let block = result.camera.block(block).unwrap();
        let place = block.parameters().iter().position(|p| p.name == parameter).unwrap();
        assert_eq!((block.theta[place], block.free[place]), (value, false), "{parameter}");
    }
    for (held, said) in [("lens.k3", "there is no parameter 'lens.k3'"), ("pinhole.fx", "declare it under [camera]")] {
        let options = CameraOptions { held: vec![held.parse().unwrap()], ..CameraOptions::default() };
        let Err(error) = calibrate_camera(&capture(published(), 6), &options) else { panic!("{held} is accepted") };
        assert!(!error.is_untrusted_fit() && error.to_string().contains(said), "{error}");
    }
}

/// The predicted standard deviation of depth is that of repeated observations.
#[test]
fn the_precision_of_a_pose_is_as_predicted() {
    use crate::start::{PoseDoubt, estimate_pose, pose_doubt};
    let truth = published();
    let base = {
        let simulation = Simulation::new(truth, Kind::General(1), &[], 7);
        let exact = PointOptions { sigma_px: 0.0, ..PointOptions::default() };
        simulated::capture(&simulation.observe_points(&exact).unwrap())
    };
    let camera = {
        let mut lens = depthcal_model::Register::builtin().block("brown_conrady", None).unwrap();
        lens.theta.copy_from_slice(&truth.lens);
        let [[fx, fy], [cx, cy]] = [truth.focal_px, truth.centre_px];
        Camera::new(truth.width, truth.height, [fx, fy, cx, cy, truth.skew_px], vec![lens])
    };
    let mut frame = base.frames[2].clone();
    let n = frame.markers.len() - 1;
    frame.markers = [0, n / 7, 2 * n / 5, n / 2, 6 * n / 7, n].map(|i| frame.markers[i]).to_vec();
    let markers = |f: &crate::observe::DetectedFrame| f.markers.clone();
    let exact = markers(&frame);
    fn named(markers: &[MarkerObservation]) -> crate::start::FrameMarkers<'_> {
        crate::start::FrameMarkers { name: "", markers }
    }
    let pose = estimate_pose(&camera, &base.target, &named(&exact)).unwrap().camera_from_board;
    // At a huge standard deviation the pose is in doubt, which tells its prediction, which is linear.
    let Some(PoseDoubt::Uncertain { share, .. }) = pose_doubt(&camera, &base.target, &named(&exact), &pose, 100.0)
    else {
        panic!("a pose by markers of 100 px is not in doubt")
    };
    let predicted = share * SIGMA_PX / 100.0;
    let mut state = 1_u64;
    let mut normal = || {
        // Sum of twelve uniform numbers.
        let mut sum = -6.0;
        for _ in 0..12 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            sum += (state >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    };
    let runs = 400;
    let mut squares = vec![0.0; exact.len()];
    for _ in 0..runs {
        let noisy: Vec<MarkerObservation> =
            exact.iter().map(|m| MarkerObservation { pixel: m.pixel.map(|x| x + SIGMA_PX * normal()), ..*m }).collect();
        let fit = estimate_pose(&camera, &base.target, &named(&noisy)).unwrap().camera_from_board;
        for (sum, m) in squares.iter_mut().zip(&exact) {
            let [x, y] = base.target.point(m.index);
            let p = nalgebra::Point3::new(x, y, 0.0);
            *sum += ((fit * p).z / (pose * p).z - 1.0).powi(2);
        }
    }
    let largest_scatter = squares.iter().fold(0.0, |a: f64, s| a.max(s / f64::from(runs))).sqrt();
    // The standard deviation of 400 draws has a relative error of 3.5 %.
    assert!((largest_scatter / predicted - 1.0).abs() < 0.12, "{largest_scatter} for {predicted}");
}
