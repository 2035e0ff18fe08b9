//! The variables of a camera's parameter blocks in the adjustment.

use depthcal_model::Block;
use depthcal_model::field::FieldLayout;
use depthcal_model::hook::HookKind;
use depthcal_solver::Key;
use nalgebra::DVector;

/// The variables of one block, in the order of its parameters.
pub enum BlockKeys {
    /// One variable with all parameters.
    Whole(Key<DVector<f64>>),
    /// A field too large for one variable: one per node over the image, and one for what all pixels share.
    Nodes {
        /// Where its parameters are.
        layout: FieldLayout,
        /// One variable per node, row by row.
        nodes: Vec<Key<DVector<f64>>>,
        /// Parameters that all pixels share.
        shared: Option<Key<DVector<f64>>>,
    },
}

impl BlockKeys {
    /// All variables, in the order of the block's parameters.
    pub fn keys(&self) -> impl Iterator<Item = Key<DVector<f64>>> {
        let (first, nodes, shared) = match self {
            BlockKeys::Whole(key) => (Some(*key), &[][..], None),
            BlockKeys::Nodes { nodes, shared, .. } => (None, &nodes[..], *shared),
        };
        first.into_iter().chain(nodes.iter().copied()).chain(shared)
    }
}

/// Whether a block acts on depth alone, so that images say nothing of it.
pub fn is_depth_only(block: &Block) -> bool {
    block.piece().is_some() && matches!(block.hook(), HookKind::Pixel | HookKind::Depth)
}
