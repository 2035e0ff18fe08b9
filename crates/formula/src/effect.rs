//! An effect given as a formula.

use std::collections::BTreeMap;
use std::sync::Arc;

use depthcal_model::hook::HookKind;
use depthcal_model::{AddsTo, AnyPiece, FormulaDefinition, Options, PieceSpec, Placement, Register, RegisterError};

use crate::content::Content;
use crate::covariate::FormulaCovariate;
use crate::error::FormulaError;
use crate::function::FormulaFunction;
use crate::piece::FormulaPiece;
use crate::print;
use crate::reader::read;
use crate::shape::checked_scales;

/// An effect given as a formula, whose names, units and value at nominal parameters have been checked.
#[derive(Debug, Clone, PartialEq)]
pub struct FormulaEffect {
    content: Arc<Content>,
}

impl FormulaEffect {
    /// Checks a definition: names are known and used, units agree, and the effect is zero at nominal parameters.
    ///
    /// # Errors
    ///
    /// [`FormulaError`] with the place in the formula and the remedy.
    pub fn new(definition: FormulaDefinition) -> Result<Self, FormulaError> {
        let mut content = read(definition)?;
        content.scales = checked_scales(&content)?;
        Ok(Self { content: Arc::new(content) })
    }

    /// The definition, as files have it.
    pub fn definition(&self) -> &FormulaDefinition {
        &self.content.definition
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.content.definition.name
    }

    /// Where it acts.
    pub fn hook(&self) -> HookKind {
        self.content.hook()
    }

    /// The quantity that the value of its formula is added to.
    pub fn adds_to(&self) -> AddsTo {
        self.content.adds_to
    }

    /// The covariates that its formula uses, in the order of [`FormulaCovariate::ALL`], quantities after them.
    pub fn covariates(&self) -> &[FormulaCovariate] {
        &self.content.covariates
    }

    /// Units of its constants by name: as declared, or as the formula asks for.
    pub fn units_of_constants(&self) -> &BTreeMap<String, String> {
        &self.content.units_of_constants
    }

    /// Typical deviations of its parameters from nominal: as declared, or such that the effect is about a millimetre at a metre.
    pub fn scales(&self) -> &[f64] {
        &self.content.scales
    }

    /// Its specification, with the place where its definition has it.
    pub fn spec(&self) -> PieceSpec {
        PieceSpec::new(self.name()).placed(Placement { of: self.content.definition.of, on: None })
    }

    /// The piece, with constants of other values than the definition's where `options` has them.
    pub fn piece(&self, options: &Options) -> Arc<dyn AnyPiece> {
        Arc::new(FormulaPiece::new(&self.content, options))
    }

    /// Adds the piece to a register.
    ///
    /// # Errors
    ///
    /// [`FormulaError::NameTaken`] where a piece that is no formula has its name.
    pub fn register(&self, register: &mut Register) -> Result<(), FormulaError> {
        if register.find(self.name()).is_some_and(|piece| piece.formula().is_none()) {
            return Err(FormulaError::NameTaken { effect: self.name().to_owned() });
        }
        let effect = self.clone();
        let name = crate::intern::text(self.name());
        register.add_any(name, self.hook(), move |options| effect.piece(options));
        Ok(())
    }

    /// The piece with these constants in a place and form.
    ///
    /// # Errors
    ///
    /// [`RegisterError`] where it has no such constant, or cannot be placed.
    pub fn placed_piece(&self, options: &Options, placement: Placement) -> Result<Arc<dyn AnyPiece>, RegisterError> {
        let (effect, name) = (self.clone(), crate::intern::text(self.name()));
        let mut register = Register::empty();
        register.add_any(name, self.hook(), move |options| effect.piece(options));
        register.placed_piece(name, options, placement)
    }

    /// The values of its formulas as a function of the covariates.
    pub fn function(&self) -> FormulaFunction {
        FormulaFunction::new(&self.content)
    }

    /// Values of its parameters for simulations; `None` where one has none.
    pub fn values(&self) -> Option<Vec<f64>> {
        self.content.definition.parameters.values().map(|parameter| parameter.table().value).collect()
    }

    /// The formula as a line of text, what it is added to included: `ρ + a y ln(ρ/ρ₀)`.
    pub fn text(&self) -> String {
        print::equation(&self.content)
    }

    /// The formula as LaTeX, like [`text`](Self::text), without dollar signs.
    pub fn latex(&self) -> String {
        print::latex(&self.content)
    }

    /// The formula as MathML, like [`text`](Self::text), an element `math` for HTML.
    pub fn mathml(&self) -> String {
        print::mathml(&self.content)
    }
}
