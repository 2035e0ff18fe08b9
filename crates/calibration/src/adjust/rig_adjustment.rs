//! The factor graph of a rig.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::adjust::adjustment::{HUBER, batch_redundancy};
use crate::adjust::blocks::is_depth_only;
use crate::adjust::smoothness_prior::SmoothnessBatch;
use crate::observe::{DepthSample, PosedFrame, SampledFrame};
use depthcal_model::Target;
use depthcal_model::chain::{DepthQuery, Workspace};
use depthcal_model::hook::HookKind;
use depthcal_solver::score::{Candidate, Linearization, ScoreError};
use depthcal_solver::{
    BatchId, Covariance, CovarianceError, CovarianceOptions, Graph, Key, Loss, NoiseError, Options, Prior, Report,
    SolveError, Values, VariableId, minimize,
};
use nalgebra::{DMatrix, DVector, Isometry3};

use super::rig_factors::{CameraVariables, Observations, RigBatch, RigGroup};
use crate::adjust::rig_state::{CameraState, RigState};
use crate::observe::board_motion::BoardMotion;

/// The problem of all cameras and frames of a rig: a pose per frame, a place per camera but the reference, a variable per
/// parameter block. Board pieces of the same name are one variable: there is one board.
pub struct RigAdjustment {
    graph: Graph,
    values: Values,
    frames: Vec<Key<Isometry3<f64>>>,
    cameras: Vec<OfCamera>,
}

/// Variables and batches of a camera.
struct OfCamera {
    place: Option<Key<Isometry3<f64>>>,
    drift: Option<Key<DVector<f64>>>,
    offset: Option<Key<DVector<f64>>>,
    blocks: Vec<Key<DVector<f64>>>,
    image: Option<BatchId>,
    depth: Option<BatchId>,
    /// Standard deviations of its depth samples, 1/mm, frame after frame.
    depth_sigmas: Vec<f64>,
}

/// A solved adjustment.
pub struct Adjusted {
    /// `rig_from_board` of every frame.
    pub rig_from_board: Vec<Isometry3<f64>>,
    /// `camera_from_rig` of every camera.
    pub camera_from_rig: Vec<Isometry3<f64>>,
    /// How the place of every camera changes, ω and τ; `None` where it does not.
    pub drift: Vec<Option<[f64; 6]>>,
    /// By how much every camera exposes later than its times say, s; `None` where that is not asked.
    pub offset_s: Vec<Option<f64>>,
    /// Parameters of every camera, in the order of [`depthcal_model::Camera::theta`].
    pub theta: Vec<Vec<f64>>,
    /// Whitened residuals of every camera's markers, u, v per marker, frame after frame.
    pub image_residuals: Vec<Vec<f64>>,
    /// Residuals of every camera's depth samples in inverse depth, predicted minus measured, 1/mm, frame after frame.
    pub depth_residuals: Vec<Vec<f64>>,
    /// How the solver went.
    pub report: Report,
}

impl Adjusted {
    /// Gives a state the values of its adjustment.
    pub fn give(&self, state: &mut RigState) {
        for (frame, pose) in state.frames.iter_mut().zip(&self.rig_from_board) {
            frame.rig_from_board = *pose;
        }
        for ((camera, theta), place) in state.cameras.iter_mut().zip(&self.theta).zip(&self.camera_from_rig) {
            camera.camera = camera.camera.with_theta(theta);
            camera.camera_from_rig = *place;
        }
        for (camera, change) in state.cameras.iter_mut().zip(&self.drift) {
            if let (Some(drift), Some(change)) = (&mut camera.drift, change) {
                drift.change = *change;
            }
        }
        for (camera, offset_s) in state.cameras.iter_mut().zip(&self.offset_s) {
            if let (Some(own), Some(found)) = (&mut camera.offset_s, offset_s) {
                *own = *found;
            }
        }
        state.place_boards();
    }
}

impl RigAdjustment {
    /// The problem with the values of a state.
    ///
    /// # Errors
    ///
    /// [`NoiseError`] where a prior has no finite standard deviation.
    pub fn new(state: &RigState) -> Result<Self, NoiseError> {
        let (mut graph, mut values) = (Graph::new(), Values::new());
        let frames: Vec<Key<Isometry3<f64>>> = state.frames.iter().map(|f| values.insert(f.rig_from_board)).collect();
        for (key, frame) in frames.iter().zip(&state.frames) {
            graph.label(*key, format!("pose of {}", frame.name));
        }
        graph.eliminate(frames.iter().copied());
        let mut of_board: BTreeMap<&'static str, Key<DVector<f64>>> = BTreeMap::new();
        let mut cameras = Vec::new();
        for (number, camera) in state.cameras.iter().enumerate() {
            let place = (number > 0).then(|| values.insert(camera.camera_from_rig));
            if let Some(place) = place {
                graph.label(place, format!("{}/camera_from_rig", camera.name));
            }
            let drift = place.and(camera.drift.as_ref()).map(|d| values.insert(DVector::from_column_slice(&d.change)));
            if let Some(drift) = drift {
                graph.label(drift, format!("{}/extrinsics_drift", camera.name));
            }
            let offset = place.and(camera.offset_s).map(|s| values.insert(DVector::from_element(1, s)));
            if let Some(offset) = offset {
                graph.label(offset, format!("{}/time_offset", camera.name));
            }
            let has_depth = camera.has_depth();
            let mut variable = |block: &depthcal_model::Block| {
                let key = values.insert(DVector::from_column_slice(&block.theta));
                graph.label(key, format!("{}/{}", camera.name, block.name()));
                let held: Vec<bool> =
                    block.free.iter().map(|f| !(*f && (has_depth || !is_depth_only(block)))).collect();
                graph.fix_partly(key, &held);
                key
            };
            let blocks: Vec<Key<DVector<f64>>> = camera
                .camera
                .blocks()
                .iter()
                .map(|block| match block.hook() {
                    HookKind::Board => *of_board.entry(block.name()).or_insert_with(|| variable(block)),
                    _ => variable(block),
                })
                .collect();
            for (block, key) in camera.camera.blocks().iter().zip(&blocks) {
                let rows = camera.smoothness.rows(block);
                if !rows.is_empty() {
                    graph.add_batch(SmoothnessBatch::new(block, *key, rows));
                }
            }
            for (number, (block, key)) in camera.camera.blocks().iter().zip(&blocks).enumerate() {
                let own: Vec<_> = camera.priors.iter().filter(|p| p.block == number).collect();
                if own.is_empty() {
                    continue;
                }
                let mut mean = DVector::from_column_slice(&block.theta);
                let mut information = DMatrix::zeros(own.len(), block.theta.len());
                for (row, prior) in own.iter().enumerate() {
                    mean[prior.component] = prior.mean;
                    information[(row, prior.component)] = 1.0 / prior.sigma;
                }
                let name = format!("{}/prior of {}", camera.name, block.name());
                graph.add_batch(Prior::square_root_information(name, *key, mean, information)?);
            }
            let image_blocks = camera.camera.blocks().iter().filter(|b| !is_depth_only(b)).count();
            let chain = Arc::new(camera.camera.chain());
            let variables = CameraVariables { chain, place, drift, offset, blocks: blocks.clone(), image_blocks };
            let loss = || Loss::Huber { delta: HUBER };
            let at = frames_at(camera, state, &frames);
            let groups = markers(camera, &at);
            let image = (!groups.is_empty()).then(|| {
                let name = format!("{}/image", camera.name);
                graph.add_batch(RigBatch::of_markers(name, variables.clone(), groups, loss()))
            });
            let groups = depth(camera, &at);
            let depth_sigmas = groups.iter().flat_map(|group| group.observed.sigmas()).copied().collect();
            let depth = (!groups.is_empty()).then(|| {
                let name = format!("{}/depth", camera.name);
                graph.add_batch(RigBatch::of_depth(name, variables, groups, loss()))
            });
            cameras.push(OfCamera { place, drift, offset, blocks, image, depth, depth_sigmas });
        }
        Ok(Self { graph, values, frames, cameras })
    }

    /// Minimises the problem until a step decreases the cost by no more than `decrease`.
    ///
    /// # Errors
    ///
    /// [`SolveError`].
    pub fn solve_within(&mut self, decrease: f64) -> Result<Adjusted, SolveError> {
        let options = Options { decrease_tolerance: decrease, ..Options::default() };
        let solution = minimize(&self.graph, self.values.clone(), &options)?;
        self.values = solution.values;
        let residuals =
            |batch: Option<BatchId>| batch.and_then(|b| self.graph.residuals(b, &self.values).ok()).unwrap_or_default();
        let in_inverse_depth = |camera: &OfCamera| {
            residuals(camera.depth).iter().zip(&camera.depth_sigmas).map(|(r, sigma)| r * sigma).collect()
        };
        let theta =
            |camera: &OfCamera| camera.blocks.iter().flat_map(|k| self.values.get(*k).iter().copied()).collect();
        let place = |camera: &OfCamera| camera.place.map_or_else(Isometry3::identity, |key| *self.values.get(key));
        let drift = |camera: &OfCamera| camera.drift.map(|key| std::array::from_fn(|i| self.values.get(key)[i]));
        Ok(Adjusted {
            rig_from_board: self.frames.iter().map(|key| *self.values.get(*key)).collect(),
            camera_from_rig: self.cameras.iter().map(place).collect(),
            drift: self.cameras.iter().map(drift).collect(),
            offset_s: self.cameras.iter().map(|c| c.offset.map(|key| self.values.get(key)[0])).collect(),
            theta: self.cameras.iter().map(theta).collect(),
            image_residuals: self.cameras.iter().map(|c| residuals(c.image)).collect(),
            depth_residuals: self.cameras.iter().map(in_inverse_depth).collect(),
            report: solution.report,
        })
    }

    /// Covariance of all variables at the present values.
    ///
    /// # Errors
    ///
    /// [`CovarianceError`], where the data leave a combination of parameters undetermined.
    pub fn covariance(&self) -> Result<Covariance, CovarianceError> {
        Covariance::compute(&self.graph, &self.values, &CovarianceOptions::default())
    }

    /// Linearises the problem at the present values, frame by frame, with blocks of a camera as candidates: name and number of each, all
    /// of whose parameters are held.
    ///
    /// # Errors
    ///
    /// [`ScoreError`] where a factor cannot be evaluated, or a candidate is not held.
    pub fn linearize(
        &self,
        camera: usize,
        candidates: impl Iterator<Item = (String, usize)>,
    ) -> Result<Linearization, ScoreError> {
        let poses: Vec<VariableId> = self.frames.iter().map(|key| key.id()).collect();
        let blocks = &self.cameras[camera].blocks;
        let candidates: Vec<Candidate> = candidates.map(|(name, block)| Candidate::new(name, blocks[block])).collect();
        Linearization::new(&self.graph, &self.values, &poses, &candidates)
    }

    /// Holds everything but the poses of the board.
    pub fn hold_cameras(&mut self) {
        for camera in &self.cameras {
            camera.place.iter().for_each(|key| self.graph.fix(*key));
            camera.drift.iter().for_each(|key| self.graph.fix(*key));
            camera.offset.iter().for_each(|key| self.graph.fix(*key));
            camera.blocks.iter().for_each(|key| self.graph.fix(*key));
        }
    }

    /// Whitened residuals of a camera's markers and depth samples at the present values.
    pub fn whitened(&self, camera: usize) -> [Vec<f64>; 2] {
        let of = |b: Option<BatchId>| b.and_then(|b| self.graph.residuals(b, &self.values).ok()).unwrap_or_default();
        [of(self.cameras[camera].image), of(self.cameras[camera].depth)]
    }

    /// The variable of a camera's drift.
    pub fn drift_variable(&self, camera: usize) -> Option<VariableId> {
        self.cameras[camera].drift.map(|key| key.id())
    }

    /// The variable of a camera's time offset.
    pub fn offset_variable(&self, camera: usize) -> Option<VariableId> {
        self.cameras[camera].offset.map(|key| key.id())
    }

    /// Variables of the cameras in order: of each its place, but of the reference, the drift of the place and the offset of its time where
    /// it has them, and its blocks.
    pub fn variables(&self) -> Vec<VariableId> {
        let of = |camera: &OfCamera| {
            let place = camera.place.iter().map(|k| k.id()).chain(camera.drift.iter().map(|k| k.id()));
            let offset = camera.offset.iter().map(|k| k.id());
            place.chain(offset).chain(camera.blocks.iter().map(|k| k.id())).collect::<Vec<_>>()
        };
        self.cameras.iter().flat_map(of).collect()
    }

    /// Redundancies of a camera's markers and of its depth samples.
    pub fn redundancies(&self, camera: usize, covariance: &Covariance) -> [f64; 2] {
        let of = |batch: Option<BatchId>| {
            let batch = batch.and_then(|b| self.graph.batch(b));
            batch.map_or(0.0, |batch| batch_redundancy(batch, &self.values, covariance))
        };
        [of(self.cameras[camera].image), of(self.cameras[camera].depth)]
    }
}

/// A frame of a camera among the variables of the rig.
struct FrameAt {
    pose: Key<Isometry3<f64>>,
    drifted: f64,
    moving: Option<(BoardMotion, f64)>,
}

impl FrameAt {
    fn group(&self, observed: Observations) -> RigGroup {
        RigGroup { frame: self.pose, drifted: self.drifted, moving: self.moving, observed }
    }
}

/// The frames of a camera, given the keys of the rig's.
fn frames_at(camera: &CameraState, state: &RigState, poses: &[Key<Isometry3<f64>>]) -> Vec<FrameAt> {
    let at = |(own, number): (&SampledFrame, &usize)| {
        let frame = &state.frames[*number];
        FrameAt {
            pose: poses[*number],
            drifted: camera.drift.as_ref().map_or(0.0, |drift| drift.share(&frame.taken)),
            moving: camera.offset_s.and(frame.motion).map(|motion| (motion, frame.later_s(own))),
        }
    };
    camera.capture.frames.iter().zip(&camera.frames).map(at).collect()
}

fn markers(camera: &CameraState, at: &[FrameAt]) -> Vec<RigGroup> {
    let group = |(frame, at): (&PosedFrame, &FrameAt)| {
        let target: &Target = &camera.capture.target;
        at.group(Observations::Markers {
            points: frame.markers.iter().map(|m| target.point(m.index)).collect(),
            pixels: frame.markers.iter().map(|m| m.pixel).collect(),
            sigmas: frame.markers.iter().map(|m| m.std_px * camera.noise.pixel_sigma).collect(),
        })
    };
    let posed = camera.capture.frames.iter().map(|f| &f.posed).zip(at);
    posed.filter(|(frame, _)| !frame.markers.is_empty()).map(group).collect()
}

/// Groups of depth samples. Their standard deviations are those at the inverse depth that the state predicts: at the measured one,
/// samples with an error towards far would have more weight than those towards near.
fn depth(camera: &CameraState, at: &[FrameAt]) -> Vec<RigGroup> {
    let chain = camera.camera.chain();
    let theta = camera.camera.theta();
    let mut work = Workspace::default();
    let mut group = |(frame, of): (&SampledFrame, &FrameAt)| {
        let samples: &[DepthSample] = &frame.samples;
        let inverse_depths: Vec<f64> = samples.iter().map(|s| 1.0 / s.depth_mm).collect();
        let queries: Vec<DepthQuery> =
            samples.iter().map(|s| DepthQuery { board_seed: s.board_seed, context: s.context }).collect();
        let mut predicted = vec![0.0; queries.len()];
        let mut points = vec![[0.0; 2]; queries.len()];
        let pose = &frame.camera_from_board;
        let at = match chain.depth(&mut work, &theta, pose, &queries, &mut predicted, &mut points, None) {
            Ok(()) => &predicted,
            // The solver meets the same error and says which.
            Err(_) => &inverse_depths,
        };
        let sigmas = at.iter().map(|rho| camera.noise.depth.sigma(*rho)).collect();
        of.group(Observations::Depth { queries, inverse_depths, sigmas })
    };
    let sampled = camera.capture.frames.iter().zip(at);
    sampled.filter(|(frame, _)| !frame.samples.is_empty()).map(&mut group).collect()
}
