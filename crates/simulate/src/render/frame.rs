//! One rendered frame.

use super::renderer::Renderer;
use super::{depth, image};
use crate::session::frame_name;

/// One frame as the camera delivers it.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderedFrame {
    /// Stem of its files.
    pub name: String,
    /// Width of both images, px.
    pub width: usize,
    /// Height of both images, px.
    pub height: usize,
    /// The infrared image, row-major; 8-bit images have values up to 255.
    pub image: Vec<u16>,
    /// The depth image, row-major, in steps of the depth unit; 0 means no measurement.
    pub depth: Vec<u16>,
    /// The infrared signal at the image's pixels without noise, row-major, share of full scale.
    pub amplitude: Vec<f32>,
}

impl Renderer<'_> {
    /// Frame `index`; `None` beyond the last.
    pub fn frame(&self, index: usize) -> Option<RenderedFrame> {
        let frame = self.session.frames.get(index)?;
        let amplitude = image::signal(self, &frame.image);
        let image = image::expose(self, &frame.image, &amplitude);
        // A depth image of another exposure has the illumination of that exposure.
        let lit = (frame.depth.source != frame.image.source || frame.depth.pose != frame.image.pose)
            .then(|| image::signal(self, &frame.depth));
        let depth = depth::render(self, &frame.depth, lit.as_ref().unwrap_or(&amplitude));
        let camera = &self.session.simulation.camera;
        Some(RenderedFrame {
            name: frame_name(index),
            width: camera.width,
            height: camera.height,
            image,
            depth,
            amplitude,
        })
    }
}
