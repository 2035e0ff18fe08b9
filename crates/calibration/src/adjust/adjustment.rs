//! The joint adjustment: camera, lens, depth distortion and board poses in one least-squares problem.

use std::ops::Range;
use std::sync::Arc;

use depthcal_model::chain::POSE;
use depthcal_model::{Camera, Target};
use depthcal_solver::score::{Candidate, Linearization, ScoreError};
use depthcal_solver::{
    BatchId, Covariance, CovarianceError, CovarianceOptions, FactorBatch, Graph, Key, LinearSolver, Loss, Options,
    Report, SolveError, Values, VariableId, minimize,
};
use nalgebra::{DMatrix, DMatrixView, DVector, Isometry3, SVector};
use rayon::prelude::*;

use super::blocks::{BlockKeys, is_depth_only};
use super::camera_prior::{CameraPrior, CameraPriorBatch};
use super::factors::{DepthBatch, ImageBatch, ImageGroup, SharedBlocks, depth_group};
use super::field_cells::{cell_chain, cell_groups, node_layout};
use super::frame_rows::FrameRows;
use super::smoothness_prior::{Smoothness, SmoothnessBatch};
use super::smoothness_selection::FrameInformation;
use crate::observe::noise::NoiseModel;
use crate::observe::{AdjustableFrame, Capture, DetectedFrame};

/// Residuals beyond this many standard deviations lose influence (Huber's loss): clean data are hardly touched.
pub const HUBER: f64 = 3.0;

/// A calibration problem on a factor graph: one variable per parameter block of the camera, one pose per frame.
pub struct Adjustment {
    graph: Graph,
    values: Values,
    camera: Camera,
    blocks: Vec<BlockKeys>,
    poses: Vec<Key<Isometry3<f64>>>,
    image: BatchId,
    depth: Option<BatchId>,
}

/// Which second derivatives normal equations have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Curvature {
    /// Of the reweighted squares that the solver minimises in each step: always definite.
    OfWeights,
    /// Of the loss itself, which is zero beyond [`HUBER`]: what tells how the optimum moves with the data.
    OfLoss,
}

/// The rows of a group, weighted by the loss.
struct WeightedRows {
    jacobian: DMatrix<f64>,
    residuals: DVector<f64>,
    /// Square roots of the weights, one per row.
    weights: Vec<f64>,
    /// Rows in the linear part of the loss, which has no curvature.
    linear: Vec<usize>,
}

/// A solved adjustment.
pub struct Adjusted {
    /// The camera with its adjusted parameters.
    pub camera: Camera,
    /// Camera from board, one per frame.
    pub poses: Vec<Isometry3<f64>>,
    /// How the solver went.
    pub report: Report,
    /// Residuals of the markers, whitened: u, v per marker, frame after frame.
    pub image_residuals: Vec<f64>,
    /// Residuals of the depth samples, whitened, frame after frame.
    pub depth_residuals: Vec<f64>,
}

impl Adjustment {
    /// The problem of all frames of a capture; depth samples take part where `with_depth`.
    pub fn new<F: AdjustableFrame>(
        capture: &Capture<F>,
        camera: &Camera,
        noise: &NoiseModel,
        with_depth: bool,
    ) -> Self {
        let mut graph = Graph::new();
        let mut values = Values::new();
        let blocks: Vec<BlockKeys> = camera
            .blocks()
            .iter()
            .map(|block| {
                // Without depth its pieces have no residual to hold them.
                let in_use = with_depth || !is_depth_only(block);
                let held: Vec<bool> = block.free.iter().map(|free| !(*free && in_use)).collect();
                let mut insert = |part: Range<usize>, label: String| {
                    let key = values.insert(DVector::from_column_slice(&block.theta[part.clone()]));
                    graph.label(key, label);
                    graph.fix_partly(key, &held[part]);
                    key
                };
                match node_layout(block) {
                    None => BlockKeys::Whole(insert(0..held.len(), block.name().to_owned())),
                    Some(layout) => {
                        let count = layout.grid.columns_and_rows();
                        let node = |k: usize| k * layout.per_node()..(k + 1) * layout.per_node();
                        let nodes = (0..count).map(|k| insert(node(k), format!("node {k} of {}", block.name())));
                        let nodes = nodes.collect();
                        let rest = count * layout.per_node()..held.len();
                        let shared = (!rest.is_empty()).then(|| insert(rest, block.name().to_owned()));
                        BlockKeys::Nodes { layout, nodes, shared }
                    }
                }
            })
            .collect();
        let pose_keys: Vec<Key<Isometry3<f64>>> = capture.poses().map(|pose| values.insert(pose)).collect();
        for (key, frame) in pose_keys.iter().zip(&capture.frames) {
            graph.label(*key, format!("pose of {}", frame.posed().name));
        }
        let by_node = blocks.iter().any(|b| matches!(b, BlockKeys::Nodes { .. }));
        if !by_node {
            graph.eliminate(pose_keys.iter().copied());
        }
        let image_blocks = camera.blocks().iter().filter(|b| !is_depth_only(b)).count();
        let whole = blocks.iter().filter_map(|b| if let BlockKeys::Whole(key) = b { Some(*key) } else { None });
        let chain = Arc::new(if by_node { cell_chain(camera) } else { camera.chain() });
        let shared = SharedBlocks { chain: chain.clone(), keys: whole.collect(), image_blocks };
        let frames = || capture.frames.iter().zip(&pose_keys);
        let with_markers = frames().filter(|(f, _)| !f.posed().markers.is_empty());
        let groups = with_markers.map(|(f, k)| image_group(&capture.target, f.posed(), *k, noise));
        let image = graph.add_batch(ImageBatch::new(shared.clone(), groups.collect(), Loss::Huber { delta: HUBER }));
        let depth = with_depth.then(|| {
            let frames = frames().filter(|(f, _)| !f.samples().is_empty());
            // The samples of a frame share the error of its plane and are not independent. One factor for all of them corrects the
            // weight of depth relative to the markers (the magnitude adjustment of a composite likelihood; Pauli, Racugno,
            // Ventura 2011).
            let weight = 1.0 / noise.planes.design_effect;
            let loss = Loss::Huber { delta: HUBER }.scaled(weight);
            graph.add_batch(if by_node {
                let groups = frames.flat_map(|(f, k)| cell_groups(f.samples(), *k, noise, &blocks));
                DepthBatch::by_cell(chain, groups.collect(), loss)
            } else {
                let frames: Vec<_> = frames.collect();
                let groups = frames.par_iter().map(|(f, k)| depth_group(f.samples(), **k, noise));
                DepthBatch::new(shared, groups.collect(), loss)
            })
        });
        Self { graph, values, camera: camera.clone(), blocks, poses: pose_keys, image, depth }
    }

    /// Adds the prior of the camera's fields; without it fields that leave freedom to the data are not determined.
    #[must_use]
    pub fn with_smoothness(mut self, smoothness: &Smoothness) -> Self {
        for (block, key) in self.camera.blocks().iter().zip(&self.blocks) {
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
        self
    }

    /// Adds the prior of the camera's parameters from other units, where there is one.
    #[must_use]
    pub fn with_prior(mut self, prior: Option<&CameraPrior>) -> Self {
        let whole = |block: &BlockKeys| if let BlockKeys::Whole(key) = block { Some(*key) } else { None };
        let keys: Vec<_> = self.blocks.iter().map(whole).collect();
        // Blocks that these data do not touch are held here, whatever the camera says.
        let in_use = self.camera.map_blocks(|mut block| {
            if self.depth.is_none() && is_depth_only(&block) {
                block.free.fill(false);
            }
            block
        });
        if let Some(batch) = prior.and_then(|prior| CameraPriorBatch::new(&in_use, &keys, prior)) {
            self.graph.add_batch(batch);
        }
        self
    }

    /// What every frame says of the camera's free parameters at the present values, priors left out, with residuals weighted
    /// by their losses, and with the weight of depth where frames are fitted multiplied by `depth_weight`. Frames that cannot be
    /// evaluated say nothing.
    pub fn frame_information(&self, curvature: Curvature, depth_weight: f64) -> Vec<FrameInformation> {
        let columns: Vec<usize> = self.camera.free_parameters().into_iter().map(|i| POSE + i).collect();
        let size = POSE + columns.len();
        self.poses
            .par_iter()
            .map(|pose| {
                // Image and depth apart: poses of frames that are judged come from the image alone.
                let parts = [Some(self.image), self.depth].map(|batch| {
                    let (mut normal, mut gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
                    if let Some(batch) = batch.and_then(|b| self.graph.batch(b)) {
                        let own = (0..batch.group_count()).filter(|g| batch.variables(*g).first() == Some(&pose.id()));
                        for group in own {
                            self.add_information(batch, group, &columns, curvature, (&mut normal, &mut gradient));
                        }
                    }
                    (normal, gradient)
                });
                FrameInformation::new(&parts[0], &parts[1], POSE, depth_weight)
            })
            .collect()
    }

    fn add_information(
        &self,
        batch: &dyn FactorBatch,
        group: usize,
        columns: &[usize],
        curvature: Curvature,
        (normal, gradient): (&mut DMatrix<f64>, &mut DVector<f64>),
    ) {
        let Some(mut rows) = self.weighted_rows(batch, group, columns) else { return };
        let n = rows.jacobian.ncols();
        let own_gradient = rows.jacobian.tr_mul(&rows.residuals);
        if curvature == Curvature::OfLoss {
            for row in &rows.linear {
                rows.jacobian.row_mut(*row).fill(0.0);
            }
        }
        normal.view_mut((0, 0), (n, n)).gemm_tr(1.0, &rows.jacobian, &rows.jacobian, 1.0);
        let mut gradient = gradient.rows_mut(0, n);
        gradient += own_gradient;
    }

    /// The rows of a group over its pose and those of the chosen columns that it has; `None` where it cannot be evaluated.
    fn weighted_rows(&self, batch: &dyn FactorBatch, group: usize, columns: &[usize]) -> Option<WeightedRows> {
        let rows = batch.row_count(group);
        let width: usize = batch.variables(group).iter().map(|id| self.values.dim(*id)).sum();
        let (mut r, mut jacobian) = (vec![0.0; rows], vec![0.0; rows * width]);
        batch.evaluate(group, &self.values, &mut r, Some(&mut jacobian)).ok()?;
        let (dim, loss) = (batch.residual_dim(), batch.loss());
        // Images see the leading part of the parameters only.
        let places: Vec<usize> = (0..POSE).chain(columns.iter().copied().filter(|c| *c < width)).collect();
        let mut part = DMatrix::zeros(rows, places.len());
        let (mut linear, mut weights) = (Vec::new(), Vec::with_capacity(rows));
        for (k, (residual, rows)) in r.chunks_exact_mut(dim).zip(jacobian.chunks_exact(dim * width)).enumerate() {
            let size = residual.iter().map(|r| r * r).sum::<f64>().sqrt();
            let weight = loss.evaluate(size * size)[1].sqrt();
            if size > HUBER {
                linear.extend(k * dim..(k + 1) * dim);
            }
            for (i, row) in rows.chunks_exact(width).enumerate() {
                residual[i] *= weight;
                weights.push(weight);
                for (c, place) in places.iter().enumerate() {
                    part[(k * dim + i, c)] = weight * row[*place];
                }
            }
        }
        Some(WeightedRows { jacobian: part, residuals: DVector::from_vec(r), weights, linear })
    }

    /// By how much functions of a frame's own, with the given shapes at every depth sample, turn the gradient of the cost by the camera's free
    /// parameters, the frame's pose eliminated: one row per parameter, one column per shape. `None` for a frame without
    /// depth or where it cannot be evaluated.
    pub fn plane_response<const N: usize>(&self, frame: usize, shapes: &[SVector<f64, N>]) -> Option<DMatrix<f64>> {
        let pose = self.poses.get(frame)?.id();
        let columns: Vec<usize> = self.camera.free_parameters().into_iter().map(|i| POSE + i).collect();
        let size = POSE + columns.len();
        let (mut normal, mut turned) = (DMatrix::zeros(size, size), DMatrix::zeros(size, N));
        for id in [self.image, self.depth?] {
            let batch = self.graph.batch(id)?;
            let group = (0..batch.group_count()).find(|g| batch.variables(*g).first() == Some(&pose))?;
            let rows = self.weighted_rows(batch, group, &columns)?;
            let n = rows.jacobian.ncols();
            normal.view_mut((0, 0), (n, n)).gemm_tr(1.0, &rows.jacobian, &rows.jacobian, 1.0);
            if Some(id) == self.depth {
                let planes = DMatrix::from_fn(shapes.len(), N, |row, k| rows.weights[row] * shapes[row][k]);
                turned.rows_mut(0, n).gemm_tr(1.0, &rows.jacobian, &planes, 1.0);
            }
        }
        let of_pose = normal.view((0, 0), (POSE, POSE)).into_owned().cholesky()?;
        let by_pose = normal.view((POSE, 0), (columns.len(), POSE)).into_owned();
        let kept = turned.rows(POSE, columns.len()).into_owned();
        Some(kept - by_pose * of_pose.solve(&turned.rows(0, POSE).into_owned()))
    }

    /// Minimises the problem from its start values.
    ///
    /// # Errors
    ///
    /// [`SolveError`].
    pub fn solve(&mut self) -> Result<Adjusted, SolveError> {
        self.solve_within(0.0)
    }

    /// The same until a step decreases the cost by no more than `decrease`.
    ///
    /// # Errors
    ///
    /// [`SolveError`].
    pub fn solve_within(&mut self, decrease: f64) -> Result<Adjusted, SolveError> {
        // Poses see all nodes and no order of elimination by blocks is good: a minimum-degree order puts them last.
        let linear_solver = if self.by_node() { LinearSolver::SparseCholesky } else { LinearSolver::default() };
        let options = Options { linear_solver, decrease_tolerance: decrease, ..Options::default() };
        let solution = minimize(&self.graph, self.values.clone(), &options)?;
        self.values = solution.values;
        let residuals =
            |batch: Option<BatchId>| batch.and_then(|b| self.graph.residuals(b, &self.values).ok()).unwrap_or_default();
        let theta: Vec<f64> =
            self.blocks.iter().flat_map(BlockKeys::keys).flat_map(|k| self.values.get(k).iter().copied()).collect();
        Ok(Adjusted {
            camera: self.camera.with_theta(&theta),
            poses: self.poses.iter().map(|k| *self.values.get(*k)).collect(),
            report: solution.report,
            image_residuals: residuals(Some(self.image)),
            depth_residuals: residuals(self.depth),
        })
    }

    /// Residuals of the depth samples at the present values, whitened, frame after frame; none where they cannot be evaluated.
    pub fn depth_residuals(&self) -> Vec<f64> {
        self.depth.and_then(|b| self.graph.residuals(b, &self.values).ok()).unwrap_or_default()
    }

    /// Whether fields are so large that their nodes are variables of their own. Covariances are then out of reach.
    pub fn by_node(&self) -> bool {
        self.blocks.iter().any(|b| matches!(b, BlockKeys::Nodes { .. }))
    }

    /// Covariance of all variables at the present values.
    ///
    /// # Errors
    ///
    /// [`CovarianceError`], where the data leave a combination of parameters undetermined.
    pub fn covariance(&self) -> Result<Covariance, CovarianceError> {
        Covariance::compute(&self.graph, &self.values, &CovarianceOptions::default())
    }

    /// Normal equations frame by frame at the present values, with held blocks of the camera as candidates: each with its
    /// name, its place among [`Camera::blocks`] and a smoothness prior where it needs one.
    ///
    /// # Errors
    ///
    /// [`ScoreError`].
    pub fn linearize(
        &self,
        candidates: impl Iterator<Item = (String, usize, Option<DMatrix<f64>>)>,
    ) -> Result<Linearization, ScoreError> {
        let poses: Vec<VariableId> = self.poses.iter().map(|k| k.id()).collect();
        let candidates: Vec<Candidate> = candidates
            .map(|(name, block, smoothness)| {
                let variables = self.blocks[block].keys().map(|k| k.id()).collect();
                Candidate { name, variables, smoothness }
            })
            .collect();
        Linearization::new(&self.graph, &self.values, &poses, &candidates)
    }

    /// Residuals of a frame and their derivatives by its pose, weighted as the solver weights them; `None` where it cannot be
    /// evaluated.
    pub(crate) fn frame_rows(&self, frame: usize) -> Option<FrameRows> {
        let pose = self.poses.get(frame)?.id();
        let (mut residuals, mut weights, mut columns, mut depth) = (Vec::new(), Vec::new(), Vec::new(), 0);
        for id in [Some(self.image), self.depth].into_iter().flatten() {
            let batch = self.graph.batch(id)?;
            let Some(group) = only_group(batch, pose)? else { continue };
            let rows = self.weighted_rows(batch, group, &[])?;
            residuals.extend(rows.residuals.iter());
            columns.extend(rows.jacobian.transpose().iter());
            depth = if Some(id) == self.depth { rows.weights.len() } else { 0 };
            weights.extend(rows.weights);
        }
        let pose = DMatrix::from_row_slice(residuals.len(), POSE, &columns);
        Some(FrameRows { residuals: DVector::from_vec(residuals), weights, pose, depth })
    }

    /// Weighted derivatives and residuals of a frame's markers and of its depth samples, over its pose and some of the camera's
    /// parameters; `columns` count from the pose's on, and of the image those that it depends on are there. `None` where the frame cannot
    /// be evaluated or lacks one of the two.
    pub(crate) fn weighted_parts(&self, frame: usize, columns: &[usize]) -> Option<[(DMatrix<f64>, DVector<f64>); 2]> {
        let pose = self.poses.get(frame)?.id();
        let part = |id: BatchId| {
            let batch = self.graph.batch(id)?;
            let rows = self.weighted_rows(batch, only_group(batch, pose)??, columns)?;
            Some((rows.jacobian, rows.residuals))
        };
        Some([part(self.image)?, part(self.depth?)?])
    }

    /// Joint covariance of all camera parameters, in the order of [`Camera::theta`]; rows and columns of held
    /// parameters are zero.
    pub fn camera_covariance(&self, covariance: &Covariance) -> DMatrix<f64> {
        let ids: Vec<VariableId> = self.blocks.iter().flat_map(BlockKeys::keys).map(|k| k.id()).collect();
        covariance.joint(&ids)
    }

    /// Redundancy (degrees of freedom left) of the marker and of the depth residuals: n − tr(W J Σ Jᵀ) (Förstner 1979;
    /// Koch 1999, section 3.6.1).
    pub fn redundancies(&self, covariance: &Covariance) -> (f64, f64) {
        let of = |batch: Option<BatchId>| {
            let batch = batch.and_then(|b| self.graph.batch(b));
            batch.map_or(0.0, |batch| batch_redundancy(batch, &self.values, covariance))
        };
        let image = of(Some(self.image));
        // All batches together have the degrees of freedom of the problem: where there is no third one, depth has the rest.
        let is_alone = self.graph.batches().count() == 1 + usize::from(self.depth.is_some());
        let depth = if is_alone && self.depth.is_some() {
            covariance.degrees_of_freedom() as f64 - image
        } else {
            of(self.depth)
        };
        (image, depth)
    }
}

/// Redundancy of the residuals of a batch, whose loss is quadratic near zero: n − tr(W J Σ Jᵀ) (Förstner 1979; Koch 1999, section
/// 3.6.1).
pub fn batch_redundancy(batch: &dyn FactorBatch, values: &Values, covariance: &Covariance) -> f64 {
    let of_group = |group: usize| {
        let ids = batch.variables(group);
        let columns: usize = ids.iter().map(|id| values.dim(*id)).sum();
        let rows = batch.row_count(group);
        let (mut r, mut j) = (vec![0.0; rows], vec![0.0; rows * columns]);
        if batch.evaluate(group, values, &mut r, Some(&mut j)).is_err() {
            return rows as f64;
        }
        // The trace of J Σ Jᵀ is that of Σ Jᵀ J. The transposed J is what lies in memory.
        let transposed = DMatrixView::from_slice(&j, columns, rows);
        let products = transposed * transposed.transpose();
        // What a residual within the loss's quadratic part weighs.
        let weight = batch.loss().evaluate(0.0)[1];
        rows as f64 - weight * covariance.joint(ids).component_mul(&products).sum()
    };
    let groups: Vec<f64> = (0..batch.group_count()).into_par_iter().map(of_group).collect();
    groups.iter().sum()
}

/// The group of a pose in a batch, if there is one. `None` where there are several: pixels that are sorted into the cells of a fine field
/// are not in the frame's order.
fn only_group(batch: &dyn FactorBatch, pose: VariableId) -> Option<Option<usize>> {
    let mut own = (0..batch.group_count()).filter(|group| batch.variables(*group).first() == Some(&pose));
    let group = own.next();
    own.next().is_none().then_some(group)
}

fn image_group(target: &Target, frame: &DetectedFrame, pose: Key<Isometry3<f64>>, noise: &NoiseModel) -> ImageGroup {
    ImageGroup {
        pose,
        points: frame.markers.iter().map(|m| target.point(m.index)).collect(),
        pixels: frame.markers.iter().map(|m| m.pixel).collect(),
        sigmas: frame.markers.iter().map(|m| m.std_px * noise.pixel_sigma).collect(),
    }
}
