//! Board pieces: the nominal board to the real one.

mod board_bow;
mod print_scale;

pub use board_bow::BoardBow;
pub use print_scale::PrintScale;
