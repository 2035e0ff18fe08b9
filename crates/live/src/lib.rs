//! Guided capture: frames of a running camera are searched for the board, those worth having are kept as a dataset, and a page
//! shows which pose of the board is wanted next and when it is enough.
//!
//! [`run`] ties the parts together. A [`Source`] delivers frames, from a folder that fills or as raw frames on a stream. The
//! [`Session`] decides which are kept and writes them at once ([`Recorder`]), so that nothing that was kept is lost when the
//! program is killed; a session begins with the frames of its folder. Fits run in a thread of their own ([`Fitter`]), so that
//! the picture never waits for them. The [`Server`] shows the session's [`PageState`] and passes on [`Command`]s; no path of a
//! request reaches the file system.
//!
//! Pixel centres have integer coordinates; mm; poses map board to camera.

mod arrival;
mod choice;
mod command;
mod error;
mod fit;
mod fitter;
mod guide;
mod inbox;
mod page_state;
mod picture;
mod pose_distance;
mod published;
mod recorder;
mod run;
mod server;
mod session;
mod sharpness;
mod source;

pub use arrival::Arrival;
pub use command::Command;
pub use error::LiveError;
pub use fit::{FitJob, FitOutcome, FitSummary, LiveFit, LiveFitted, PlanSummary, fit};
pub use fitter::Fitter;
pub use inbox::{Event, Inbox, SourceEnd};
pub use page_state::{BoardSeen, KeptDot, PageState, Wanted};
pub use published::Published;
pub use recorder::Recorder;
pub use run::{Ended, LiveOptions, run};
pub use server::{Access, Limits, Server};
pub use session::{Seen, Session};
pub use sharpness::edge_width_px;
pub use source::{Source, read_frame, spawn};
