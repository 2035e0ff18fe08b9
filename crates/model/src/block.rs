//! A block of a camera's parameters: a piece, or the pinhole, with values.

use std::borrow::Cow;
use std::sync::Arc;

use crate::grid::nodes::Domain;
use crate::hook::HookKind;
use crate::piece::{AnyPiece, Parameter, Placement};
use crate::pinhole::{self, PINHOLE};

/// A parameter block of the camera: a piece, or the pinhole, with values and which of them may be fitted.
#[derive(Debug, Clone)]
pub struct Block {
    piece: Option<Arc<dyn AnyPiece>>,
    /// Values, in the order of [`Block::parameters`].
    pub theta: Vec<f64>,
    /// Which of them the adjustment may change.
    pub free: Vec<bool>,
}

impl Block {
    /// A piece at its nominal values, wholly free.
    pub fn new(piece: Arc<dyn AnyPiece>) -> Self {
        let theta: Vec<f64> = piece.parameters().iter().map(|p| p.nominal).collect();
        Self { free: vec![true; theta.len()], theta, piece: Some(piece) }
    }

    /// The pinhole with free focal lengths and principal point, and the skew held.
    pub fn pinhole(theta: [f64; PINHOLE]) -> Self {
        Self { piece: None, theta: theta.to_vec(), free: vec![true, true, true, true, false] }
    }

    /// The piece; `None` for the pinhole.
    pub fn piece(&self) -> Option<&Arc<dyn AnyPiece>> {
        self.piece.as_ref()
    }

    /// Name in files and reports.
    pub fn name(&self) -> &'static str {
        self.piece.as_ref().map_or(pinhole::NAME, |p| p.name())
    }

    /// Name in print.
    pub fn title(&self) -> Cow<'static, str> {
        self.piece.as_ref().map_or(Cow::Borrowed(pinhole::TITLE), |p| p.title())
    }

    /// Where it acts; the pinhole counts as [`HookKind::Pixel`].
    pub fn hook(&self) -> HookKind {
        self.piece.as_ref().map_or(HookKind::Pixel, |p| p.hook())
    }

    /// Place and form of an effect of depth.
    pub fn placement(&self) -> Placement {
        self.piece.as_ref().map_or(Placement::default(), |p| p.placement())
    }

    /// Its parameters.
    pub fn parameters(&self) -> &[Parameter] {
        self.piece.as_ref().map_or(&pinhole::PARAMETERS, |p| p.parameters())
    }

    /// Its place, its form and its constants for people, with three significant digits and a unit: `period 300 mm`.
    pub fn constants_in_words(&self) -> Vec<String> {
        let Some(piece) = &self.piece else { return Vec::new() };
        let options = piece.options();
        let constants = piece.constants().into_iter().map(|c| c.words(c.of(&options)));
        piece.placement().words().into_iter().chain(constants).collect()
    }

    /// Value of a parameter by name.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.parameters().iter().position(|p| p.name == name).map(|i| self.theta[i])
    }

    /// Lays the block's piece over a camera's image and the depth that was seen.
    pub fn over(mut self, domain: &Domain) -> Self {
        self.piece = self.piece.map(|piece| piece.over(domain).unwrap_or(piece));
        self
    }

    /// Holds every parameter at its value.
    pub fn hold(mut self) -> Self {
        self.free.fill(false);
        self
    }
}
