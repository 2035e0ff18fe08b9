//! From text to an expression whose every part knows where it stands in the text.

mod expression;
mod parse;
mod position;
mod unit_text;

pub(crate) use expression::{Expression, Function, Node, Operator, SPLINE_RANGE};
pub(crate) use parse::{SyntaxError, parse};
pub(crate) use position::{Position, underlined};
pub(crate) use unit_text::{Factor, parse_unit};
