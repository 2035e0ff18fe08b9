//! The calibrations of a fleet in words, and as a page.

mod page;
mod sentences;
mod text;

pub use page::render_fleet;
pub use text::fleet_text;
