//! The output of a formula's piece in every notation.

use depthcal_model::AddsTo;
use depthcal_model::hook::HookKind;

use super::latex::Latex;
use super::mathml::MathMl;
use super::notation::{Notation, sum, write};
use super::text::Text;
use crate::content::Content;
use crate::syntax::{Expression, Node, Operator};

/// The changed quantities of a formula with what is added: (z, e), (x, e₁), (y, e₂), ….
fn lines(content: &Content) -> Vec<(&'static str, &Expression)> {
    let names: &[&str] = match content.adds_to {
        AddsTo::Depth => &["z"],
        AddsTo::InverseDepth => &["rho"],
        AddsTo::Factor => &[],
        AddsTo::X => &["x"],
        AddsTo::Y => &["y"],
        AddsTo::Xy => &["x", "y"],
        AddsTo::Z => &["Z"],
        AddsTo::U => &["u"],
        AddsTo::V => &["v"],
        AddsTo::Uv => &["u", "v"],
    };
    names.iter().copied().zip(&content.expressions).collect()
}

/// The output of a piece in a notation: `z + …`, or the factor `z (1 + …)`.
fn output<N: Notation>(notation: &N, content: &Content) -> String {
    let plus = |first: Node, e: &Expression| write(notation, &sum(Expression { node: first, span: 0..0 }, e));
    if content.adds_to == AddsTo::Factor {
        let factor = notation.bracketed(&plus(Node::Number(1.0), &content.expressions[0]));
        let state = match content.hook() {
            HookKind::Depth => notation.name("z"),
            _ => notation.bracketed(&format!("{}{}{}", notation.name("x"), notation.comma(), notation.name("y"))),
        };
        return notation.binary(Operator::Multiply, &state, &factor);
    }
    let parts: Vec<String> = lines(content).into_iter().map(|(name, e)| plus(Node::Name(name.to_owned()), e)).collect();
    match parts.as_slice() {
        [one] => one.clone(),
        several => notation.bracketed(&several.join(notation.comma())),
    }
}

/// The output of the piece as a line of text: `ρ + a y ln(ρ/ρ₀)`.
pub(crate) fn equation(content: &Content) -> String {
    output(&Text, content)
}

/// The output of the piece as LaTeX.
pub(crate) fn latex(content: &Content) -> String {
    output(&Latex, content)
}

/// The output of the piece as an element of HTML.
pub(crate) fn mathml(content: &Content) -> String {
    format!("<math xmlns=\"http://www.w3.org/1998/Math/MathML\">{}</math>", output(&MathMl, content))
}
