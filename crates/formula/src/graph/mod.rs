//! Formulas as graphs of operations: equal parts are one node, derivatives are nodes of the same graph, and what is needed is put
//! into a sequence of instructions that runs over batches.

mod build;
mod derivative;
mod node;
mod tape;

pub(crate) use node::{Graph, Id, Input, Unary};
pub(crate) use tape::Tape;
