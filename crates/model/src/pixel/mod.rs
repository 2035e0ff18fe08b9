//! Pixel pieces: pixels of the image to those of the depth image.

crate::register::pieces! {
    depth_registration: DepthRegistration => add(|_| DepthRegistration),
}
