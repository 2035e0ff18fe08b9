//! Names of a camera's parameters.

use depthcal_model::{Block, Camera};

/// `PIECE.PARAMETER` of every parameter of a camera, in the order of [`Camera::theta`], and whether it is free.
pub fn parameter_names(camera: &Camera) -> Vec<(String, bool)> {
    let of_block = |block: &Block| {
        let name = |p: &depthcal_model::Parameter| format!("{}.{}", block.name(), p.name);
        block.parameters().iter().map(name).zip(block.free.iter().copied()).collect::<Vec<_>>()
    };
    camera.blocks().iter().flat_map(of_block).collect()
}
