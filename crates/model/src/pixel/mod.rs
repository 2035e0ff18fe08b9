//! Pixel pieces: the image's pixels to those of the depth image.

mod depth_registration;

pub use depth_registration::DepthRegistration;
