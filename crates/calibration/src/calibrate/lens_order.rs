//! The orders of the Brown–Conrady lens: which of its terms are fitted, and the record of a choice among them.

use std::fmt;

use depthcal_model::{Block, Camera, Register, RegisterError};

use crate::start::lens_block;

/// Name of the lens model that has orders.
pub(super) const BROWN_CONRADY: &str = "brown_conrady";

/// How many terms of the Brown–Conrady lens are fitted; the others are held at zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LensOrder {
    /// k1.
    K1,
    /// k1 and k2.
    K1K2,
    /// k1, k2 and the decentring p1, p2.
    K1K2P1P2,
    /// All five, with k3.
    Full,
}

impl LensOrder {
    /// All orders, the simplest first.
    pub const ALL: [Self; 4] = [Self::K1, Self::K1K2, Self::K1K2P1P2, Self::Full];

    /// Name on the command line, after `brown-conrady:`.
    pub fn name(self) -> &'static str {
        match self {
            Self::K1 => "k1",
            Self::K1K2 => "k1k2",
            Self::K1K2P1P2 => "k1k2p1p2",
            Self::Full => "full",
        }
    }

    /// Which of k1, k2, p1, p2, k3 are fitted.
    pub fn free(self) -> [bool; 5] {
        let [k2, p, k3] = [Self::K1K2, Self::K1K2P1P2, Self::Full].map(|order| self >= order);
        [true, k2, p, p, k3]
    }

    /// The block with the terms beyond this order held at zero; other blocks as they are.
    fn limit(self, mut block: Block) -> Block {
        if block.name() == BROWN_CONRADY {
            for (i, fitted) in self.free().into_iter().enumerate() {
                if !fitted {
                    (block.theta[i], block.free[i]) = (0.0, false);
                }
            }
        }
        block
    }

    /// The camera with the terms of its lens beyond this order held at zero.
    pub(super) fn of_camera(self, camera: &Camera) -> Camera {
        camera.map_blocks(|block| self.limit(block))
    }
}

impl fmt::Display for LensOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::K1 => "k1",
            Self::K1K2 => "k1 k2",
            Self::K1K2P1P2 => "k1 k2 p1 p2",
            Self::Full => "k1 k2 p1 p2 k3",
        })
    }
}

/// The lens model's piece and the order asked for, from an option such as `brown-conrady`, `brown-conrady:full` or `none`.
pub(super) fn requested(lens: &str) -> (String, Option<LensOrder>) {
    let lens = lens.replace('-', "_");
    let order = lens.split_once(':').and_then(|(piece, name)| {
        let order = LensOrder::ALL.into_iter().find(|o| piece == BROWN_CONRADY && o.name() == name)?;
        Some((piece.to_owned(), order))
    });
    match order {
        Some((piece, order)) => (piece, Some(order)),
        None => (lens, None),
    }
}

/// The block of a lens model as an option names it, with an order or without; `None` for `none`.
///
/// # Errors
///
/// [`RegisterError`] where the name is unknown.
pub fn lens_named(lens: &str, register: &Register) -> Result<Option<Block>, RegisterError> {
    let (piece, order) = requested(lens);
    let block = lens_block(&piece, register)?;
    Ok(block.map(|block| match order {
        Some(order) => order.limit(block),
        None => block,
    }))
}

/// The choice of the order of a lens.
#[derive(Debug, Clone, PartialEq)]
pub struct LensChoice {
    /// The chosen order.
    pub order: LensOrder,
    /// Compared orders, the simplest first.
    pub candidates: Vec<LensCandidate>,
}

impl fmt::Display for LensChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let errors: Vec<String> =
            self.candidates.iter().map(|c| format!("{}: {:.3} px", c.order, c.held_out_px)).collect();
        write!(f, "{} is fitted; errors on left-out frames: {}", self.order, errors.join(", "))
    }
}

/// One order of a lens that was compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensCandidate {
    /// The order.
    pub order: LensOrder,
    /// Root mean square reprojection error of left-out frames, px, whose poses follow from their own markers; infinite where
    /// the other frames do not determine this order.
    pub held_out_px: f64,
    /// Whether the lens is one-to-one over the whole image.
    pub one_to_one: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_read_and_nested() {
        assert_eq!(requested("brown-conrady"), ("brown_conrady".to_owned(), None));
        assert_eq!(requested("brown-conrady:k1k2"), ("brown_conrady".to_owned(), Some(LensOrder::K1K2)));
        assert_eq!(requested("none"), ("none".to_owned(), None));
        for pair in LensOrder::ALL.windows(2) {
            assert!(pair[0].free().iter().zip(pair[1].free()).all(|(low, high)| !low || high));
        }
        assert_eq!(LensOrder::K1K2P1P2.free(), [true, true, true, true, false]);
    }
}
