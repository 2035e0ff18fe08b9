//! The pieces of a camera in their order, and a frame's pose.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::batch::{Link, links};
use crate::hook::HookKind;
use crate::piece::AnyPiece;
use crate::pinhole::PINHOLE;

/// The pieces of a camera in order. Their parameters are not here: every call is given them as one slice, `theta`, in
/// the order of the columns above without the pose ([`Chain::parameter_count`] numbers).
#[derive(Debug, Clone, Default)]
pub struct Chain {
    pub(super) board: Vec<Link>,
    pub(super) lens: Vec<Link>,
    pub(super) pixel: Vec<Link>,
    pub(super) depth: Vec<Link>,
    pub(super) pinhole_offset: usize,
    total: usize,
}

/// A frame's pose, ready for use.
#[derive(Clone, Copy)]
pub(super) struct Pose {
    pub(super) rotation: Matrix3<f64>,
    pub(super) translation: Vector3<f64>,
}

impl From<&Isometry3<f64>> for Pose {
    fn from(camera_from_board: &Isometry3<f64>) -> Self {
        Self {
            rotation: camera_from_board.rotation.to_rotation_matrix().into_inner(),
            translation: camera_from_board.translation.vector,
        }
    }
}

impl Chain {
    /// Puts pieces into the chain's order; within a hook the given order is kept. Pieces at [`HookKind::Pose`] do not
    /// exist: the pose is the frame's own variable.
    pub fn new(pieces: &[Arc<dyn AnyPiece>]) -> Self {
        let mut offset = 0;
        let board = links(pieces, HookKind::Board, &mut offset);
        let lens = links(pieces, HookKind::Lens, &mut offset);
        let pinhole_offset = offset;
        offset += PINHOLE;
        let pixel = links(pieces, HookKind::Pixel, &mut offset);
        let depth = links(pieces, HookKind::Depth, &mut offset);
        Self { board, lens, pixel, depth, pinhole_offset, total: offset }
    }

    /// Length of `theta`: all pieces and the pinhole.
    pub fn parameter_count(&self) -> usize {
        self.total
    }

    /// Leading part of `theta` that an image observation depends on: all but pixel and depth pieces.
    pub fn image_parameter_count(&self) -> usize {
        self.pinhole_offset + PINHOLE
    }

    /// The pieces in chain order with the place of their first parameter in `theta`.
    pub fn pieces(&self) -> impl Iterator<Item = (&Arc<dyn AnyPiece>, usize)> {
        [&self.board, &self.lens, &self.pixel, &self.depth].into_iter().flatten().map(|l| (&l.piece, l.offset))
    }
}
