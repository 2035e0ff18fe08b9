//! The number of OpenCV's threads.

/// Limits OpenCV to one thread, for the whole process; restores the former number when dropped.
pub(crate) struct SingleThreaded {
    before: Option<i32>,
}

impl SingleThreaded {
    pub(crate) fn new() -> SingleThreaded {
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
