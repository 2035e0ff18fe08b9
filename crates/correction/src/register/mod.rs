//! Registration: depth of one camera in the image of another, and colours of depth pixels.
//!
//! Points come from the depth camera, corrected, in its own frame; the other camera is its whole chain, lens distortion
//! included. Neighbouring pixels on one surface are joined by triangles, so that an image with more pixels than the depth has
//! no gaps; between surfaces nothing is joined. Where several surfaces fall on a pixel the nearest counts. Pixels without depth
//! within a surface show nothing, but hide what lies behind them.

mod colours;
mod depth;
mod gaps;

pub use colours::colours_of;
pub use depth::{RegisteredDepth, depth_into};
