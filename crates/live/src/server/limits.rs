//! Limits of what a client can take.

use std::time::Duration;

/// Limits of what a client can take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Time for a request to come, from its connection.
    pub request_time: Duration,
    /// Time for an answer to be read.
    pub answer_time: Duration,
    /// Bytes of a request's line and headers.
    pub head_bytes: usize,
    /// Bytes of a request's body.
    pub body_bytes: usize,
    /// Connections at once.
    pub connections: usize,
    /// Connections at once from one address.
    pub connections_per_address: usize,
}

impl Default for Limits {
    /// Two browsers on one machine hold about six connections.
    fn default() -> Self {
        Self {
            request_time: Duration::from_secs(5),
            answer_time: Duration::from_secs(10),
            head_bytes: 8 << 10,
            body_bytes: 1 << 10,
            connections: 64,
            connections_per_address: 16,
        }
    }
}
