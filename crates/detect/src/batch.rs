//! Many frames at once.

use std::sync::atomic::{AtomicUsize, Ordering};

use depthcal_io::GrayImage;
use depthcal_model::target::Target;
use rayon::prelude::*;

use crate::detection::{DetectOptions, Detection, detect};
use crate::error::DetectError;

/// Why a frame has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError<E: std::error::Error + 'static> {
    /// The frame's image could not be loaded.
    #[error("frame {frame}: {source}")]
    Load {
        /// Name of the frame.
        frame: String,
        /// What the loader says.
        source: E,
    },
    /// The board could not be looked for.
    #[error("frame {frame}: {source}")]
    Detect {
        /// Name of the frame.
        frame: String,
        /// Why.
        source: DetectError,
    },
}

/// Looks for the board in many frames, in parallel, each given by its name and a function that loads its image. Results
/// come in the order of the frames and do not depend on the number of threads. `progress` is called with the
/// number of finished frames and of all, from several threads. At most one image per thread is in memory.
///
/// OpenCV's own threads are limited to one while this runs, for the whole process.
pub fn detect_all<L, E>(
    frames: &[(String, L)],
    target: &Target,
    options: &DetectOptions,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Vec<Result<Option<Detection>, FrameError<E>>>
where
    L: Fn() -> Result<GrayImage, E> + Sync,
    E: std::error::Error + Send + 'static,
{
    let _single = SingleThreaded::new();
    let done = AtomicUsize::new(0);
    frames
        .par_iter()
        .with_max_len(1)
        .map(|(name, load)| {
            let result = load().map_err(|source| FrameError::Load { frame: name.clone(), source }).and_then(|image| {
                detect(&image, target, options).map_err(|source| FrameError::Detect { frame: name.clone(), source })
            });
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, frames.len());
            result
        })
        .collect()
}

/// Holds OpenCV's threads at one; restores their number when dropped.
struct SingleThreaded {
    before: Option<i32>,
}

impl SingleThreaded {
    fn new() -> SingleThreaded {
        let before = opencv::core::get_num_threads().ok();
        if let Err(error) = opencv::core::set_num_threads(1) {
            tracing::warn!(%error, "OpenCV's threads could not be limited; frames run with more threads than cores");
        }
        SingleThreaded { before }
    }
}

impl Drop for SingleThreaded {
    fn drop(&mut self) {
        if let Some(before) = self.before
            && let Err(error) = opencv::core::set_num_threads(before)
        {
            tracing::warn!(%error, "the number of OpenCV's threads could not be restored");
        }
    }
}
