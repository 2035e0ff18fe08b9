//! A simulation prepared for rendering.

use super::backdrop::Backdrop;
use super::rays::RayTable;
use crate::error::SimulateError;
use crate::session::Session;
use crate::simulation::Simulation;
use crate::truth::Truth;

/// Renders the frames of a simulation one by one, in any order.
pub struct Renderer<'a> {
    pub(super) session: Session<'a>,
    pub(super) rays: RayTable,
    pub(super) backdrop: Backdrop,
}

impl Simulation {
    /// Prepares rendering: chooses poses and traces the ray of every pixel.
    ///
    /// # Errors
    /// [`SimulateError`] when a parameter is unusable.
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

    /// The truth of the simulation.
    pub fn truth(&self) -> &Truth {
        &self.session.truth
    }
}
