//! The variables of one camera in an adjustment.

use std::collections::BTreeMap;
use std::ops::Range;

use depthcal_model::hook::HookKind;
use depthcal_model::{Block, Camera};
use depthcal_solver::{BatchId, Graph, Key, Values, VariableId};
use nalgebra::{DVector, Isometry3};

use super::blocks::{BlockKeys, is_depth_only};
use super::field_cells::node_layout;
use super::problem::CameraProblem;
use crate::observe::AdjustableFrame;

/// Variables and batches of a camera.
pub(super) struct CameraKeys {
    pub camera: Camera,
    pub extrinsics: Option<Key<Isometry3<f64>>>,
    pub drift: Option<Key<DVector<f64>>>,
    pub offset: Option<Key<DVector<f64>>>,
    pub blocks: Vec<BlockKeys>,
    pub image: Option<BatchId>,
    pub depth: Option<BatchId>,
    /// Standard deviations of its depth samples, 1/mm, frame after frame.
    pub depth_sigmas: Vec<f64>,
}

impl CameraKeys {
    /// Whether it has fields whose nodes are variables of their own.
    pub fn by_node(&self) -> bool {
        self.blocks.iter().any(|b| matches!(b, BlockKeys::Nodes { .. }))
    }

    /// Number of its leading variables that are extrinsics, their drift and the offset of its time.
    pub fn variables_of_extrinsics(&self) -> usize {
        usize::from(self.extrinsics.is_some()) + usize::from(self.drift.is_some()) + usize::from(self.offset.is_some())
    }

    /// Its variables, see [`Adjustment::variables`](super::adjustment::Adjustment::variables).
    pub fn variables(&self) -> impl Iterator<Item = VariableId> + '_ {
        let extrinsics = self.extrinsics.iter().map(|k| k.id()).chain(self.drift.iter().map(|k| k.id()));
        let offset = self.offset.iter().map(|k| k.id());
        extrinsics.chain(offset).chain(self.blocks.iter().flat_map(BlockKeys::keys).map(|k| k.id()))
    }
}

/// Inserts the variables of a camera, but for the board's poses.
pub(super) fn camera_keys<F: AdjustableFrame>(
    problem: &CameraProblem<'_, F>,
    graph: &mut Graph,
    values: &mut Values,
    of_board: &mut BTreeMap<&'static str, Key<DVector<f64>>>,
) -> CameraKeys {
    let label = |name: &str| problem.name.map_or_else(|| name.to_owned(), |camera| format!("{camera}/{name}"));
    let extrinsics = problem.extrinsics.map(|e| values.insert(e.camera_from_rig));
    let drift = problem.extrinsics.and_then(|e| e.drift).map(|d| values.insert(DVector::from_column_slice(&d)));
    let offset = problem.extrinsics.and_then(|e| e.offset_s).map(|s| values.insert(DVector::from_element(1, s)));
    extrinsics.iter().for_each(|key| graph.label(*key, label("camera_from_rig")));
    if problem.extrinsics.is_some_and(|e| e.are_known) {
        extrinsics.iter().for_each(|key| graph.fix(*key));
    }
    drift.iter().for_each(|key| graph.label(*key, label("extrinsics_drift")));
    offset.iter().for_each(|key| graph.label(*key, label("time_offset")));
    let mut variables = |block: &Block| {
        // Without depth its pieces have no residual to hold them.
        let in_use = problem.with_depth || !is_depth_only(block);
        let held: Vec<bool> = block.free.iter().map(|free| !(*free && in_use)).collect();
        let mut insert = |part: Range<usize>, label: String| {
            let key = values.insert(DVector::from_column_slice(&block.theta[part.clone()]));
            graph.label(key, label);
            graph.fix_partly(key, &held[part]);
            key
        };
        let Some(layout) = node_layout(block) else {
            return BlockKeys::Whole(insert(0..held.len(), label(block.name())));
        };
        let count = layout.grid.columns_and_rows();
        let node = |k: usize| k * layout.per_node()..(k + 1) * layout.per_node();
        let nodes = (0..count).map(|k| insert(node(k), format!("node {k} of {}", label(block.name())))).collect();
        let shared = count * layout.per_node()..held.len();
        let shared = (!shared.is_empty()).then(|| insert(shared, label(block.name())));
        BlockKeys::Nodes { layout, nodes, shared }
    };
    let blocks = problem.camera.blocks().iter().map(|block| {
        let shared = (block.hook() == HookKind::Board).then(|| of_board.get(block.name())).flatten();
        let keys = shared.map_or_else(|| variables(block), |key| BlockKeys::Whole(*key));
        if let (HookKind::Board, BlockKeys::Whole(key)) = (block.hook(), &keys) {
            of_board.insert(block.name(), *key);
        }
        keys
    });
    CameraKeys {
        camera: problem.camera.clone(),
        extrinsics,
        drift,
        offset,
        blocks: blocks.collect(),
        image: None,
        depth: None,
        depth_sigmas: Vec::new(),
    }
}
