//! The greedy choice of poses.

use depthcal_model::{Context, Quantities};
use depthcal_statistics::quantile;
use nalgebra::{DMatrix, DVector, Isometry3};
use rayon::prelude::*;
use thiserror::Error;

use super::error::Error;
use super::goal::{Goal, GoalError};
use super::pose::{BoardTilt, ImagePlace, ProposedFrame};
use super::predicted::{pose_showing, predicted_frame, seen_markers};
use crate::adjust::adjustment::Adjustment;
use crate::adjust::frame_information::Curvature;
use crate::adjust::state::{RigFrame, State};
use crate::observe::board_pixels::board_area_px;
use crate::observe::board_region::BoardRegion;
use crate::observe::noise::NoiseModel;
use crate::observe::{CameraFrames, SampledFrame, Taken};

/// Distance of the farthest proposed frame over the largest depth that was captured.
const FARTHER: f64 = 1.3;
/// Number of distances of the grid of poses.
const DISTANCES: usize = 5;
/// How far towards its place at the border of the image the board is moved, so that all of it is seen: as far as possible.
const SHIFTS: [f64; 4] = [1.0, 0.75, 0.5, 0.25];
/// Most frames that are forecast.
const MOST_FRAMES: usize = 200;
/// Share by which a frame has to lower the goal's root mean square for more frames to be worth it.
const WORTHWHILE: f64 = 0.002;

/// Why no captures can be planned.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum PlanError {
    /// The goal means nothing for this camera.
    #[error(transparent)]
    Goal(#[from] GoalError),
    /// The fit leaves parameters open.
    #[error("these frames leave parameters open, so that nothing can be planned: add frames, or give --prior")]
    Undetermined,
    /// The rig has no such camera.
    #[error("there is no camera '{name}': there are {known}")]
    NoCamera {
        /// The name.
        name: String,
        /// Names of the cameras.
        known: String,
    },
    /// The board is nowhere seen as a whole.
    #[error("no pose of the grid shows the whole board: is the board larger than the image at every distance?")]
    NoPose,
}

/// A pose that is worth capturing, and where it leads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Planned {
    /// The view of the board.
    pub frame: ProposedFrame,
    /// Its pose in the frame of the rig.
    pub rig_from_board: Isometry3<f64>,
    /// Root mean square of the goal's error that is expected with this frame and those before it.
    pub expected: f64,
}

/// Proposed captures.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Root mean square of the goal's error that is expected of the present fit.
    pub now: f64,
    /// The value that it is below with a probability of 95 %.
    pub now_certain: f64,
    /// Poses in the order in which to capture them.
    pub poses: Vec<Planned>,
    /// Number of such frames until the goal's error is within the target with a probability of 95 %: 0 where it is already,
    /// `None` where more frames do not get there.
    pub frames_needed: Option<usize>,
    /// The value that the goal's error is below with a probability of 95 % after the last frame that was forecast.
    pub reachable: f64,
}

/// The information of a fit, and that which every pose of a grid would add.
#[derive(Debug, Clone)]
pub struct Planner {
    /// Covariance of the fit, in units of standard deviations.
    covariance: DMatrix<f64>,
    /// Information of the fitted frames in their order, computed as that of the poses.
    pub(super) frames: Vec<DMatrix<f64>>,
    /// Its sum.
    fitted: DMatrix<f64>,
    /// The grid of poses with their information.
    poses: Vec<(ProposedFrame, Isometry3<f64>, DMatrix<f64>)>,
    /// Places of the camera's parameters among the rows of `precision`, those in its θ, and their standard deviations.
    of_camera: (Vec<usize>, Vec<usize>, Vec<f64>),
    camera: depthcal_model::Camera,
    conditions: Context,
    /// Range of the fitted depth, mm.
    pub range_mm: [f64; 2],
}

impl Planner {
    /// The planner for one camera of a fit, given by its number. `covariance` is that of all parameters
    /// ([`State::parameter_rows`]), zero for held ones.
    ///
    /// # Errors
    ///
    /// [`PlanError::Undetermined`], [`PlanError::NoPose`].
    pub fn new(state: &State, number: usize, covariance: &DMatrix<f64>) -> Result<Self, PlanError> {
        let camera = state.cameras.get(number).ok_or(PlanError::NoPose)?;
        let conditions = conditions(&camera.capture);
        let depths = fitted_depths(&camera.capture);
        let range_mm = [0.01, 0.99].map(|q| quantile(depths.iter().copied(), q));
        let candidates = grid(state, number, range_mm);
        if candidates.is_empty() {
            return Err(PlanError::NoPose);
        }
        let poses: Vec<Isometry3<f64>> = candidates.iter().map(|(_, pose)| *pose).collect();
        let (predicted, weights) = predicted_state(state, &poses, &conditions);
        let adjustment = Adjustment::of_state(&predicted, true).map_err(|_| PlanError::Undetermined)?;
        let rows = adjustment.free_rows();
        let of_free = covariance.select_rows(&rows).select_columns(&rows);
        let std_devs: Vec<f64> = of_free.diagonal().iter().map(|v| v.sqrt()).collect();
        if std_devs.iter().any(|s| !(*s > 0.0 && s.is_finite())) {
            return Err(PlanError::Undetermined);
        }
        let n = rows.len();
        let correlation = DMatrix::from_fn(n, n, |i, k| of_free[(i, k)] / (std_devs[i] * std_devs[k]));
        let information = adjustment.frame_information_weighted(Curvature::OfWeights, |frame| weights[frame]);
        let scaled = |m: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, k| m[(i, k)] * std_devs[i] * std_devs[k]);
        let frames: Vec<DMatrix<f64>> = information_of_fitted(state, &rows)?.iter().map(scaled).collect();
        let fitted = frames.iter().fold(DMatrix::zeros(n, n), |sum, frame| sum + frame);
        let poses = candidates.into_iter().zip(information).map(|((f, p), i)| (f, p, scaled(&i.fitted.0))).collect();
        let blocks = state.parameter_rows().get(number).map_or(0..0, |rows| rows.blocks.clone());
        let places: Vec<usize> = (0..n).filter(|i| blocks.contains(&rows[*i])).collect();
        let in_theta = places.iter().map(|i| rows[*i] - blocks.start).collect();
        let of_places = places.iter().map(|i| std_devs[*i]).collect();
        let of_camera = (places, in_theta, of_places);
        Ok(Self {
            covariance: correlation,
            frames,
            fitted,
            poses,
            of_camera,
            camera: camera.camera.clone(),
            conditions,
            range_mm,
        })
    }

    /// The goal where none is asked for: corrected depth over the range that was seen.
    pub fn default_goal(&self) -> Goal {
        Goal::Depth { range_mm: self.range_mm }
    }

    /// The goal's weight of all free parameters, and the variances that the fit has over those of its frames' information.
    pub(super) fn weight_and_scale(&self, goal: &Goal) -> Result<(DMatrix<f64>, f64), PlanError> {
        let (places, in_theta, std_devs) = &self.of_camera;
        let of_camera = goal.weight(&self.camera, &self.conditions, (in_theta, std_devs))?;
        let n = self.fitted.nrows();
        let mut weight = DMatrix::zeros(n, n);
        for (i, row) in places.iter().enumerate() {
            for (k, column) in places.iter().enumerate() {
                weight[(*row, *column)] = of_camera[(i, k)];
            }
        }
        let of_fitted = inverse(&self.fitted).ok_or(PlanError::Undetermined)?;
        let [of_fit, of_frames] = [&self.covariance, &of_fitted].map(|c| Error::mean_square_of(c, &weight));
        Ok((weight, of_fit / of_frames))
    }

    /// The `count` poses that lower a goal most, one after another, and how many are needed until its error is at most `target`.
    ///
    /// # Errors
    ///
    /// [`PlanError::Goal`].
    pub fn plan(&self, goal: &Goal, target: f64, count: usize) -> Result<Plan, PlanError> {
        let (weight, scale) = self.weight_and_scale(goal)?;
        let now = Error::of(&self.covariance, &weight);
        let mut plan = Plan {
            now: now.mean_square.sqrt(),
            now_certain: now.certain(),
            poses: Vec::new(),
            frames_needed: (now.certain() <= target).then_some(0),
            reachable: now.certain(),
        };
        let (mut precision, mut last) = (self.fitted.clone(), now.mean_square);
        let mut gains = vec![f64::INFINITY; self.poses.len()];
        for frames in 1..=MOST_FRAMES {
            let gain = |number: usize| {
                let with = inverse(&(&precision + &self.poses[number].2));
                with.map_or(f64::NEG_INFINITY, |c| last - scale * Error::mean_square_of(&c, &weight))
            };
            let Some(number) = largest(&mut gains, gain, frames == 1 || plan.poses.len() < count) else { break };
            let (frame, rig_from_board, more) = &self.poses[number];
            precision += more;
            let Some(covariance) = inverse(&precision) else { break };
            let error = Error::of(&(covariance * scale), &weight);
            if plan.poses.len() < count {
                let expected = error.mean_square.sqrt();
                plan.poses.push(Planned { frame: *frame, rig_from_board: *rig_from_board, expected });
            }
            plan.reachable = error.certain();
            if plan.frames_needed.is_none() && error.certain() <= target {
                plan.frames_needed = Some(frames);
            }
            let gain = 1.0 - (error.mean_square / last).sqrt();
            let is_known = plan.frames_needed.is_some() || gain < WORTHWHILE;
            if is_known && plan.poses.len() >= count {
                break;
            }
            last = error.mean_square;
        }
        Ok(plan)
    }
}

/// The pose with the largest gain; `None` where none has a finite one. `gains` are those of earlier frames, at first infinite,
/// and are brought up to date: of all poses where `exact`, else only of those that had more before than the best has now. Gains
/// fall with every frame, so that the others have no more (the lazy greedy choice, Minoux 1978).
fn largest(gains: &mut [f64], gain: impl Fn(usize) -> f64 + Sync, exact: bool) -> Option<usize> {
    if exact {
        gains.par_iter_mut().enumerate().for_each(|(number, of_pose)| *of_pose = gain(number));
    }
    let mut is_new = vec![exact; gains.len()];
    loop {
        let best = (0..gains.len()).rev().max_by(|a, b| gains[*a].total_cmp(&gains[*b]))?;
        if is_new[best] {
            return (gains[best] > f64::NEG_INFINITY).then_some(best);
        }
        (gains[best], is_new[best]) = (gain(best), true);
    }
}

/// Information of every fitted frame on the free parameters, whose rows these are, with depth that counts as that of a pose does.
fn information_of_fitted(state: &State, rows: &[usize]) -> Result<Vec<DMatrix<f64>>, PlanError> {
    let mut state = state.clone();
    let mut weights = vec![1.0; state.frames.len()];
    for camera in &mut state.cameras {
        camera.offset_s = None;
        let correlated = frame_correlation(&camera.noise);
        for (number, frame) in camera.frames.iter().zip(&camera.capture.frames) {
            if !frame.samples.is_empty() {
                weights[*number] = 1.0 / (1.0 + frame.samples.len() as f64 * correlated);
            }
        }
    }
    let adjustment = Adjustment::of_state(&state, true).map_err(|_| PlanError::Undetermined)?;
    if adjustment.free_rows() != rows {
        return Err(PlanError::Undetermined);
    }
    let frames = adjustment.frame_information_weighted(Curvature::OfWeights, |frame| weights[frame]);
    Ok(frames.into_iter().map(|frame| frame.fitted.0).collect())
}

/// Inverse of a positive definite matrix whose diagonal has about one size.
pub(super) fn inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale: DVector<f64> = matrix.diagonal().map(|d| d.max(f64::MIN_POSITIVE).sqrt().recip());
    let scaled = DMatrix::from_fn(matrix.nrows(), matrix.nrows(), |i, k| matrix[(i, k)] * scale[i] * scale[k]);
    let inverse = scaled.cholesky()?.inverse();
    Some(DMatrix::from_fn(matrix.nrows(), matrix.nrows(), |i, k| inverse[(i, k)] * scale[i] * scale[k]))
}

/// Depth of the fitted samples, else of the boards, mm.
fn fitted_depths(capture: &CameraFrames<SampledFrame>) -> Vec<f64> {
    let samples: Vec<f64> = capture.frames.iter().flat_map(|f| f.samples.iter().map(|s| s.depth_mm)).collect();
    if samples.is_empty() { capture.poses().map(|p| p.translation.vector.z).collect() } else { samples }
}

/// Conditions in the middle of those of the fit.
fn conditions(capture: &CameraFrames<SampledFrame>) -> Context {
    let contexts = || capture.frames.iter().flat_map(|f| f.samples.iter().map(|s| s.context));
    let middle = |value: fn(&Context) -> f64| quantile(contexts().map(|c| value(&c)), 0.5);
    Context {
        amplitude: middle(|c| c.amplitude),
        time_s: if contexts().next().is_some() { middle(|c| c.time_s) } else { 0.0 },
        temperature_c: middle(|c| c.temperature_c),
        quantities: Quantities::summarized(capture.frames.iter().map(|f| &f.quantities), |values| {
            quantile(values, 0.5)
        }),
        ..Context::default()
    }
}

/// Poses over distance, place and tilt in which a camera sees the whole board.
fn grid(state: &State, number: usize, [near, far]: [f64; 2]) -> Vec<(ProposedFrame, Isometry3<f64>)> {
    let placed = &state.cameras[number];
    let (camera, target) = (&placed.camera, &placed.capture.target);
    let size = [camera.width as f64, camera.height as f64];
    let far = FARTHER * far;
    let views = (0..DISTANCES).flat_map(|step| {
        let t = step as f64 / (DISTANCES - 1) as f64;
        let distance_mm = near * (far / near).powf(t);
        let views = ImagePlace::ALL.into_iter().flat_map(|place| BoardTilt::ALL.map(|tilt| (place, tilt)));
        views.map(move |(place, tilt)| ProposedFrame { distance_mm, place, tilt, warmer_c: None })
    });
    let posed = |frame: ProposedFrame| {
        let pose = SHIFTS.iter().find_map(|shift| {
            let pixel = [0, 1].map(|i| size[i] * (0.5 + shift * (frame.place.position()[i] - 0.5)));
            let pose = pose_showing(camera, target, frame.distance_mm, pixel, frame.tilt.angles_deg())?;
            seen_markers(camera, target, &pose).map(|_| pose)
        });
        pose.map(|pose| (frame, placed.camera_from_rig.inverse() * pose))
    };
    views.collect::<Vec<_>>().into_par_iter().filter_map(posed).collect()
}

/// A state of the same cameras whose frames are those of the poses, as all cameras that see the whole board observe them; and for
/// each frame how many times its depth counts.
fn predicted_state(state: &State, poses: &[Isometry3<f64>], conditions: &Context) -> (State, Vec<f64>) {
    let frame = |(i, pose): (usize, &Isometry3<f64>)| RigFrame {
        name: format!("predicted {i}"),
        rig_from_board: *pose,
        board: 0,
        metadata: Default::default(),
        taken: Taken { time_s: conditions.time_s, temperature_c: conditions.temperature_c },
        motion: None,
    };
    let mut weights = vec![1.0; poses.len()];
    let mut cameras = state.cameras.clone();
    for camera in &mut cameras {
        let [density, most] = sample_density(&camera.capture, &camera.camera);
        let correlated = frame_correlation(&camera.noise);
        let with_markers = camera.has_markers();
        let target = camera.capture.target.clone();
        let region = BoardRegion::new(&target);
        let (mut frames, mut numbers) = (Vec::new(), Vec::new());
        let seen = poses.par_iter().map(|pose| {
            let in_camera = camera.camera_from_rig * pose;
            predicted_frame(&camera.camera, &target, &in_camera, conditions)
        });
        let seen: Vec<Option<SampledFrame>> = seen.collect();
        for (i, seen) in seen.into_iter().enumerate() {
            let Some(mut seen) = seen else { continue };
            if most == 0.0 {
                seen.samples = Vec::new().into();
            } else {
                let area = board_area_px(&camera.camera, &region, &seen.camera_from_board) as f64;
                let count = (density * area).min(most);
                weights[i] = count / (1.0 + count * correlated) / seen.samples.len().max(1) as f64;
            }
            if !with_markers {
                seen.posed.detected.markers.clear();
            }
            frames.push(seen);
            numbers.push(i);
        }
        camera.capture = camera.capture.with_frames(frames);
        camera.frames = numbers;
        camera.offset_s = None;
    }
    (State { frames: poses.iter().enumerate().map(frame).collect(), cameras }, weights)
}

/// Depth samples per pixel of the board in the median fitted frame, and most of any frame; zeros without depth.
fn sample_density(capture: &CameraFrames<SampledFrame>, camera: &depthcal_model::Camera) -> [f64; 2] {
    let with_depth = || capture.frames.iter().filter(|frame| !frame.samples.is_empty());
    if with_depth().next().is_none() {
        return [0.0; 2];
    }
    let density = |frame: &SampledFrame| {
        let region = BoardRegion::within_markers(&capture.target, &frame.markers);
        frame.samples.len() as f64 / board_area_px(camera, &region, &frame.camera_from_board).max(1) as f64
    };
    let most = with_depth().map(|frame| frame.samples.len()).max().unwrap_or(0);
    [quantile(with_depth().map(density), 0.5), most as f64]
}

/// Variance of frames' own planes over that of a sample's noise, where depth does not weigh less for it already.
fn frame_correlation(noise: &NoiseModel) -> f64 {
    let [constant, u, v, _] = noise.planes.deviations;
    if noise.planes.design_effect > 1.0 { 0.0 } else { (constant * constant + u * u + v * v) / 3.0 }
}
