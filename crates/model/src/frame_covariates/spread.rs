//! The light of a scene, spread by a wide Gaussian over all pixels.

use super::block::{BLOCK_PX, BlockSum};
use super::modulation::FREQUENCIES;
use super::stray::Phasors;

/// Standard deviation of the Gaussian by which the light of the whole scene is spread, px.
pub const SPREAD_PX: f64 = 200.0;
/// Distance of the nodes between which the spread light is interpolated, px: small against [`SPREAD_PX`].
const NODE_PX: usize = BLOCK_PX;
/// Parts of the phasors of all frequencies.
const PARTS: usize = 2 * FREQUENCIES;

/// The mean phasors of a scene around every pixel, weighted by a Gaussian of [`SPREAD_PX`] over the pixels of the frame; bilinear
/// between nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneLight {
    size: [usize; 2],
    columns: usize,
    nodes: Vec<[f32; PARTS]>,
}

/// Weights of the blocks along one side of the frame (`length` pixels) at every node, which sum to the weight of one pixel:
/// blocks have sums over pixels.
fn weights(length: usize) -> Vec<Vec<f64>> {
    let blocks = length.div_ceil(BLOCK_PX);
    let pixels = |block: usize| BLOCK_PX.min(length - block * BLOCK_PX) as f64;
    let nodes = (length - 1).div_ceil(NODE_PX) + 1;
    (0..nodes)
        .map(|node| {
            let weight = |block: usize| {
                let centre = (block * BLOCK_PX) as f64 + 0.5 * (pixels(block) - 1.0);
                let distance = ((node * NODE_PX) as f64 - centre) / SPREAD_PX;
                (-0.5 * distance * distance).exp()
            };
            let total: f64 = (0..blocks).map(|block| weight(block) * pixels(block)).sum();
            (0..blocks).map(|block| weight(block) / total).collect()
        })
        .collect()
}

fn add_scaled(sum: &mut [f64; PARTS], parts: &[f64; PARTS], scale: f64) {
    for (sum, part) in sum.iter_mut().zip(parts) {
        *sum += scale * part;
    }
}

impl SceneLight {
    /// From the blocks of a frame, row by row.
    pub(super) fn new(blocks: &[BlockSum], size: [usize; 2]) -> Self {
        let (across, down) = (weights(size[0]), weights(size[1]));
        let columns = across.len();
        let mut rows: Vec<[f64; PARTS]> = Vec::new();
        for line in blocks.chunks_exact(size[0].div_ceil(BLOCK_PX)) {
            let line: Vec<[f64; PARTS]> = line.iter().map(parts).collect();
            for weights in &across {
                let mut sum = [0.0; PARTS];
                weights.iter().zip(&line).for_each(|(weight, block)| add_scaled(&mut sum, block, *weight));
                rows.push(sum);
            }
        }
        let mut nodes = Vec::with_capacity(columns * down.len());
        for weights in &down {
            for column in 0..columns {
                let mut sum = [0.0; PARTS];
                let of_column = rows[column..].iter().step_by(columns);
                weights.iter().zip(of_column).for_each(|(weight, row)| add_scaled(&mut sum, row, *weight));
                nodes.push(sum.map(|part| part as f32));
            }
        }
        Self { size, columns, nodes }
    }

    /// Width and height of the frame, px.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The phasors at a pixel within the frame.
    pub fn at(&self, [u, v]: [f32; 2]) -> Phasors {
        let node = |position: f32, nodes: usize| {
            let position_in_nodes = (position / NODE_PX as f32).clamp(0.0, (nodes - 1) as f32);
            let first = (position_in_nodes as usize).min(nodes.saturating_sub(2));
            (first, (first + 1).min(nodes - 1), position_in_nodes - first as f32)
        };
        let (left, right, a) = node(u, self.columns);
        let (top, bottom, b) = node(v, self.nodes.len() / self.columns);
        let node_at = |column: usize, row: usize| &self.nodes[row * self.columns + column];
        let mix = |i: usize| {
            let above = node_at(left, top)[i] + a * (node_at(right, top)[i] - node_at(left, top)[i]);
            let below = node_at(left, bottom)[i] + a * (node_at(right, bottom)[i] - node_at(left, bottom)[i]);
            above + b * (below - above)
        };
        Phasors(std::array::from_fn(|f| [mix(2 * f), mix(2 * f + 1)]))
    }

    /// The phasors at the nodes of a row of pixels, every [`BLOCK_PX`] pixels from the first; linear between them.
    pub fn along_row(&self, v: usize) -> Vec<Phasors> {
        (0..self.columns).map(|column| self.at([(column * NODE_PX) as f32, v as f32])).collect()
    }
}

fn parts(block: &BlockSum) -> [f64; PARTS] {
    std::array::from_fn(|i| f64::from(block.phasors[i / 2][i % 2]))
}
