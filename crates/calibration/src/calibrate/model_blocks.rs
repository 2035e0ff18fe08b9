//! The blocks of a model that is asked for: those of its effects and of its depth model.

use depthcal_model::{Block, RegisterError};

use super::camera_options::CameraOptions;
use crate::adjust::blocks::is_depth_only;

/// Effects that depth alone shows, and the depth model. Effects are the sensor's and act on the true depth; the depth model, like
/// D, distorts the result.
///
/// # Errors
///
/// [`RegisterError`] where a piece is unknown.
pub(super) fn depth_blocks(options: &CameraOptions) -> Result<Vec<Block>, RegisterError> {
    let mut blocks = effects(options, is_depth_only)?;
    blocks.extend(options.register.depth_blocks(&options.model)?);
    Ok(blocks)
}

/// Effects that images show, not only depth.
///
/// # Errors
///
/// [`RegisterError`] where one is unknown.
pub fn image_blocks(options: &CameraOptions) -> Result<Vec<Block>, RegisterError> {
    effects(options, |block| !is_depth_only(block))
}

fn effects(options: &CameraOptions, wanted: impl Fn(&Block) -> bool) -> Result<Vec<Block>, RegisterError> {
    let mut blocks = Vec::new();
    for effect in &options.effects {
        let block = options.register.make(effect, None)?;
        if wanted(&block) {
            blocks.push(block);
        }
    }
    Ok(blocks)
}
