//! The five places of the measurement chain where a piece may act, and the state that it sees there.
//!
//! ```text
//! board point ──Board──▶ point ──pose──▶ camera frame ──▶ (x, y, ρ)
//! (x, y, ρ) ──Lens──▶ (x', y') ──pinhole──▶ (u, v) ──Pixel──▶ (u, v) of the depth image
//! (x, y, ρ) ──Depth──▶ measured inverse depth
//! ```

use serde::{Deserialize, Serialize};

use crate::scalar::Scalar;

/// Where in the chain a piece acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum HookKind {
    /// Shape of the board, in its own frame.
    Board,
    /// Pose of the board.
    Pose,
    /// Image formation on the normalised image plane.
    Lens,
    /// Pixel coordinates: the pinhole, and displacements of the depth image against the image.
    Pixel,
    /// Measured inverse depth.
    Depth,
}

impl HookKind {
    /// The name used in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            HookKind::Board => "board",
            HookKind::Pose => "pose",
            HookKind::Lens => "lens",
            HookKind::Pixel => "pixel",
            HookKind::Depth => "depth",
        }
    }
}

/// Largest number of inputs that a hook's state has.
pub(crate) const MAX_STATE: usize = 5;

/// A place in the chain: the state that a piece maps there, over any [`Scalar`].
pub trait Hook: Send + Sync + 'static {
    /// Its tag.
    const KIND: HookKind;
    /// Number of scalars in [`Hook::State`].
    const IN: usize;
    /// Number of scalars in [`Hook::Output`].
    const OUT: usize;
    /// The input of a piece.
    type State<T: Scalar>: Copy;
    /// The output of a piece.
    type Output<T: Scalar>: Copy;
    /// Reads the state from its [`Hook::IN`] scalars.
    fn read<T: Scalar>(scalars: &[T]) -> Self::State<T>;
    /// The output as scalars; the first [`Hook::OUT`] count.
    fn write<T: Scalar>(output: Self::Output<T>) -> [T; 3];
}

/// The board's shape: a point of the nominal board to the same point of the real one, mm.
#[derive(Debug, Clone, Copy)]
pub struct Board;

impl Hook for Board {
    const KIND: HookKind = HookKind::Board;
    const IN: usize = 3;
    const OUT: usize = 3;
    type State<T: Scalar> = [T; 3];
    type Output<T: Scalar> = [T; 3];
    fn read<T: Scalar>(s: &[T]) -> [T; 3] {
        [s[0], s[1], s[2]]
    }
    fn write<T: Scalar>(o: [T; 3]) -> [T; 3] {
        o
    }
}

/// State at the [`Lens`] hook. Normalised coordinates, without unit.
#[derive(Debug, Clone, Copy)]
pub struct LensState<T> {
    /// Direction of the true ray, X / Z.
    pub x_true: T,
    /// Direction of the true ray, Y / Z.
    pub y_true: T,
    /// True inverse depth, 1/mm.
    pub rho: T,
    /// x as the lens pieces before this one leave it.
    pub x: T,
    /// y as the lens pieces before this one leave it.
    pub y: T,
}

/// The lens: undistorted to distorted normalised coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Lens;

impl Hook for Lens {
    const KIND: HookKind = HookKind::Lens;
    const IN: usize = 5;
    const OUT: usize = 2;
    type State<T: Scalar> = LensState<T>;
    type Output<T: Scalar> = [T; 2];
    fn read<T: Scalar>(s: &[T]) -> LensState<T> {
        LensState { x_true: s[0], y_true: s[1], rho: s[2], x: s[3], y: s[4] }
    }
    fn write<T: Scalar>([x, y]: [T; 2]) -> [T; 3] {
        [x, y, y]
    }
}

/// Pixel coordinates of the image to pixel coordinates of the depth image, px.
#[derive(Debug, Clone, Copy)]
pub struct Pixel;

impl Hook for Pixel {
    const KIND: HookKind = HookKind::Pixel;
    const IN: usize = 2;
    const OUT: usize = 2;
    type State<T: Scalar> = [T; 2];
    type Output<T: Scalar> = [T; 2];
    fn read<T: Scalar>(s: &[T]) -> [T; 2] {
        [s[0], s[1]]
    }
    fn write<T: Scalar>([u, v]: [T; 2]) -> [T; 3] {
        [u, v, v]
    }
}

/// State at the [`Depth`] hook.
#[derive(Debug, Clone, Copy)]
pub struct DepthState<T> {
    /// Direction of the true ray, X / Z.
    pub x: T,
    /// Direction of the true ray, Y / Z.
    pub y: T,
    /// Inverse depth as the depth pieces before this one leave it, 1/mm; the true one for the first.
    pub rho: T,
    /// Cosine of the angle between ray and surface normal, in (0, 1].
    pub cos_incidence: T,
}

/// True to measured inverse depth, 1/mm.
#[derive(Debug, Clone, Copy)]
pub struct Depth;

impl Hook for Depth {
    const KIND: HookKind = HookKind::Depth;
    const IN: usize = 4;
    const OUT: usize = 1;
    type State<T: Scalar> = DepthState<T>;
    type Output<T: Scalar> = T;
    fn read<T: Scalar>(s: &[T]) -> DepthState<T> {
        DepthState { x: s[0], y: s[1], rho: s[2], cos_incidence: s[3] }
    }
    fn write<T: Scalar>(rho: T) -> [T; 3] {
        [rho, rho, rho]
    }
}
