//! Commands on datasets of several cameras.

mod calibrate;
mod diagnose;
mod evaluate;
mod load;
mod print;

pub(super) use calibrate::{RigCalibrate, add_effects, calibrate};
pub(super) use diagnose::{RigDiagnose, diagnose};
pub(super) use evaluate::{RigEvaluate, evaluate};
pub(crate) use load::load;
