//! From captures of a board to a judged model of the depth camera.
//!
//! The modules are the stages of the data's way, each depending only on those before it:
//!
//! | stage | module |
//! |---|---|
//! | what was measured: markers, depth samples, noise, which pixels are board | [`observe`] |
//! | start values from homographies | [`start`] |
//! | why data and declarations contradict each other | [`cause`] |
//! | D from markers' depth alone, as in the thesis | [`estimators`] |
//! | one joint adjustment on the solver: factors, fields and their smoothness | [`adjust`] |
//! | the driver: image, depth, noise, outliers, until they settle | [`calibrate`] |
//! | files of a dataset to detected boards, with dots refined by a fitted camera | [`load`] |
//! | errors on frames that the fit did not see | [`judge`] |
//! | which captures lower an uncertainty most | [`plan`] |
//! | depth models on equal terms | [`compare`] |
//! | the closed loop: what is left, which effect is missing, before and after | [`diagnose`] |
//! | fits as records for files | [`calibration_record`], [`camera_record`] |
//! | what fits and records leave uncertain of depth | [`depth_uncertainty`] |
//! | whole tasks, from options in words to result files | [`task`] |
//!
//! The crate prints nothing and draws nothing: progress goes to a [`progress::Progress`] in the options, whose handle
//! also measures the time of every stage ([`stage_clock`]).

pub mod adjust;
pub mod calibrate;
pub mod calibration_record;
pub mod camera_record;
pub mod cause;
pub mod compare;
pub mod depth_uncertainty;
pub mod diagnose;
pub mod estimators;
pub mod judge;
pub mod load;
pub mod observe;
pub mod plan;
pub mod progress;
#[cfg(any(test, feature = "simulate"))]
pub mod rig_simulated;
#[cfg(any(test, feature = "simulate"))]
pub mod simulated;
pub mod stage_clock;
pub mod start;
pub mod task;
