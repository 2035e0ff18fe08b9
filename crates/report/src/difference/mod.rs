//! Two calibrations compared: in words, and as a page.

mod page;
mod sentences;
mod text;

pub(crate) use page::render_difference;
pub use sentences::difference_sentences;
pub use text::difference_text;
