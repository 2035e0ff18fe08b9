//! A depth camera whose image cannot be had: its start from the planes that it measures where other cameras see the board.
//!
//! Its measured inverse depth on a plane is affine in the pixel, α u + β v + γ, up to lens and D. With a focal length these are
//! the plane's normal and distance in the camera, which the other cameras' poses give in the rig's frame: the rotation follows
//! from the normals, the translation from the distances. The adjustment then takes the pixels themselves. K, D and the place
//! are determined by planes in five or more general positions (they are the fifteen parameters of a projective map of space),
//! but some of them weakly: those have a prior, and are named where the boards say less of them than it does.

mod place;
mod planes;

pub use place::{BoardPlaneSeen, PlaceFit, place_from_planes};
pub use planes::{ImagePlane, planes_of};
