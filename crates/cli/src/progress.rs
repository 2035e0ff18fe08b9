//! Progress bars on a terminal; nothing elsewhere.

use std::sync::LazyLock;
use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

/// All bars of the process, one below the other.
static ALL: LazyLock<MultiProgress> =
    LazyLock::new(|| MultiProgress::with_draw_target(ProgressDrawTarget::stderr_with_hz(5)));

/// Draws the progress of the library's jobs as bars.
#[derive(Debug, Clone, Copy)]
pub struct Bars;

impl depthcal_calibration::progress::Progress for Bars {
    fn begin(&self, job: &'static str, steps: Option<usize>) -> Box<dyn depthcal_calibration::progress::Job> {
        Box::new(match steps {
            Some(total) => Progress::new(job, total),
            None => Progress::busy(job),
        })
    }
}

impl depthcal_calibration::progress::Job for Progress {
    fn doing(&self, what: String) {
        self.0.set_message(what);
    }

    fn advance(&self) {
        Progress::advance(self);
    }
}

/// A progress bar that appears on a terminal when a job takes longer than a moment.
#[derive(Debug)]
pub struct Progress(ProgressBar);

impl Progress {
    /// A bar for `total` steps.
    pub fn new(what: &'static str, total: usize) -> Self {
        Self::styled(what, ProgressBar::new(total as u64), "{msg} {bar:30} {pos}/{len} {eta}")
    }

    /// A counter for an unknown number of steps.
    pub fn endless(what: &'static str) -> Self {
        Self::styled(what, ProgressBar::no_length(), "{msg} {spinner} {pos} ({per_sec})")
    }

    /// A spinner with the elapsed time, for a job without countable steps.
    pub fn busy(what: &'static str) -> Self {
        let progress = Self::styled(what, ProgressBar::new_spinner(), "{spinner} {msg} {elapsed}");
        if !progress.0.is_hidden() {
            progress.0.enable_steady_tick(Duration::from_millis(200));
        }
        progress
    }

    fn styled(what: &'static str, bar: ProgressBar, template: &str) -> Self {
        let bar = ALL.add(bar);
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(what);
        Self(bar)
    }

    /// Counts one step.
    pub fn advance(&self) {
        self.0.inc(1);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
