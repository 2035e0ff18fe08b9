//! The joint adjustment: cameras with lens and depth distortion, their extrinsics and the board's poses in one least-squares
//! problem.

use std::collections::BTreeMap;

use depthcal_model::Camera;
use depthcal_solver::score::{Candidate, Linearization, ScoreError};
use depthcal_solver::{
    BatchId, Covariance, CovarianceError, CovarianceOptions, Damping, Graph, Key, LinearSolver, NoiseError, Options,
    Prior, Report, SolveError, Values, VariableId, minimize,
};
use nalgebra::{DMatrix, DVector, Isometry3};

use super::blocks::{BlockKeys, is_depth_only};
use super::camera_keys::{CameraKeys, camera_keys};
use super::camera_prior::{CameraPrior, CameraPriorBatch};
use super::observations::add_observations;
use super::problem::Problem;
use super::redundancy::batch_redundancy;
use super::smoothness_prior::{Smoothness, SmoothnessBatch, rows_of_smooth_functions};
use super::state::{CameraState, State};
use crate::observe::noise::NoiseModel;
use crate::observe::{AdjustableFrame, CameraFrames};

/// Damping at the start, relative to the largest diagonal entry of the scaled normal matrix, near the minimum: next to none.
const NEAR: f64 = 1e-8;

/// A calibration problem on a factor graph: a pose of the board per frame, extrinsics per camera but the reference, and a
/// variable per parameter block. Board pieces of the same name are one variable of all cameras: there is one board.
pub struct Adjustment {
    pub(super) graph: Graph,
    pub(super) values: Values,
    pub(super) poses: Vec<Key<Isometry3<f64>>>,
    pub(super) cameras: Vec<CameraKeys>,
}

/// A solved adjustment.
pub struct Adjusted {
    /// `rig_from_board` of every frame.
    pub rig_from_board: Vec<Isometry3<f64>>,
    /// The cameras.
    pub cameras: Vec<AdjustedCamera>,
    /// How the solver went.
    pub report: Report,
}

/// A camera after an adjustment.
pub struct AdjustedCamera {
    /// The camera with its adjusted parameters.
    pub camera: Camera,
    /// Its extrinsics; the identity for the reference.
    pub camera_from_rig: Isometry3<f64>,
    /// How its extrinsics change, ω and τ; `None` where they do not.
    pub drift: Option<[f64; 6]>,
    /// By how much it exposes later than its times say, s; `None` where that is not estimated.
    pub offset_s: Option<f64>,
    /// Residuals of its markers, whitened: u, v per marker, frame after frame.
    pub image_residuals: Vec<f64>,
    /// Residuals of its depth samples, predicted minus measured inverse depth, whitened, frame after frame.
    pub depth_residuals: Vec<f64>,
    /// The standard deviations that whitened the depth residuals, 1/mm.
    pub depth_sigmas: Vec<f64>,
}

impl AdjustedCamera {
    /// Residuals of its depth samples, predicted minus measured inverse depth, 1/mm, frame after frame.
    pub fn inverse_depth_residuals(&self) -> impl Iterator<Item = f64> + '_ {
        self.depth_residuals.iter().zip(&self.depth_sigmas).map(|(r, sigma)| r * sigma)
    }
}

impl Adjusted {
    /// Number of whitened residuals.
    pub fn residual_count(&self) -> usize {
        self.cameras.iter().map(|c| c.image_residuals.len() + c.depth_residuals.len()).sum()
    }

    /// Whether the solver has converged, or the residuals are so far below any noise that rounding hides the descent: those of
    /// exact observations.
    pub fn has_converged(&self) -> bool {
        self.report.converged || self.report.cost < 1e-6 * self.residual_count() as f64
    }

    /// Gives a state the values of its adjustment.
    pub fn give<F: AdjustableFrame>(&self, state: &mut State<F>) {
        for (frame, pose) in state.frames.iter_mut().zip(&self.rig_from_board) {
            frame.rig_from_board = *pose;
        }
        for (camera, adjusted) in state.cameras.iter_mut().zip(&self.cameras) {
            camera.camera = adjusted.camera.clone();
            camera.camera_from_rig = adjusted.camera_from_rig;
            if let (Some(drift), Some(change)) = (&mut camera.drift, adjusted.drift) {
                drift.change = change;
            }
            if let (Some(offset_s), Some(estimate_s)) = (&mut camera.offset_s, adjusted.offset_s) {
                *offset_s = estimate_s;
            }
        }
        state.place_boards();
    }
}

impl Adjustment {
    /// The problem of all frames of one camera; depth samples take part where `with_depth`.
    pub fn new<F: AdjustableFrame>(
        capture: &CameraFrames<F>,
        camera: &Camera,
        noise: &NoiseModel,
        with_depth: bool,
    ) -> Self {
        Self::of_problem(&Problem::of_camera(capture, camera, noise, with_depth))
    }

    /// The problem of all cameras of a state, with the priors of its fields and parameters; depth samples take part where
    /// `with_depth`.
    ///
    /// # Errors
    ///
    /// [`NoiseError`] where a prior has no finite standard deviation.
    pub fn of_state<F: AdjustableFrame>(state: &State<F>, with_depth: bool) -> Result<Self, NoiseError> {
        let mut adjustment = Self::of_problem(&Problem::of_state(state, with_depth));
        for (number, camera) in state.cameras.iter().enumerate() {
            adjustment.add_smoothness(number, &camera.smoothness);
            adjustment.add_parameter_priors(number, camera)?;
            adjustment.add_camera_prior(number, camera.prior.as_deref());
        }
        Ok(adjustment)
    }

    /// The factor graph of a problem, without priors but those that pieces have themselves.
    pub fn of_problem<F: AdjustableFrame>(problem: &Problem<'_, F>) -> Self {
        let (mut graph, mut values) = (Graph::new(), Values::new());
        let mut of_board: BTreeMap<&'static str, Key<DVector<f64>>> = BTreeMap::new();
        let mut cameras: Vec<CameraKeys> =
            problem.cameras.iter().map(|camera| camera_keys(camera, &mut graph, &mut values, &mut of_board)).collect();
        let poses: Vec<Key<Isometry3<f64>>> = problem.frames.iter().map(|(_, pose)| values.insert(*pose)).collect();
        for (key, (name, _)) in poses.iter().zip(&problem.frames) {
            graph.label(*key, format!("pose of {name}"));
        }
        // Poses see all nodes of a fine field, and no order of elimination by blocks is good.
        if !cameras.iter().any(CameraKeys::by_node) {
            graph.eliminate(poses.iter().copied());
        }
        for (camera, keys) in problem.cameras.iter().zip(&mut cameras) {
            add_observations(camera, keys, &poses, &mut graph);
            add_smooth_functions(keys, &mut graph);
        }
        Self { graph, values, poses, cameras }
    }

    /// Adds the prior of the only camera's fields; without it fields that leave freedom to the data are not determined.
    #[must_use]
    pub fn with_smoothness(mut self, smoothness: &Smoothness) -> Self {
        self.add_smoothness(0, smoothness);
        self
    }

    fn add_smoothness(&mut self, number: usize, smoothness: &Smoothness) {
        let CameraKeys { camera, blocks, .. } = &self.cameras[number];
        for (block, key) in camera.blocks().iter().zip(blocks) {
            let rows = smoothness.rows(block);
            match key {
                _ if rows.is_empty() => {}
                BlockKeys::Whole(key) => _ = self.graph.add_batch(SmoothnessBatch::new(block, *key, rows)),
                BlockKeys::Nodes { layout, nodes, shared } => {
                    let keys: Vec<_> = nodes.iter().chain(shared).copied().collect();
                    self.graph.add_batch(SmoothnessBatch::by_node(block, layout, &keys, &rows));
                }
            }
        }
    }

    /// Adds the normal priors of single parameters of a camera.
    fn add_parameter_priors<F>(&mut self, number: usize, camera: &CameraState<F>) -> Result<(), NoiseError> {
        let keys = &self.cameras[number].blocks;
        for (block_number, (block, key)) in camera.camera.blocks().iter().zip(keys).enumerate() {
            let priors: Vec<_> = camera.priors.iter().filter(|p| p.block == block_number).collect();
            let BlockKeys::Whole(key) = key else { continue };
            if priors.is_empty() {
                continue;
            }
            let mut mean = DVector::from_column_slice(&block.theta);
            let mut information = DMatrix::zeros(priors.len(), block.theta.len());
            for (row, prior) in priors.iter().enumerate() {
                mean[prior.component] = prior.mean;
                information[(row, prior.component)] = 1.0 / prior.sigma;
            }
            let name = format!("{}/prior of {}", camera.name, block.name());
            self.graph.add_batch(Prior::square_root_information(name, *key, mean, information)?);
        }
        Ok(())
    }

    /// Adds the prior of the only camera's parameters from other units, where there is one.
    #[must_use]
    pub fn with_prior(mut self, prior: Option<&CameraPrior>) -> Self {
        self.add_camera_prior(0, prior);
        self
    }

    /// Adds the prior of a camera's parameters from other units, where there is one.
    pub fn add_camera_prior(&mut self, number: usize, prior: Option<&CameraPrior>) {
        let CameraKeys { camera, blocks, depth, .. } = &self.cameras[number];
        let whole = |block: &BlockKeys| if let BlockKeys::Whole(key) = block { Some(*key) } else { None };
        let keys: Vec<_> = blocks.iter().map(whole).collect();
        // Blocks that these data do not touch are held here, whatever the camera says.
        let in_use = camera.map_blocks(|mut block| {
            if depth.is_none() && is_depth_only(&block) {
                block.free.fill(false);
            }
            block
        });
        if let Some(batch) = prior.and_then(|prior| CameraPriorBatch::new(&in_use, &keys, prior)) {
            self.graph.add_batch(batch);
        }
    }

    /// Minimises the problem from its start values.
    ///
    /// # Errors
    ///
    /// [`SolveError`].
    pub fn solve(&mut self) -> Result<Adjusted, SolveError> {
        self.solve_within(0.0)
    }

    /// Minimises the problem until a step decreases the cost by no more than `decrease`.
    ///
    /// # Errors
    ///
    /// [`SolveError`].
    pub fn solve_within(&mut self, decrease: f64) -> Result<Adjusted, SolveError> {
        self.solve_damped(Damping::default(), decrease)
    }

    /// [`solve_within`](Self::solve_within) from start values that are near the minimum.
    ///
    /// # Errors
    ///
    /// [`SolveError`].
    pub fn refine_within(&mut self, decrease: f64) -> Result<Adjusted, SolveError> {
        self.solve_damped(Damping::Nielsen { tau: NEAR }, decrease)
    }

    fn solve_damped(&mut self, damping: Damping, decrease: f64) -> Result<Adjusted, SolveError> {
        // Poses see all nodes and no order of elimination by blocks is good: a minimum-degree order puts them last.
        let linear_solver = if self.by_node() { LinearSolver::SparseCholesky } else { LinearSolver::default() };
        let options = Options { linear_solver, damping, decrease_tolerance: decrease, ..Options::default() };
        let solution = minimize(&self.graph, self.values.clone(), &options)?;
        self.values = solution.values;
        Ok(Adjusted {
            rig_from_board: self.poses.iter().map(|k| *self.values.get(*k)).collect(),
            cameras: self.cameras.iter().map(|camera| self.adjusted_camera(camera)).collect(),
            report: solution.report,
        })
    }

    fn adjusted_camera(&self, keys: &CameraKeys) -> AdjustedCamera {
        let theta: Vec<f64> =
            keys.blocks.iter().flat_map(BlockKeys::keys).flat_map(|k| self.values.get(k).iter().copied()).collect();
        AdjustedCamera {
            camera: keys.camera.with_theta(&theta),
            camera_from_rig: keys.extrinsics.map_or_else(Isometry3::identity, |key| *self.values.get(key)),
            drift: keys.drift.map(|key| std::array::from_fn(|i| self.values.get(key)[i])),
            offset_s: keys.offset.map(|key| self.values.get(key)[0]),
            image_residuals: self.batch_residuals(keys.image),
            depth_residuals: self.batch_residuals(keys.depth),
            depth_sigmas: keys.depth_sigmas.clone(),
        }
    }

    /// Whitened residuals of a batch at the present values; none where it cannot be evaluated.
    fn batch_residuals(&self, batch: Option<BatchId>) -> Vec<f64> {
        batch.and_then(|b| self.graph.residuals(b, &self.values).ok()).unwrap_or_default()
    }

    /// Residuals of the first camera's depth samples at the present values, whitened, frame after frame; none where they cannot
    /// be evaluated.
    pub fn depth_residuals(&self) -> Vec<f64> {
        self.batch_residuals(self.cameras.first().and_then(|camera| camera.depth))
    }

    /// Whitened residuals of a camera's markers and depth samples at the present values.
    pub fn whitened(&self, camera: usize) -> [Vec<f64>; 2] {
        let CameraKeys { image, depth, .. } = self.cameras[camera];
        [self.batch_residuals(image), self.batch_residuals(depth)]
    }

    /// Whether fields are so large that their nodes are variables of their own. Covariances are then out of reach.
    pub fn by_node(&self) -> bool {
        self.cameras.iter().any(CameraKeys::by_node)
    }

    /// Covariance of all variables at the present values.
    ///
    /// # Errors
    ///
    /// [`CovarianceError`], where the data leave a combination of parameters undetermined.
    pub fn covariance(&self) -> Result<Covariance, CovarianceError> {
        Covariance::compute(&self.graph, &self.values, &CovarianceOptions::default())
    }

    /// Normal equations frame by frame at the present values, with held blocks of the first camera as candidates; see
    /// [`Adjustment::linearize_camera`].
    ///
    /// # Errors
    ///
    /// [`ScoreError`].
    pub fn linearize(
        &self,
        candidates: impl Iterator<Item = (String, usize, Option<DMatrix<f64>>)>,
    ) -> Result<Linearization, ScoreError> {
        self.linearize_camera(0, candidates)
    }

    /// Normal equations frame by frame at the present values, with held blocks of a camera as candidates: each with its
    /// name, its place among [`Camera::blocks`] and a smoothness prior where it needs one.
    ///
    /// # Errors
    ///
    /// [`ScoreError`] where a factor cannot be evaluated, or a candidate is not held.
    pub fn linearize_camera(
        &self,
        camera: usize,
        candidates: impl Iterator<Item = (String, usize, Option<DMatrix<f64>>)>,
    ) -> Result<Linearization, ScoreError> {
        let poses: Vec<VariableId> = self.poses.iter().map(|k| k.id()).collect();
        let blocks = &self.cameras[camera].blocks;
        let candidates: Vec<Candidate> = candidates
            .map(|(name, block, smoothness)| {
                let variables = blocks[block].keys().map(|k| k.id()).collect();
                Candidate { name, variables, smoothness }
            })
            .collect();
        Linearization::new(&self.graph, &self.values, &poses, &candidates)
    }

    /// Holds everything but the poses of the board.
    pub fn hold_cameras(&mut self) {
        for camera in &self.cameras {
            camera.extrinsics.iter().for_each(|key| self.graph.fix(*key));
            camera.drift.iter().for_each(|key| self.graph.fix(*key));
            camera.offset.iter().for_each(|key| self.graph.fix(*key));
            camera.blocks.iter().flat_map(BlockKeys::keys).for_each(|key| self.graph.fix(key));
        }
    }

    /// Number of the camera, and of its block, to which a variable belongs; of a piece of the board, the first camera's. `None`
    /// for poses and extrinsics.
    pub fn block_of(&self, variable: VariableId) -> Option<(usize, usize)> {
        let has = |block: &BlockKeys| block.keys().any(|key| key.id() == variable);
        let block = |(number, camera): (usize, &CameraKeys)| Some((number, camera.blocks.iter().position(has)?));
        self.cameras.iter().enumerate().find_map(block)
    }

    /// Number of the frame whose pose a variable is.
    pub fn frame_of(&self, variable: VariableId) -> Option<usize> {
        self.poses.iter().position(|key| key.id() == variable)
    }

    /// Number of the camera whose extrinsics, drift or time offset a variable is.
    pub fn extrinsics_of(&self, variable: VariableId) -> Option<usize> {
        let has =
            |camera: &CameraKeys| camera.variables().take(camera.variables_of_extrinsics()).any(|id| id == variable);
        self.cameras.iter().position(has)
    }

    /// The variable of a camera's drift.
    pub fn drift_variable(&self, camera: usize) -> Option<VariableId> {
        self.cameras[camera].drift.map(|key| key.id())
    }

    /// Variables of the cameras in order: of each its extrinsics, but of the reference, their drift and the offset of its time
    /// where it has them, and its blocks.
    pub fn variables(&self) -> Vec<VariableId> {
        self.cameras.iter().flat_map(CameraKeys::variables).collect()
    }

    /// Joint covariance of the parameters of all cameras, in the order of [`Adjustment::variables`]; rows and columns of held
    /// parameters are zero.
    pub fn camera_covariance(&self, covariance: &Covariance) -> DMatrix<f64> {
        covariance.joint(&self.variables())
    }

    /// Redundancies (degrees of freedom left) of a camera's markers and of its depth samples: n − tr(W J Σ Jᵀ) (Förstner 1979;
    /// Koch 1999, section 3.6.1).
    pub fn redundancies(&self, camera: usize, covariance: &Covariance) -> [f64; 2] {
        let of_batch = |batch: Option<BatchId>| {
            let batch = batch.and_then(|b| self.graph.batch(b));
            batch.map_or(0.0, |batch| batch_redundancy(batch, &self.values, covariance))
        };
        let CameraKeys { image, depth, .. } = self.cameras[camera];
        let of_image = of_batch(image);
        // All batches together have the degrees of freedom of the problem: where there is no third one, depth has what is left.
        let is_alone = self.graph.batches().count() == usize::from(image.is_some()) + usize::from(depth.is_some());
        let of_depth = if is_alone && depth.is_some() {
            covariance.degrees_of_freedom() as f64 - of_image
        } else {
            of_batch(depth)
        };
        [of_image, of_depth]
    }
}

/// Adds the priors of smooth functions that the pieces of a camera have themselves.
fn add_smooth_functions(camera: &CameraKeys, graph: &mut Graph) {
    for (block, key) in camera.camera.blocks().iter().zip(&camera.blocks) {
        let in_use = camera.depth.is_some() || !is_depth_only(block);
        let rows = if in_use { rows_of_smooth_functions(block) } else { Vec::new() };
        if let (BlockKeys::Whole(key), false) = (key, rows.is_empty()) {
            graph.add_batch(SmoothnessBatch::new(block, *key, rows));
        }
    }
}
