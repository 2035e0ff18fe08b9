//! Pieces: small smooth maps of the chain's state, each with a few parameters of its own.
//!
//! A piece is written once, as [`Piece`], generic over [`Scalar`]. [`erase`] makes it an [`AnyPiece`], which the chain
//! calls once per batch of observations; its Jacobians come from static dual numbers four directions at a time, which
//! costs about as much as derivatives by hand and never a dual wider than the piece.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;

use num_dual::DualSVec64;
use serde::{Deserialize, Serialize};

use crate::Scalar;
use crate::field::{Domain, FieldLayout};
use crate::hook::{Hook, HookKind, MAX_STATE};

/// One parameter of a piece.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Short name, unique within the piece.
    pub name: Cow<'static, str>,
    /// Unit, `1` for none.
    pub unit: &'static str,
    /// Value at which the piece does nothing (or its neutral start).
    pub nominal: f64,
    /// A typical magnitude of the deviation from nominal, for plots and numerical differences.
    pub scale: f64,
}

impl Parameter {
    /// A parameter from its name, unit, nominal value and typical deviation.
    pub const fn new(name: &'static str, unit: &'static str, nominal: f64, scale: f64) -> Self {
        Self { name: Cow::Borrowed(name), unit, nominal, scale }
    }
}

/// What a piece is to a search for missing effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Part of the declared model: the lens, D. Never a finding.
    Model,
    /// One physical effect with few parameters: may be missing, and is then named.
    Effect,
    /// A free map that takes up anything smooth: a competitor of effects, never a name.
    Map,
}

/// What is known of an observation, or follows from it, that an effect may depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Covariate {
    /// True depth, mm.
    Depth,
    /// True inverse depth, 1/mm.
    InverseDepth,
    /// Infrared amplitude.
    Amplitude,
    /// Time since the first frame, s.
    Time,
    /// Temperature, °C.
    Temperature,
}

/// A constant of a piece that is not fitted, and how its value is searched for in the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scan {
    /// Name of the constant, as in [`Piece::options`].
    pub constant: &'static str,
    /// What it belongs to.
    pub covariate: Covariate,
    /// What it is.
    pub kind: ScanKind,
}

/// What a scanned constant is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScanKind {
    /// Period of a wave over the covariate.
    Period,
    /// Constant of an exponential that settles over the covariate; infinity for a straight line.
    TimeConstant,
    /// Value at which the effect is zero.
    Reference,
    /// Distance between camera and projector, mm, of either sign.
    Baseline,
}

/// What is known of an observation beside the chain's state. Constant under differentiation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Context {
    /// Pixel of the depth image, px.
    pub pixel: [f64; 2],
    /// Infrared amplitude at the pixel, in the image's own steps; NaN where unknown.
    pub amplitude: f64,
    /// Mean infrared amplitude about the pixel, weighted by a Gaussian of [`SURROUND_PX`]; NaN where unknown.
    #[serde(default = "unknown")]
    pub surround: f64,
    /// Slope of the logarithm of that mean along u and v, 1/px; NaN where unknown.
    #[serde(default = "unknown_slope")]
    pub slope: [f64; 2],
    /// Time of the frame since the first, s; 0 where unknown.
    pub time_s: f64,
    /// Temperature of the frame, °C; NaN where unknown.
    pub temperature_c: f64,
}

/// Standard deviation of the Gaussian that [`Context::surround`] is weighted by, px.
pub const SURROUND_PX: f64 = 2.0;

fn unknown() -> f64 {
    f64::NAN
}

fn unknown_slope() -> [f64; 2] {
    [f64::NAN; 2]
}

impl Default for Context {
    fn default() -> Self {
        Self {
            pixel: [0.0; 2],
            amplitude: f64::NAN,
            surround: f64::NAN,
            slope: [f64::NAN; 2],
            time_s: 0.0,
            temperature_c: f64::NAN,
        }
    }
}

/// A piece of the measurement chain at hook `H` with `P` parameters.
///
/// # Example
///
/// ```
/// use depthcal_model::hook::{Depth, DepthState};
/// use depthcal_model::{Context, Parameter, Piece, Scalar};
///
/// /// A constant offset in inverse depth.
/// #[derive(Debug)]
/// struct Offset;
///
/// impl Piece<Depth, 1> for Offset {
///     const NAME: &'static str = "offset";
///     const SOURCE: &'static str = "an example";
///     const PARAMETERS: [Parameter; 1] = [Parameter::new("o", "1/mm", 0.0, 1e-5)];
///     fn map<T: Scalar>(&self, s: DepthState<T>, [o]: [T; 1], _: &Context) -> T {
///         s.rho + o
///     }
/// }
/// ```
pub trait Piece<H: Hook, const P: usize>: fmt::Debug + Send + Sync + 'static {
    /// Name in files, reports and on the command line.
    const NAME: &'static str;
    /// Where the equation comes from.
    const SOURCE: &'static str;
    /// Its parameters, in order.
    const PARAMETERS: [Parameter; P];
    /// What it is to a search for missing effects.
    const ROLE: Role = Role::Effect;
    /// Its constant that such a search varies.
    const SCAN: Option<Scan> = None;
    /// The equation, true towards measured.
    fn map<T: Scalar>(&self, state: H::State<T>, theta: [T; P], context: &Context) -> H::Output<T>;
    /// Constants of the piece that are not fitted (a period, a reference value), by name.
    fn options(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }
}

/// A piece whose hook and number of parameters are known at run time only. Made by [`erase`].
///
/// Batches are slices of `n` observations, row-major: `states` n × IN, `out` n × OUT, `d_state` n × OUT × IN,
/// `d_theta` n × OUT × P, with IN and OUT of the piece's [`Hook`].
pub trait AnyPiece: fmt::Debug + Send + Sync {
    /// [`Piece::NAME`].
    fn name(&self) -> &'static str;
    /// [`Piece::SOURCE`].
    fn source(&self) -> &'static str;
    /// Where it acts.
    fn hook(&self) -> HookKind;
    /// [`Piece::PARAMETERS`].
    fn parameters(&self) -> &[Parameter];
    /// [`Piece::options`] by name.
    fn options(&self) -> BTreeMap<String, f64>;
    /// [`Piece::ROLE`].
    fn role(&self) -> Role {
        Role::Effect
    }
    /// [`Piece::SCAN`].
    fn scan(&self) -> Option<Scan> {
        None
    }
    /// Values of a batch.
    fn evaluate(&self, theta: &[f64], states: &[f64], contexts: &[Context], out: &mut [f64]);
    /// Values and derivatives of a batch; those by the parameters only where asked for.
    fn linearize(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        d_theta: Option<&mut [f64]>,
    );
    /// How the parameters lie in the nodes of a grid, where they do.
    fn field(&self) -> Option<FieldLayout> {
        None
    }
    /// The same piece laid over a camera's image and the depth that was seen; `None` where that makes no difference.
    fn over(&self, _domain: &Domain) -> Option<Arc<dyn AnyPiece>> {
        None
    }
    /// The same piece with the parameters of one cell alone, for batches of observations that all lie in that cell.
    fn of_cell(&self) -> Option<Arc<dyn AnyPiece>> {
        None
    }
}

/// Makes a piece usable where hook and size are not known at compile time.
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

/// Directions that one dual number carries: wider ones defeat the compiler's scalar replacement.
const CHUNK: usize = 4;
type Dual = DualSVec64<CHUNK>;

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

impl<H: Hook, const P: usize, M: Piece<H, P>> AnyPiece for Erased<H, P, M> {
    fn name(&self) -> &'static str {
        M::NAME
    }

    fn source(&self) -> &'static str {
        M::SOURCE
    }

    fn hook(&self) -> HookKind {
        H::KIND
    }

    fn parameters(&self) -> &[Parameter] {
        const { &M::PARAMETERS }
    }

    fn options(&self) -> BTreeMap<String, f64> {
        self.piece.options().into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
    }

    fn role(&self) -> Role {
        M::ROLE
    }

    fn scan(&self) -> Option<Scan> {
        M::SCAN
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
}
