//! The number of OpenCV's threads.

use std::sync::Once;

/// Limits OpenCV to one thread, once, for the whole process: frames are what runs side by side.
///
/// The former number is not restored. OpenCV replaces its pool of threads when the number changes, and whatever else runs in
/// that pool at that moment, such as the detection of another dataset, reads freed memory.
pub(crate) fn use_single_thread() {
    static LIMITED: Once = Once::new();
    LIMITED.call_once(|| {
        if let Err(error) = opencv::core::set_num_threads(1) {
            tracing::warn!(%error, "OpenCV's threads could not be limited; frames run with more threads than cores");
        }
    });
}
