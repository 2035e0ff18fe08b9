//! Options of incremental sessions.

/// Options of [`IncrementalSession`](crate::IncrementalSession).
#[derive(Clone, Debug, PartialEq)]
pub struct IncrementalOptions {
    /// A frame is linearised again when the shared variables have moved by more than this since, in standard deviations of
    /// theirs (Mahalanobis distance). Default 1: what a linearisation neglects there is small beside a standard deviation.
    pub threshold: f64,
    /// Shared variables stay where they started until there are so many frames; then the session settles once. A single frame
    /// moves what it hardly determines far, and frames solved with such values may end in minima of their own, for instance a
    /// board in its mirrored pose. Default 1: every frame moves them.
    pub hold_until: usize,
    /// Steps of the shared variables that adding or removing a frame may take. Default 3.
    pub max_steps: usize,
    /// [`settle`](crate::IncrementalSession::settle) has converged when a step decreases the cost by at most this, relatively.
    /// Default 1e-10.
    pub cost_tolerance: f64,
    /// Steps that settling may take. Default 100.
    pub max_settling_steps: usize,
    /// Number of threads for frames that are linearised again; 0 for those of the rayon pool in which the session is called.
    /// Results are bitwise identical for any number. Default 1: with few frames threads cost more than they save.
    pub threads: usize,
}

impl Default for IncrementalOptions {
    fn default() -> Self {
        Self { threshold: 1.0, hold_until: 1, max_steps: 3, cost_tolerance: 1e-10, max_settling_steps: 100, threads: 1 }
    }
}
