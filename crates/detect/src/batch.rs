//! Detection in many frames, in parallel.

use std::sync::atomic::{AtomicUsize, Ordering};

use depthcal_io::GrayImage;
use depthcal_model::target::Target;
use rayon::prelude::*;

use crate::detect::detect;
use crate::detection::{DetectOptions, Detection};
use crate::error::DetectError;
#[cfg(feature = "opencv")]
use crate::open_cv::threads::use_single_thread;

/// Why a frame has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError<E: std::error::Error + 'static> {
    /// The frame's image could not be loaded.
    #[error("frame {frame}: {source}")]
    Load {
        /// Name of the frame.
        frame: String,
        /// The loader's error.
        source: E,
    },
    /// The search could not be carried out.
    #[error("frame {frame}: {source}")]
    Detect {
        /// Name of the frame.
        frame: String,
        /// Why.
        source: DetectError,
    },
}

/// Searches many frames for the board, in parallel. A frame is its name and a function that loads its image; at most
/// one image per thread is in memory. Results come in the order of the frames and do not depend on the number of
/// threads.
/// `progress` is called from several threads with the number of frames finished and the number of all frames.
///
/// The first call limits OpenCV to one thread, for the whole process and for good.
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
    #[cfg(feature = "opencv")]
    use_single_thread();
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
