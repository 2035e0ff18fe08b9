//! Rendering: images and depth images as the camera delivers them.

mod backdrop;
mod depth;
mod field;
mod frame;
mod image;
mod look;
mod rays;
mod renderer;
mod scattering;
mod spread;

pub use frame::RenderedFrame;
pub use renderer::Renderer;
