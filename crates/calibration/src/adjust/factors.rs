//! The factors of the calibration graph: image observations and depth pixels, a group per frame.

use std::cell::RefCell;
use std::sync::Arc;

use depthcal_model::chain::{Chain, DepthQuery, Workspace};
use depthcal_solver::{EvaluationError, FactorBatch, Key, Loss, Values, VariableId};
use nalgebra::{DVector, Isometry3};

use crate::observe::DepthSample;
use crate::observe::noise::NoiseModel;

/// Scratch of a thread: nothing is allocated per evaluation once it has grown to the largest frame.
#[derive(Default)]
struct Scratch {
    work: Workspace,
    theta: Vec<f64>,
    pixels: Vec<[f64; 2]>,
    inverse_depths: Vec<f64>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// The variables that all frames share: the camera's parameter blocks in chain order.
#[derive(Debug, Clone)]
pub struct SharedBlocks {
    /// The chain that the blocks belong to.
    pub chain: Arc<Chain>,
    /// One variable per block.
    pub keys: Vec<Key<DVector<f64>>>,
    /// How many leading blocks an image observation depends on.
    pub image_blocks: usize,
}

/// The variables that hold the parameters of a chain, in its order.
pub type BlockVariables = Arc<[Key<DVector<f64>>]>;

/// Parameters in chain order from the variables that hold them.
fn gather(values: &Values, keys: &[Key<DVector<f64>>], theta: &mut Vec<f64>) {
    theta.clear();
    for key in keys {
        theta.extend(values.get(*key).iter());
    }
}

fn variables(pose: Key<Isometry3<f64>>, keys: &[Key<DVector<f64>>]) -> Vec<VariableId> {
    std::iter::once(pose.id()).chain(keys.iter().map(|k| k.id())).collect()
}

fn scale_rows(jacobian: &mut [f64], columns: usize, weights: impl Iterator<Item = f64>) {
    for (row, weight) in jacobian.chunks_exact_mut(columns).zip(weights) {
        row.iter_mut().for_each(|d| *d *= weight);
    }
}

/// Detected markers of one frame.
#[derive(Debug, Clone)]
pub struct ImageGroup {
    /// The frame's pose, camera from board.
    pub pose: Key<Isometry3<f64>>,
    /// Board points, mm.
    pub points: Vec<[f64; 2]>,
    /// Where they were found, px.
    pub pixels: Vec<[f64; 2]>,
    /// Standard deviation of each, px.
    pub sigmas: Vec<f64>,
}

/// Reprojection errors (u, v) of all frames, whitened.
#[derive(Debug, Clone)]
pub struct ImageBatch {
    shared: SharedBlocks,
    groups: Vec<ImageGroup>,
    variables: Vec<Vec<VariableId>>,
    loss: Loss,
}

impl ImageBatch {
    /// The batch of all frames' markers.
    pub fn new(shared: SharedBlocks, groups: Vec<ImageGroup>, loss: Loss) -> Self {
        let variables = groups.iter().map(|g| variables(g.pose, &shared.keys[..shared.image_blocks])).collect();
        Self { shared, groups, variables, loss }
    }

    /// The frames' markers.
    pub fn groups(&self) -> &[ImageGroup] {
        &self.groups
    }
}

impl FactorBatch for ImageBatch {
    fn name(&self) -> &str {
        "image"
    }

    fn group_count(&self) -> usize {
        self.groups.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        &self.variables[group]
    }

    fn row_count(&self, group: usize) -> usize {
        2 * self.groups[group].points.len()
    }

    fn residual_dim(&self) -> usize {
        2
    }

    fn loss(&self) -> Loss {
        self.loss.clone()
    }

    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        mut jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let g = &self.groups[group];
        SCRATCH.with_borrow_mut(|scratch| {
            let Scratch { work, theta, pixels, .. } = scratch;
            gather(values, &self.shared.keys[..self.shared.image_blocks], theta);
            pixels.resize(g.points.len(), [0.0; 2]);
            let chain = &self.shared.chain;
            chain
                .image(work, theta, values.get(g.pose), &g.points, pixels, jacobian.as_deref_mut())
                .map_err(|e| EvaluationError::new(e.to_string()))?;
            for (k, (predicted, found)) in pixels.iter().zip(&g.pixels).enumerate() {
                for i in 0..2 {
                    residuals[2 * k + i] = (predicted[i] - found[i]) / g.sigmas[k];
                }
            }
            if let Some(jacobian) = jacobian {
                let columns = jacobian.len() / residuals.len();
                scale_rows(jacobian, columns, g.sigmas.iter().flat_map(|s| [1.0 / s, 1.0 / s]));
            }
            Ok(())
        })
    }
}

/// Depth pixels of one frame.
#[derive(Debug, Clone)]
pub struct DepthGroup {
    /// The frame's pose, camera from board.
    pub pose: Key<Isometry3<f64>>,
    /// The pixels.
    pub queries: Vec<DepthQuery>,
    /// Measured inverse depths, 1/mm.
    pub inverse_depths: Vec<f64>,
    /// Standard deviation of each, 1/mm.
    pub sigmas: Vec<f64>,
}

/// Errors in measured inverse depth of all frames, whitened.
#[derive(Debug, Clone)]
pub struct DepthBatch {
    chain: Arc<Chain>,
    keys: Vec<BlockVariables>,
    groups: Vec<DepthGroup>,
    variables: Vec<Vec<VariableId>>,
    loss: Loss,
}

impl DepthBatch {
    /// The batch of all frames' depth pixels.
    pub fn new(shared: SharedBlocks, groups: Vec<DepthGroup>, loss: Loss) -> Self {
        let keys: BlockVariables = shared.keys.into();
        Self::by_cell(shared.chain, groups.into_iter().map(|g| (g, keys.clone())).collect(), loss)
    }

    /// The batch of depth pixels whose groups depend on different variables: the pixels of a frame that lie in one cell of
    /// a field, on the nodes of that cell. The variables of each group hold the parameters of `chain`, in its order.
    pub fn by_cell(chain: Arc<Chain>, groups: Vec<(DepthGroup, BlockVariables)>, loss: Loss) -> Self {
        let variables = groups.iter().map(|(g, keys)| variables(g.pose, keys)).collect();
        let (groups, keys) = groups.into_iter().unzip();
        Self { chain, keys, groups, variables, loss }
    }

    /// The frames' depth pixels.
    pub fn groups(&self) -> &[DepthGroup] {
        &self.groups
    }
}

impl FactorBatch for DepthBatch {
    fn name(&self) -> &str {
        "depth"
    }

    fn group_count(&self) -> usize {
        self.groups.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        &self.variables[group]
    }

    fn row_count(&self, group: usize) -> usize {
        self.groups[group].queries.len()
    }

    fn loss(&self) -> Loss {
        self.loss.clone()
    }

    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        mut jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let g = &self.groups[group];
        SCRATCH.with_borrow_mut(|scratch| {
            let Scratch { work, theta, pixels: board, inverse_depths } = scratch;
            gather(values, &self.keys[group], theta);
            board.resize(g.queries.len(), [0.0; 2]);
            inverse_depths.resize(g.queries.len(), 0.0);
            let (chain, pose) = (&self.chain, values.get(g.pose));
            chain
                .depth(work, theta, pose, &g.queries, inverse_depths, board, jacobian.as_deref_mut())
                .map_err(|e| EvaluationError::new(e.to_string()))?;
            for (k, (predicted, measured)) in inverse_depths.iter().zip(&g.inverse_depths).enumerate() {
                residuals[k] = (predicted - measured) / g.sigmas[k];
            }
            if let Some(jacobian) = jacobian {
                let columns = jacobian.len() / residuals.len();
                scale_rows(jacobian, columns, g.sigmas.iter().map(|s| 1.0 / s));
            }
            Ok(())
        })
    }
}

/// The depth samples of a frame with the weights of a noise model.
pub(crate) fn depth_group(samples: &[DepthSample], pose: Key<Isometry3<f64>>, noise: &NoiseModel) -> DepthGroup {
    let inverse_depths: Vec<f64> = samples.iter().map(|s| 1.0 / s.depth_mm).collect();
    DepthGroup {
        pose,
        queries: samples.iter().map(|s| DepthQuery { board_seed: s.board_seed, context: s.context }).collect(),
        sigmas: inverse_depths.iter().map(|rho| noise.depth.sigma(*rho)).collect(),
        inverse_depths,
    }
}
