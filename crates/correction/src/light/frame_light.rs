//! The light of a frame at every pixel.

use depthcal_model::Modulation;
use depthcal_model::frame_covariates::{BLOCK_PX, BlockSum, Phasors, Scene, SceneLight, StrayLight};
use rayon::prelude::*;

use super::own_and_near::OwnAndNear;
use crate::simd::{Isa, Kernel, dispatch, measurement};

/// The measured depth of a whole frame, row by row: steps of the given size in mm, or mm.
#[derive(Clone, Copy)]
pub(crate) enum MeasuredDepth<'a> {
    Steps(&'a [u16], f32),
    Millimetres(&'a [f32]),
}

/// The light of a frame at every pixel.
#[derive(Debug)]
pub(crate) struct FrameLight {
    scene: SceneLight,
    width: usize,
    /// Phasors of the scene's light in every row, [`FrameLight::nodes`] of them, [`BLOCK_PX`] pixels apart.
    rows: Vec<Phasors>,
    /// Mean amplitude over 3×3 pixels.
    own: Vec<f32>,
    /// Amplitude of the nearest pixels' light over the own; NaN without own light.
    near: Vec<f32>,
}

impl FrameLight {
    /// From the amplitudes and the measured depth of a frame, and from range over depth at every pixel. `None` where nothing was
    /// measured.
    pub fn new(
        modulation: Modulation,
        width: usize,
        slants: &[f32],
        amplitude: &[u16],
        depth: MeasuredDepth<'_>,
    ) -> Option<Self> {
        let size = [width, amplitude.len() / width];
        let scene = Scene::new(modulation, size);
        let of_row = |row: usize| dispatch(BlockRow { scene: &scene, row, slants, amplitude, depth });
        let blocks: Vec<Vec<BlockSum>> = (0..scene.rows()).into_par_iter().map(of_row).collect();
        let scene = scene.spread(blocks.concat())?;
        let (mut local, mut near) = (vec![0.0; amplitude.len()], vec![0.0; amplitude.len()]);
        let bands = local.par_chunks_mut(width * BLOCK_PX).zip(near.par_chunks_mut(width * BLOCK_PX));
        let rows = bands.enumerate().flat_map_iter(|(band, (local, near))| {
            let first_row = band * BLOCK_PX;
            let count = local.len() / width;
            dispatch(OwnAndNear { amplitude, size, first_row, own: local, near });
            let scene = &scene;
            (first_row..first_row + count).flat_map(|v| scene.along_row(v))
        });
        let rows = rows.collect();
        Some(Self { scene, width, rows, own: local, near })
    }

    /// The stray light at a pixel with this row-major index.
    pub fn at(&self, index: usize) -> StrayLight {
        let pixel = [(index % self.width) as f32, (index / self.width) as f32];
        match self.own[index] {
            own if own > 0.0 => self.scene.at(pixel).over(own, self.near[index]),
            _ => StrayLight::UNKNOWN,
        }
    }

    /// The phasors at the nodes of a row.
    #[inline(always)]
    pub fn row(&self, row: usize) -> &[Phasors] {
        let nodes = self.rows.len() / (self.own.len() / self.width);
        &self.rows[row * nodes..(row + 1) * nodes]
    }

    /// Own amplitudes and ratios of the nearest pixels' light, row by row.
    #[inline(always)]
    pub fn own_and_near(&self) -> (&[f32], &[f32]) {
        (&self.own, &self.near)
    }
}

/// Sums over a row of blocks.
struct BlockRow<'a> {
    scene: &'a Scene,
    row: usize,
    slants: &'a [f32],
    amplitude: &'a [u16],
    depth: MeasuredDepth<'a>,
}

impl Kernel for BlockRow<'_> {
    type Output = Vec<BlockSum>;

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> Vec<BlockSum> {
        let Self { scene, row, slants, amplitude, depth } = self;
        match depth {
            MeasuredDepth::Steps(steps, unit_mm) => {
                let range = |i: usize| f32::from(measurement(steps[i])) * unit_mm * slants[i];
                scene.row(row, amplitude, range)
            }
            MeasuredDepth::Millimetres(depth_mm) => scene.row(row, amplitude, |i: usize| depth_mm[i] * slants[i]),
        }
    }
}
