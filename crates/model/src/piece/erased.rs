use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;

use num_dual::DualSVec64;

use super::any::AnyPiece;
use super::constant::{Constant, Options};
use super::context::Context;
use super::covariate::Covariate;
use super::definition::Piece;
use super::parameter::Parameter;
use super::placement::On;
use super::role::Role;
use crate::hook::{Hook, HookKind, MAX_STATE};
use crate::technology::Technology;

/// A piece for use where its hook and its number of parameters are not known at compile time.
pub fn erase<H: Hook, const P: usize, M: Piece<H, P>>(piece: M) -> Arc<dyn AnyPiece> {
    Arc::new(Erased::<H, P, M>::new(piece))
}

/// A [`Piece`] as an [`AnyPiece`].
pub(crate) struct Erased<H, const P: usize, M> {
    piece: M,
    hook: PhantomData<fn() -> H>,
}

impl<H: Hook, const P: usize, M: Piece<H, P>> fmt::Debug for Erased<H, P, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.piece.fmt(f)
    }
}

/// Directions that one dual number carries: the compiler keeps wider ones in memory instead of registers.
const CHUNK: usize = 4;
type Dual = DualSVec64<CHUNK>;
const _: () = assert!(CHUNK <= 4, "wider dual numbers do not fit into registers");

impl<H: Hook, const P: usize, M: Piece<H, P>> Erased<H, P, M> {
    pub(crate) fn new(piece: M) -> Self {
        Self { piece, hook: PhantomData }
    }

    fn parameters_of(theta: &[f64]) -> [f64; P] {
        std::array::from_fn(|i| theta[i])
    }

    /// One pass with directions `first .. first + CHUNK` of (state, theta) seeded.
    #[inline(always)]
    fn pass(&self, theta: &[f64; P], state: &[f64], context: &Context, first: usize) -> [Dual; 3] {
        let seed = |value: f64, direction: usize| match direction.checked_sub(first) {
            Some(d) if d < CHUNK => Dual::from_re(value).derivative(d),
            _ => Dual::from_re(value),
        };
        let mut s = [Dual::from_re(0.0); MAX_STATE];
        for i in 0..H::IN {
            s[i] = seed(state[i], i);
        }
        let t: [Dual; P] = std::array::from_fn(|i| seed(theta[i], H::IN + i));
        H::write(self.piece.map(H::read(&s[..H::IN]), t, context))
    }
}

/// Inverse depth and its derivatives by (x, y, ρ, cos) where no piece changes it.
pub(super) fn identity(states: &[f64], out: &mut [f64], d_state: &mut [f64]) {
    for ((state, out), d) in states.chunks_exact(4).zip(out).zip(d_state.chunks_exact_mut(4)) {
        *out = state[2];
        d.copy_from_slice(&[0.0, 0.0, 1.0, 0.0]);
    }
}

impl<H: Hook, const P: usize, M: Piece<H, P>> AnyPiece for Erased<H, P, M> {
    fn name(&self) -> &'static str {
        M::NAME
    }

    fn title(&self) -> Cow<'static, str> {
        M::TITLE.map_or_else(|| Cow::Owned(M::NAME.replace('_', " ")), Cow::Borrowed)
    }

    fn summary(&self) -> &'static str {
        M::SUMMARY
    }

    fn equation(&self) -> &'static str {
        M::EQUATION
    }

    fn source(&self) -> &'static str {
        M::SOURCE
    }

    fn confounded(&self) -> Option<&'static str> {
        M::CONFOUNDED
    }

    fn hook(&self) -> HookKind {
        H::KIND
    }

    fn parameters(&self) -> &[Parameter] {
        const { &M::PARAMETERS }
    }

    fn constants(&self) -> Vec<Constant> {
        M::CONSTANTS.to_vec()
    }

    fn options(&self) -> Options {
        self.piece.options().into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
    }

    fn technologies(&self) -> &'static [Technology] {
        M::TECHNOLOGIES
    }

    fn role(&self) -> Role {
        M::ROLE
    }

    fn form(&self) -> On {
        M::FORM
    }

    fn needs(&self) -> &'static [Covariate] {
        M::NEEDS
    }

    fn is_offset_map(&self) -> bool {
        M::OFFSET_MAP
    }

    fn acts_first(&self) -> bool {
        M::ACTS_FIRST
    }

    fn evaluate(&self, theta: &[f64], states: &[f64], contexts: &[Context], out: &mut [f64]) {
        let theta = Self::parameters_of(theta);
        let rows = states.chunks_exact(H::IN).zip(contexts).zip(out.chunks_exact_mut(H::OUT));
        for ((state, context), y) in rows {
            y.copy_from_slice(&H::write(self.piece.map(H::read(state), theta, context))[..H::OUT]);
        }
    }

    fn linearize(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        mut d_theta: Option<&mut [f64]>,
    ) {
        let theta = Self::parameters_of(theta);
        let directions = if d_theta.is_some() { H::IN + P } else { H::IN };
        for (k, (state, context)) in states.chunks_exact(H::IN).zip(contexts).enumerate() {
            for first in (0..directions).step_by(CHUNK) {
                let y = self.pass(&theta, state, context, first);
                for o in 0..H::OUT {
                    if first == 0 {
                        out[k * H::OUT + o] = y[o].re;
                    }
                    let row = k * H::OUT + o;
                    for c in 0..CHUNK.min(directions - first) {
                        let derivative = y[o].eps.0.map_or(0.0, |eps| eps[c]);
                        let direction = first + c;
                        if direction < H::IN {
                            d_state[row * H::IN + direction] = derivative;
                        } else if let Some(d_theta) = d_theta.as_deref_mut() {
                            d_theta[row * P + direction - H::IN] = derivative;
                        }
                    }
                }
            }
        }
    }

    fn linearize_at_nominal(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        d_theta: &mut [f64],
    ) {
        if H::KIND != HookKind::Depth {
            return self.linearize(theta, states, contexts, out, d_state, Some(d_theta));
        }
        identity(states, out, d_state);
        let theta = Self::parameters_of(theta);
        for ((state, context), row) in states.chunks_exact(H::IN).zip(contexts).zip(d_theta.chunks_exact_mut(P.max(1)))
        {
            for (first, part) in (H::IN..).step_by(CHUNK).zip(row.chunks_mut(CHUNK)) {
                let y = self.pass(&theta, state, context, first);
                let eps = y[0].eps.0.map_or([0.0; CHUNK], |eps| std::array::from_fn(|c| eps[c]));
                part.iter_mut().zip(eps).for_each(|(d, eps)| *d = eps);
            }
        }
    }
}
