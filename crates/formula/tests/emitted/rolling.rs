use crate::hook::Pixel;
use crate::piece::{Constant, Context, Covariate, Options, Parameter, Piece, Scalar};

const K: Constant =
    Constant::new("k", "k", "px", 500.0);

/// The place in the depth image depends on column u (px), row v (px) and time (s) by a formula.
#[derive(Debug, Clone, Copy)]
pub struct Rolling {
    /// Constant k of the formula, px.
    pub k: f64,
}

impl Rolling {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { k: K.of(given) }
    }
}

impl Piece<Pixel, 2> for Rolling {
    const NAME: &'static str = "rolling";
    const SUMMARY: &'static str = "the place in the depth image depends on column u (px), row v (px) and time (s) by a formula";
    const EQUATION: &'static str = "(u + a v, v − b (u/k)² t)";
    const SOURCE: &'static str = "a formula of the user";
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("a", "1", 0.0, 0.00182).meaning("Parameter a of the formula a * v; -b * (u / k)^2 * timestamp_s."),
        Parameter::new("b", "px/s", 0.0, 0.000614).meaning("Parameter b of the formula a * v; -b * (u / k)^2 * timestamp_s."),
    ];
    const CONSTANTS: &'static [Constant] = &[K];
    const NEEDS: &'static [Covariate] = &[Covariate::Time];

    #[inline(always)]
    fn map<T: Scalar>(&self, [u, v]: [T; 2], [a, b]: [T; 2], c: &Context) -> [T; 2] {
        let timestamp_s = c.time_s;
        [u + (a * v), v + (((-b) * (u / self.k).powi(2)) * timestamp_s)]
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(K.name, self.k)]
    }
}
