//! Circle grids: dots as regions of the component tree, a lattice grown over them, the board found in the lattice.
//!
//! OpenCV's blob detector thresholds the whole image at a few levels, and its grid finder expects the board's dots and
//! hardly anything else. Both fail on dots below ten pixels, uneven light and clutter, which these stages tolerate.

mod blobs;
mod find;
mod tree;

pub(crate) use find::find;
