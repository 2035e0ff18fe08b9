//! The calibrations of a fleet in words, and as a page.

mod page;
mod results;
mod sentences;
mod text;

pub(crate) use page::render_fleet;
pub use results::FleetResults;
pub use text::fleet_text;
