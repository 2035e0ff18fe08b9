//! A frame on its way through the stages: load, correct, invert in f64 where the stages do not reach, store.

mod back_project;
mod band;
mod buffers;
mod correct;
mod current_frame;
mod formats;
mod incidence;
mod store_points;

pub(crate) use back_project::back_project;
pub(crate) use buffers::{Input, Output};
pub(crate) use correct::correct;
