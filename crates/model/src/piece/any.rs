use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use super::constant::{Constant, Options, Scan};
use super::context::Context;
use super::covariate::Covariate;
use super::formula::FormulaDefinition;
use super::parameter::Parameter;
use super::placement::{On, Placement};
use super::role::Role;
use super::smooth::SmoothParameters;
use crate::grid::layout::FieldLayout;
use crate::grid::nodes::Domain;
use crate::hook::HookKind;
use crate::technology::Technology;

/// A piece whose hook and number of parameters are known at run time only. Made by [`erase`](super::erase).
///
/// Batches are slices of `n` observations, row-major: `states` n × IN, `out` n × OUT, `d_state` n × OUT × IN,
/// `d_theta` n × OUT × P, with IN and OUT of the piece's [`Hook`](crate::hook::Hook) and P its number of parameters.
pub trait AnyPiece: fmt::Debug + Send + Sync {
    /// [`Piece::NAME`](super::Piece::NAME).
    fn name(&self) -> &'static str;
    /// The piece whose description this one has, where it is that piece in another form.
    fn described_by(&self) -> Option<&dyn AnyPiece> {
        None
    }
    /// Its name in print: [`Piece::TITLE`](super::Piece::TITLE), else the name with spaces.
    fn title(&self) -> Cow<'static, str> {
        self.described_by().map_or_else(|| Cow::Owned(self.name().replace('_', " ")), AnyPiece::title)
    }
    /// [`Piece::SUMMARY`](super::Piece::SUMMARY); empty where it has none.
    fn summary(&self) -> &'static str {
        self.described_by().map_or("", AnyPiece::summary)
    }
    /// [`Piece::EQUATION`](super::Piece::EQUATION); empty where it has none.
    fn equation(&self) -> &'static str {
        self.described_by().map_or("", AnyPiece::equation)
    }
    /// [`Piece::SOURCE`](super::Piece::SOURCE).
    fn source(&self) -> &'static str;
    /// [`Piece::CONFOUNDED`](super::Piece::CONFOUNDED).
    fn confounded(&self) -> Option<&'static str> {
        self.described_by()?.confounded()
    }
    /// Where it acts.
    fn hook(&self) -> HookKind;
    /// [`Piece::PARAMETERS`](super::Piece::PARAMETERS).
    fn parameters(&self) -> &[Parameter];
    /// [`Piece::CONSTANTS`](super::Piece::CONSTANTS), and those of its grid for a field.
    fn constants(&self) -> Vec<Constant> {
        self.described_by().map_or_else(Vec::new, AnyPiece::constants)
    }
    /// Values of its constants by name.
    fn options(&self) -> Options {
        self.described_by().map_or_else(Options::new, AnyPiece::options)
    }
    /// [`Piece::NEEDS`](super::Piece::NEEDS).
    fn needs(&self) -> &'static [Covariate] {
        self.described_by().map_or(&[], AnyPiece::needs)
    }
    /// [`Piece::TECHNOLOGIES`](super::Piece::TECHNOLOGIES).
    fn technologies(&self) -> &'static [Technology] {
        self.described_by().map_or(&[], AnyPiece::technologies)
    }
    /// [`Piece::ROLE`](super::Piece::ROLE).
    fn role(&self) -> Role {
        self.described_by().map_or(Role::Effect, AnyPiece::role)
    }
    /// [`Piece::OFFSET_MAP`](super::Piece::OFFSET_MAP).
    fn is_offset_map(&self) -> bool {
        self.described_by().is_some_and(AnyPiece::is_offset_map)
    }
    /// [`Piece::ACTS_FIRST`](super::Piece::ACTS_FIRST).
    fn acts_first(&self) -> bool {
        false
    }
    /// [`Piece::FORM`](super::Piece::FORM): the form of its equation, wherever it is placed.
    fn form(&self) -> On {
        self.described_by().map_or(On::Depth, AnyPiece::form)
    }
    /// Its definition, for a piece that is given as a formula; files carry it whole.
    fn formula(&self) -> Option<&FormulaDefinition> {
        self.described_by()?.formula()
    }
    /// Its parameters that are values of smooth functions.
    fn smooth(&self) -> &[SmoothParameters] {
        self.described_by().map_or(&[], AnyPiece::smooth)
    }
    /// Where it acts on depth, and how.
    fn placement(&self) -> Placement {
        Placement::default()
    }
    /// Whether it can act in another place and form ([`Placement`]): an effect of depth that is no field. Light of the whole
    /// frame adds to the phase at the true range, and nowhere else.
    fn can_be_placed(&self) -> bool {
        let of_light = self.needs().contains(&Covariate::StrayLight);
        self.hook() == HookKind::Depth && self.role() == Role::Effect && self.field().is_none() && !of_light
    }
    /// Its constant that a search for missing effects varies.
    fn scan(&self) -> Option<Scan> {
        self.constants().iter().find_map(Constant::scan)
    }
    /// Values of a batch.
    fn evaluate(&self, theta: &[f64], states: &[f64], contexts: &[Context], out: &mut [f64]);
    /// Values and derivatives of a batch; those by the parameters only where `d_theta` is given.
    fn linearize(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        d_theta: Option<&mut [f64]>,
    );
    /// [`AnyPiece::linearize`] of a depth effect whose parameters are `theta`, its nominal ones, so that it changes nothing:
    /// ∂ρ/∂ρ is 1 and only derivatives by the parameters are computed.
    fn linearize_at_nominal(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        d_theta: &mut [f64],
    ) {
        self.linearize(theta, states, contexts, out, d_state, Some(d_theta));
    }
    /// The layout of its parameters in the nodes of a grid; `None` for a piece that is no field.
    fn field(&self) -> Option<FieldLayout> {
        None
    }
    /// The piece laid over a camera's image and the depth that was seen; `None` where that makes no difference.
    fn over(&self, _domain: &Domain) -> Option<Arc<dyn AnyPiece>> {
        None
    }
    /// The piece with the parameters of one cell alone, for batches of observations that all lie in that cell; `None` for a piece
    /// that is no field.
    fn of_cell(&self) -> Option<Arc<dyn AnyPiece>> {
        None
    }
}
