use std::fmt;

use super::constant::Constant;
use super::context::Context;
use super::covariate::Covariate;
use super::parameter::Parameter;
use super::placement::On;
use super::role::Role;
use crate::hook::Hook;
use crate::scalar::Scalar;
use crate::technology::Technology;

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
///     const SUMMARY: &'static str = "a constant is added to the disparity";
///     const EQUATION: &'static str = "ρ + o";
///     const SOURCE: &'static str = "an example";
///     const PARAMETERS: [Parameter; 1] = [Parameter::new("o", "1/mm", 0.0, 1e-5).meaning("Offset of inverse depth.")];
///
///     fn map<T: Scalar>(&self, s: DepthState<T>, [o]: [T; 1], _: &Context) -> T {
///         s.rho + o
///     }
/// }
/// ```
pub trait Piece<H: Hook, const P: usize>: fmt::Debug + Send + Sync + 'static {
    /// Name in files, reports and on the command line.
    const NAME: &'static str;
    /// Title in print where the name with spaces will not do.
    const TITLE: Option<&'static str> = None;
    /// Summary in plain words that follow its name and a colon, without a full stop: `depth waves over distance`.
    const SUMMARY: &'static str;
    /// The equation in print: the output in terms of state, parameters and constants.
    const EQUATION: &'static str;
    /// Where the equation comes from.
    const SOURCE: &'static str;
    /// The causes that its parameters take up together and captures of a board cannot tell apart, in sentences.
    const CONFOUNDED: Option<&'static str> = None;
    /// Its parameters, in order.
    const PARAMETERS: [Parameter; P];
    /// Its constants, which are declared and not fitted; [`Piece::options`] has their values.
    const CONSTANTS: &'static [Constant] = &[];
    /// Covariates that must be known and must vary for the effect to be visible. Pixel, ray and depth always are known and
    /// are not listed.
    const NEEDS: &'static [Covariate] = &[];
    /// Technologies of the cameras that have the effect; empty where those of any may have it.
    const TECHNOLOGIES: &'static [Technology] = &[];
    /// Its role in a search for missing effects.
    const ROLE: Role = Role::Effect;
    /// The quantity that its equation adds its shape to, for a piece of depth.
    const FORM: On = On::Depth;
    /// Whether it only adds to ρ an offset map over the image and cannot scale ρ. A depth model of such a map alone is given
    /// a free scale and offset (see [`Register::depth_model`](crate::Register::depth_model)).
    const OFFSET_MAP: bool = false;
    /// Whether a lens piece acts before those that do not, in whatever order a camera is given them.
    const ACTS_FIRST: bool = false;
    /// The equation, true towards measured.
    fn map<T: Scalar>(&self, state: H::State<T>, theta: [T; P], context: &Context) -> H::Output<T>;
    /// Values of its constants, by their names in files.
    fn options(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }
}
