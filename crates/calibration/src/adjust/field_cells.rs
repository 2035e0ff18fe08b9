//! Fields of many nodes: the depth pixels of a frame are divided by the cells in which they lie, so that every group of
//! residuals depends on the nodes of its cell and not on the whole field.

use std::sync::Arc;

use depthcal_model::chain::Chain;
use depthcal_model::field::{Domain, FieldLayout};
use depthcal_model::register::Options;
use depthcal_model::{Block, Camera, Register, RegisterError};

use super::blocks::BlockKeys;
use super::factors::BlockVariables;
use crate::observe::{CameraFrames, DepthSample, SampledFrame};

/// A field of more parameters than this has a variable per node; below, dense columns are faster.
const MOST_DENSE: usize = 400;
/// Parameters of the coarse field that stands for a large one where its roughness is chosen.
const COARSE: usize = 200;

/// The layout of a field that is too large for dense columns.
pub(crate) fn node_layout(block: &Block) -> Option<FieldLayout> {
    block.piece()?.field().filter(|layout| layout.parameter_count() > MOST_DENSE)
}

/// The chain whose large fields have the parameters of one cell.
pub(crate) fn cell_chain(camera: &Camera) -> Chain {
    let piece = |block: &Block| {
        let piece = block.piece()?;
        node_layout(block).and_then(|_| piece.of_cell()).or_else(|| Some(piece.clone()))
    };
    Chain::new(&camera.blocks().iter().filter_map(piece).collect::<Vec<_>>())
}

/// Cells of a sample in all large fields.
fn cells(layouts: &[FieldLayout], sample: &DepthSample) -> Vec<[usize; 2]> {
    layouts.iter().map(|layout| layout.grid.cell(sample.context.pixel).0).collect()
}

/// Brings the samples of every frame into the order of the cells in which they lie.
pub(crate) fn sort_by_cell(capture: &mut CameraFrames<SampledFrame>, camera: &Camera) {
    let layouts: Vec<FieldLayout> = camera.blocks().iter().filter_map(node_layout).collect();
    for frame in &mut capture.frames {
        Arc::make_mut(&mut frame.samples).sort_by_cached_key(|s| cells(&layouts, s));
    }
}

/// The depth pixels of a frame, cell by cell, with the variables of each. Samples are in the order of [`sort_by_cell`].
pub(crate) fn cell_groups<'a>(
    samples: &'a [DepthSample],
    blocks: &[BlockKeys],
) -> Vec<(&'a [DepthSample], BlockVariables)> {
    let layouts: Vec<FieldLayout> = blocks
        .iter()
        .filter_map(|b| if let BlockKeys::Nodes { layout, .. } = b { Some(*layout) } else { None })
        .collect();
    samples
        .chunk_by(|a, b| cells(&layouts, a) == cells(&layouts, b))
        .map(|samples| {
            let mut keys = Vec::new();
            for block in blocks {
                match block {
                    BlockKeys::Whole(key) => keys.push(*key),
                    BlockKeys::Nodes { layout, nodes, shared } => {
                        let (cell, _) = layout.grid.cell(samples[0].context.pixel);
                        keys.extend(layout.cell_nodes(cell).map(|first| nodes[first / layout.per_node()]));
                        keys.extend(shared);
                    }
                }
            }
            (samples, keys.into())
        })
        .collect()
}

/// Parameters of those fields of a camera whose nodes are variables of their own; `None` where it has no such field.
pub(crate) fn node_count(camera: &Camera) -> Option<usize> {
    let counts = camera.blocks().iter().filter_map(node_layout).map(|layout| layout.parameter_count());
    counts.reduce(|a, b| a + b)
}

/// A camera whose large fields are coarse, at their neutral values, and for every block the factor by which nodes are
/// farther apart; `None` where there is no large field.
pub(crate) fn coarse(
    camera: &Camera,
    register: &Register,
    domain: &Domain,
) -> Result<Option<(Camera, Vec<f64>)>, RegisterError> {
    if !camera.blocks().iter().any(|b| node_layout(b).is_some()) {
        return Ok(None);
    }
    let mut failure = None;
    let mut factors = Vec::new();
    let coarse = camera.map_blocks(|block| {
        let (Some(layout), Some(piece)) = (node_layout(&block), block.piece()) else {
            factors.push(1.0);
            return block;
        };
        let grid = layout.grid;
        let bins = grid.bins.min(3);
        let most = (COARSE / (layout.fields * bins)) as f64;
        let factor = (grid.columns_and_rows() as f64 / most).sqrt();
        let least = grid.interpolation.order() + 1;
        let fewer = |n: usize| ((n as f64 / factor).round() as usize).max(least) as f64;
        let mut options: Options = piece.options();
        for (name, value) in [("columns", fewer(grid.columns)), ("rows", fewer(grid.rows)), ("bins", bins as f64)] {
            options.entry(name.to_owned()).and_modify(|v| *v = value);
        }
        factors.push(factor);
        match register.piece(piece.name(), &options) {
            Ok(piece) => Block::new(piece).over(domain),
            Err(error) => {
                failure = Some(error);
                block
            }
        }
    });
    failure.map_or(Ok(Some((coarse, factors))), Err)
}
