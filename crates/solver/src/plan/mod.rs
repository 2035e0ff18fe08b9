//! Decisions made once per problem, before the first iteration: which components move and where they lie in the step, which
//! linear solver is used, which variables are eliminated and in which order, and how the work is divided into chunks.

pub(crate) mod bounds;
pub(crate) mod choice;
pub(crate) mod chunk_builder;
pub(crate) mod chunk_plan;
pub(crate) mod division;
pub(crate) mod layout;
pub(crate) mod linear_solver;
pub(crate) mod ordering;
pub(crate) mod partition;
