//! Rendering: images and depth images as the camera delivers them.

mod backdrop;
mod depth;
mod field;
mod image;
mod rays;
mod spread;

use serde::{Deserialize, Serialize};

use crate::error::SimulateError;
use crate::session::{Session, frame_name};
use crate::simulation::Simulation;
use crate::truth::Truth;
use backdrop::Backdrop;
use rays::RayTable;

/// How images are made of what the camera sees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Rendering {
    /// Bits of the image, 8 or 16.
    pub image_bits: u8,
    /// Millimetres per step of the 16-bit depth image, as it really is.
    pub depth_unit_mm: f64,
    /// Depth beyond this is not measured, mm.
    pub max_range_mm: f64,
    /// Distance of the wall behind the board, mm; 0 for none.
    pub wall_mm: f64,
    /// Things that stand about between board and wall.
    pub clutter: usize,
    /// How readily depth is missing on and around dots, at the board's outline and elsewhere: 0 never, 1 as usual.
    pub holes: f64,
    /// Depth noise at the edges of the print, as a multiple of that elsewhere.
    pub edge_noise: f64,
    /// Depth pixels at the board's outline that are not missing lie between the board and what is behind it.
    pub mixed_pixels: bool,
}

impl Default for Rendering {
    fn default() -> Self {
        Self {
            image_bits: 8,
            depth_unit_mm: 0.125,
            max_range_mm: 2500.0,
            wall_mm: 2200.0,
            clutter: 0,
            holes: 1.0,
            edge_noise: 2.0,
            mixed_pixels: false,
        }
    }
}

impl Rendering {
    pub(crate) fn check(&self) -> Result<(), SimulateError> {
        if !matches!(self.image_bits, 8 | 16) {
            let value = f64::from(self.image_bits);
            return Err(SimulateError::BadParameter { field: "rendering.image_bits", value, expected: "8 or 16" });
        }
        for (field, value) in
            [("rendering.depth_unit_mm", self.depth_unit_mm), ("rendering.max_range_mm", self.max_range_mm)]
        {
            if !(value.is_finite() && value > 0.0) {
                return Err(SimulateError::BadParameter { field, value, expected: "a positive number" });
            }
        }
        for (field, value) in [
            ("rendering.wall_mm", self.wall_mm),
            ("rendering.holes", self.holes),
            ("rendering.edge_noise", self.edge_noise),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(SimulateError::BadParameter { field, value, expected: "zero or a positive number" });
            }
        }
        Ok(())
    }
}

/// One frame as the camera delivers it.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderedFrame {
    /// Stem of its files.
    pub name: String,
    /// Width of both images, px.
    pub width: usize,
    /// Height of both images, px.
    pub height: usize,
    /// The infrared image, row by row; 8-bit images have values up to 255.
    pub image: Vec<u16>,
    /// The depth image, row by row, in steps of the depth unit; 0 where nothing was measured.
    pub depth: Vec<u16>,
    /// The infrared signal without noise, share of full scale, row by row, on the image's pixels.
    pub amplitude: Vec<f32>,
}

/// Renders the frames of a simulation, one at a time and in any order.
pub struct Renderer<'a> {
    session: Session<'a>,
    rays: RayTable,
    backdrop: Backdrop,
}

impl Simulation {
    /// Prepares rendering: chooses poses, and traces the ray of every pixel.
    ///
    /// # Errors
    /// Any [`SimulateError`] of unusable parameters.
    pub fn renderer(&self) -> Result<Renderer<'_>, SimulateError> {
        self.rendering.check()?;
        let session = Session::new(self)?;
        let rays = RayTable::new(&session.instrument.optics, self.camera.width, self.camera.height);
        let backdrop = Backdrop::new(&self.rendering, session.seed());
        Ok(Renderer { session, rays, backdrop })
    }
}

impl Renderer<'_> {
    /// Number of frames.
    pub fn len(&self) -> usize {
        self.session.frames.len()
    }

    /// Whether there are no frames.
    pub fn is_empty(&self) -> bool {
        self.session.frames.is_empty()
    }

    /// What is simulated.
    pub fn truth(&self) -> &Truth {
        &self.session.truth
    }

    /// Frame `index`; none beyond the last.
    pub fn frame(&self, index: usize) -> Option<RenderedFrame> {
        let frame = self.session.frames.get(index)?;
        let amplitude = image::signal(self, &frame.image);
        let image = image::expose(self, &frame.image, &amplitude);
        // A depth image that belongs to another exposure was lit as that one was.
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
