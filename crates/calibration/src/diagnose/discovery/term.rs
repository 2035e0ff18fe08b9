//! A term of a formula: functions of covariates in a place and a form.

use std::collections::BTreeSet;

use depthcal_formula::FormulaCovariate as C;
use depthcal_model::{Of, On};

use super::library::{Function, Kind};

/// A sum of products of functions, all in one place and form, each column with a parameter of its own.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Term {
    pub of: Of,
    pub on: On,
    /// The products; one that the search found first, then those that were added to it.
    pub products: Vec<Product>,
}

/// A function, alone or times another of another covariate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Product {
    pub factor: Option<Function>,
    pub function: Function,
}

/// Covariates that data hardly tell apart, as one: depth and what follows from it, directions and pixels.
pub(super) fn family(covariate: C) -> C {
    match covariate {
        C::Rho | C::Range => C::Z,
        C::U => C::X,
        C::V => C::Y,
        C::Surroundings => C::Amplitude,
        other => other,
    }
}

impl Product {
    /// An offset: the same everywhere.
    pub const OFFSET: Self =
        Self { factor: None, function: Function { covariate: C::Z, kind: Kind::Power(0), constant: 0.0 } };

    /// A covariate as it is.
    pub fn linear(covariate: C) -> Self {
        Self { factor: None, function: Function { covariate, kind: Kind::Power(1), constant: 0.0 } }
    }

    /// Number of its columns.
    pub fn columns(&self) -> usize {
        self.function.kind.columns()
    }

    /// Its covariates; none of an offset.
    pub fn covariates(&self) -> BTreeSet<C> {
        let functions = self.factor.iter().chain([&self.function]);
        functions.filter(|f| f.kind != Kind::Power(0)).map(|f| f.covariate).collect()
    }

    fn complexity(&self) -> u32 {
        let factor = self.factor.map_or(0, |f| 3 + f.kind.complexity());
        factor + self.function.kind.complexity()
    }
}

impl Term {
    /// A term of one product.
    pub fn new(of: Of, on: On, product: Product) -> Self {
        Self { of, on, products: vec![product] }
    }

    /// Number of its columns, which is that of its parameters.
    pub fn columns(&self) -> usize {
        self.products.iter().map(Product::columns).sum()
    }

    /// Its covariates.
    pub fn covariates(&self) -> BTreeSet<C> {
        self.products.iter().flat_map(Product::covariates).collect()
    }

    /// The names of its covariates, sorted.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = self.covariates().into_iter().map(|c| c.name().to_owned()).collect();
        names.sort_unstable();
        names
    }

    /// The families of its covariates ([`family`]).
    pub fn families(&self) -> BTreeSet<C> {
        self.covariates().into_iter().map(family).collect()
    }

    /// How much has to be said of it.
    pub fn complexity(&self) -> u32 {
        self.products.iter().map(Product::complexity).sum::<u32>() + self.columns() as u32
    }

    /// The first searched constant: its product.
    pub fn searched(&self) -> Option<usize> {
        self.products.iter().position(|p| p.function.kind.is_searched())
    }

    /// This term with another value of the constant of the factor of a product.
    pub fn with_factor_constant(&self, product: usize, value: f64) -> Self {
        let mut term = self.clone();
        if let Some(factor) = &mut term.products[product].factor {
            factor.constant = value;
        }
        term
    }

    /// This term with another value of the constant of the function of a product.
    pub fn with_constant(&self, product: usize, value: f64) -> Self {
        let mut term = self.clone();
        term.products[product].function.constant = value;
        term
    }
}
