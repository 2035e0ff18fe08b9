//! Commands on datasets of several cameras.

mod calibrate;
mod evaluate;
mod load;
mod print;

pub(super) use calibrate::{RigCalibrate, calibrate};
pub(super) use evaluate::{RigEvaluate, evaluate};
