//! Chessboards: found by OpenCV's sector-based detector (Duda and Frese 2018) or, where that fails, by their saddle
//! points; put in order, crossings fitted.

mod find;
mod order;
pub(crate) mod saddles;

pub(crate) use find::find;
