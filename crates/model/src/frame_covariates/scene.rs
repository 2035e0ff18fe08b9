//! Sums of phasors over the blocks of a frame.

use super::block::{BLOCK_PX, BlockSum};
use super::modulation::{FREQUENCIES, Modulation};
use super::phase::{phasor, turns_per_mm};
use super::spread::SceneLight;

/// Ranges beyond this are no measurements of a time-of-flight camera, mm; it bounds the number of turns.
const LONGEST_MM: f32 = 1e6;

/// A frame's division into blocks.
#[derive(Debug, Clone, Copy)]
pub struct Scene {
    modulation: Modulation,
    size: [usize; 2],
}

impl Scene {
    /// Of frames with width and height `size`, px.
    pub fn new(modulation: Modulation, size: [usize; 2]) -> Self {
        Self { modulation, size }
    }

    /// Number of blocks in a row.
    pub fn columns(&self) -> usize {
        self.size[0].div_ceil(BLOCK_PX)
    }

    /// Number of rows of blocks.
    pub fn rows(&self) -> usize {
        self.size[1].div_ceil(BLOCK_PX)
    }

    /// Sums over the blocks of a row. Amplitudes and ranges (mm; 0, NaN or infinity where none was measured) are those of the
    /// whole frame.
    #[inline(always)]
    pub fn row(&self, row: usize, amplitude: &[u16], range_mm: impl Fn(usize) -> f32) -> Vec<BlockSum> {
        let turns = turns_per_mm(&self.modulation);
        let [width, height] = self.size;
        let lines = row * BLOCK_PX..((row + 1) * BLOCK_PX).min(height);
        let mut sums = Vec::with_capacity(self.columns());
        for first in (0..width).step_by(BLOCK_PX) {
            // One sum per column of the block, so that the columns are computed side by side.
            let mut phasors = [[[0.0_f32; BLOCK_PX]; 2]; FREQUENCIES];
            let (mut measured, mut all) = ([0.0_f32; BLOCK_PX], [0.0_f32; BLOCK_PX]);
            for line in lines.clone() {
                let start = line * width + first;
                let (mut ranges, mut signal, mut lit) = ([0.0_f32; BLOCK_PX], [0.0_f32; BLOCK_PX], [0.0_f32; BLOCK_PX]);
                for i in 0..BLOCK_PX.min(width - first) {
                    signal[i] = f32::from(amplitude[start + i]);
                    let range = range_mm(start + i);
                    let valid = range > 0.0 && range <= LONGEST_MM;
                    ranges[i] = if valid { range } else { 0.0 };
                    lit[i] = if valid { signal[i] } else { 0.0 };
                }
                for i in 0..BLOCK_PX {
                    measured[i] += lit[i];
                    all[i] += signal[i];
                }
                for (sum, turns) in phasors.iter_mut().zip(turns) {
                    for i in 0..BLOCK_PX {
                        let [re, im] = phasor(ranges[i] * turns);
                        sum[0][i] += lit[i] * re;
                        sum[1][i] += lit[i] * im;
                    }
                }
            }
            sums.push(BlockSum {
                phasors: phasors.map(|parts| parts.map(|part| part.iter().sum())),
                measured: measured.iter().sum(),
                amplitude: all.iter().sum(),
            });
        }
        sums
    }

    /// Spreads the light of all blocks, row by row, over the frame. Blocks without any range have that of the nearest with one.
    /// `None` where there is none at all, or where the blocks are not those of the frame.
    pub fn spread(&self, mut blocks: Vec<BlockSum>) -> Option<SceneLight> {
        if blocks.is_empty() || blocks.len() != self.columns() * self.rows() {
            return None;
        }
        self.fill(&mut blocks)?;
        Some(SceneLight::new(&blocks, self.size))
    }

    /// Gives the pixels without a range that of others: within a block the mean phasor of those that have one, else that of the
    /// nearest block.
    fn fill(&self, blocks: &mut [BlockSum]) -> Option<()> {
        let columns = self.columns();
        let known: Vec<usize> = (0..blocks.len()).filter(|i| blocks[*i].measured > 0.0).collect();
        let nearest = |to: usize| {
            let distance = |from: usize| {
                let (du, dv) = ((from % columns).abs_diff(to % columns), (from / columns).abs_diff(to / columns));
                du * du + dv * dv
            };
            known.iter().copied().min_by_key(|from| distance(*from))
        };
        let sources: Option<Vec<usize>> =
            (0..blocks.len()).map(|i| if blocks[i].measured > 0.0 { Some(i) } else { nearest(i) }).collect();
        let filled = sources?.into_iter().zip(&*blocks).map(|(source, block)| {
            let scale = block.amplitude / blocks[source].measured;
            blocks[source].phasors.map(|p| p.map(|part| part * scale))
        });
        let filled: Vec<[[f32; 2]; FREQUENCIES]> = filled.collect();
        for (block, phasors) in blocks.iter_mut().zip(filled) {
            block.phasors = phasors;
        }
        Some(())
    }
}
