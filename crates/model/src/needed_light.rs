//! Whether pieces depend on the light of whole frames.

use crate::frame_covariates::Modulation;
use crate::piece::{AnyPiece, Covariate};

/// The modulation frequencies of the first of some pieces that depends on the light of whole frames; `None` where none does. A
/// frame has one light: a model with two such pieces of different frequencies has that of the first.
pub fn needed_light<'a>(pieces: impl IntoIterator<Item = &'a dyn AnyPiece>) -> Option<Modulation> {
    let piece = pieces.into_iter().find(|piece| piece.needs().contains(&Covariate::StrayLight))?;
    Some(Modulation::of(&piece.options()))
}
