//! Requests of the people who hold the board.

/// A request by a key or a button of the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Keep the frame that is shown.
    Capture,
    /// Remove the frame that was kept last.
    TakeBack,
    /// Give up the wanted pose for the next one.
    Skip,
    /// End the session.
    Finish,
}
