//! Chessboards: found by their saddle points or by OpenCV's sector-based detector (Duda and Frese 2018), put in order,
//! crossings fitted.

mod attempt;
mod find;
mod order;
pub(crate) mod saddles;
mod size;

pub(crate) use find::find;
pub use size::chessboard_size;
