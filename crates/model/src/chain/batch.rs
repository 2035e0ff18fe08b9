//! Running the pieces of a hook over a batch of observations, and the memory for it.

use std::sync::Arc;

use crate::hook::HookKind;
use crate::piece::{AnyPiece, Context, Role};
use crate::pose::POSE;

/// A piece and the place of its parameters.
#[derive(Debug, Clone)]
pub(super) struct Link {
    pub(super) piece: Arc<dyn AnyPiece>,
    /// First of its parameters in `theta`.
    pub(super) offset: usize,
    pub(super) count: usize,
}

impl Link {
    pub(super) fn theta<'a>(&self, theta: &'a [f64]) -> &'a [f64] {
        &theta[self.offset..self.offset + self.count]
    }

    /// Whether it is an effect at its nominal parameters.
    fn changes_nothing(&self, theta: &[f64]) -> bool {
        let nominal = self.piece.parameters().iter().map(|p| p.nominal);
        self.piece.role() == Role::Effect && nominal.eq(theta.iter().copied())
    }
}

/// Scratch memory of a [`Chain`](crate::chain::Chain), reused from call to call so that nothing is allocated per observation.
#[derive(Debug, Default)]
pub struct Workspace {
    pub(super) board: Vec<Local>,
    pub(super) lens: Vec<Local>,
    pub(super) pixel: Vec<Local>,
    pub(super) depth: Vec<Local>,
    pub(super) state: Vec<f64>,
    pub(super) next: Vec<f64>,
    pub(super) contexts: Vec<Context>,
    pub(super) seeds: Vec<[f64; 2]>,
    pub(super) points: Vec<Ray>,
    /// Derivatives of the board point by the pixel, mm/px.
    pub(super) by_pixel: Vec<[[f64; 2]; 2]>,
}

/// Derivatives of one piece over a batch.
#[derive(Debug, Default, Clone)]
pub(super) struct Local {
    pub(super) d_state: Vec<f64>,
    pub(super) d_theta: Vec<f64>,
}

/// One observation in the middle of the chain.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Ray {
    /// On the real board, board frame, mm.
    pub(super) on_board: [f64; 3],
    /// Normalised direction and inverse depth.
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) rho: f64,
    /// After the lens.
    pub(super) distorted: [f64; 2],
    /// After pinhole and pixel pieces, px.
    pub(super) pixel: [f64; 2],
}

/// Which parts of the chain a caller runs, and whether parameters are differentiated.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Derive {
    State,
    All,
}

/// The pieces of one hook, with the places of their parameters.
pub(super) fn links(pieces: &[Arc<dyn AnyPiece>], kind: HookKind, offset: &mut usize) -> Vec<Link> {
    let mut link = |piece: &Arc<dyn AnyPiece>| {
        let count = piece.parameters().len();
        *offset += count;
        Link { piece: piece.clone(), offset: *offset - count, count }
    };
    pieces.iter().filter(|piece| piece.hook() == kind).map(&mut link).collect()
}

/// Adds gᵀ ∂(output)/∂(parameters) of one piece to its columns.
#[inline(always)]
pub(super) fn add_theta<const OUT: usize>(
    row: &mut Option<&mut [f64]>,
    link: &Link,
    local: &Local,
    k: usize,
    g: &[f64; OUT],
) {
    if let Some(row) = row.as_deref_mut().filter(|row| row.len() > POSE) {
        let columns = &mut row[POSE + link.offset..][..link.count];
        let block = &local.d_theta[k * OUT * link.count..(k + 1) * OUT * link.count];
        for (o, g) in g.iter().enumerate() {
            for (c, d) in columns.iter_mut().zip(&block[o * link.count..]) {
                *c += g * d;
            }
        }
    }
}

/// Runs the pieces of one hook over the batch in `work.state`, in place.
pub(super) fn run(
    links: &[Link],
    inputs: usize,
    outputs: usize,
    theta: &[f64],
    work: &mut Workspace,
    kind: HookKind,
    derive: Option<Derive>,
) {
    if links.is_empty() {
        return;
    }
    let n = work.contexts.len();
    let locals = match kind {
        HookKind::Board => &mut work.board,
        HookKind::Lens => &mut work.lens,
        HookKind::Pixel => &mut work.pixel,
        HookKind::Depth => &mut work.depth,
        HookKind::Pose => return,
    };
    locals.resize(links.len(), Local::default());
    for (link, local) in links.iter().zip(locals) {
        work.next.resize(n * outputs, 0.0);
        let next = &mut work.next[..n * outputs];
        let parameters = link.theta(theta);
        match derive {
            None => link.piece.evaluate(parameters, &work.state, &work.contexts, next),
            Some(derive) => {
                local.d_state.resize(n * outputs * inputs, 0.0);
                local.d_theta.resize(n * outputs * link.count, 0.0);
                let (d_state, d_theta) = (&mut local.d_state[..], &mut local.d_theta[..]);
                let (states, contexts) = (&work.state, &work.contexts);
                match derive {
                    Derive::All if kind == HookKind::Depth && link.changes_nothing(parameters) => {
                        link.piece.linearize_at_nominal(parameters, states, contexts, next, d_state, d_theta);
                    }
                    Derive::All => link.piece.linearize(parameters, states, contexts, next, d_state, Some(d_theta)),
                    Derive::State => link.piece.linearize(parameters, states, contexts, next, d_state, None),
                }
            }
        }
        // The output replaces the part of the state that the hook's pieces hand on.
        let handed_on = match kind {
            HookKind::Lens => 3..5,
            HookKind::Depth => 2..3,
            _ => 0..outputs,
        };
        for (state, out) in work.state.chunks_exact_mut(inputs).zip(next.chunks_exact(outputs)) {
            state[handed_on.clone()].copy_from_slice(out);
        }
    }
}
