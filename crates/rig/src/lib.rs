//! Joint calibration of several cameras on one rigid body, each with images, depth or both.
//!
//! The modules are the stages of the data's way, each depending only on those before it:
//!
//! | stage | module |
//! |---|---|
//! | what every camera of a rig observed | [`capture`] |
//! | from the files of a dataset to detected boards of every camera | [`load`] |
//! | relative poses from shared views, the graph of views, frames that contradict | [`views`] |
//! | places that change with time or temperature | [`drift`] |
//! | how the board moves about a frame, for cameras that expose at other times | [`motion`] |
//! | what an adjustment changes: cameras, places, poses | [`state`] |
//! | a depth camera without images: its start from planes | [`depth_only`] |
//! | one joint adjustment on the solver | [`adjust`] |
//! | the driver: cameras alone, places, everything jointly until noise and outliers settle | [`calibrate`] |
//! | cameras with their places, for those who use them | [`placed`] |
//! | errors of every camera, and from camera to camera | [`judge`] |
//! | what the cameras' models lack | [`diagnose`] |
//! | fits as records for files | [`record`] |
//! | whole tasks, from options in words to result files | [`task`] |
//!
//! Every camera is a chain of pieces, as in `depthcal-model`, behind its place `camera_from_rig`. The frame of the rig is that
//! of its first camera. A frame has one pose of the board, `rig_from_board`, whichever cameras saw it. The crate prints
//! nothing.

pub mod adjust;
pub mod calibrate;
pub mod capture;
pub mod depth_only;
pub mod diagnose;
pub mod drift;
mod error;
pub mod judge;
pub mod load;
pub mod motion;
pub mod placed;
pub mod record;
#[cfg(any(test, feature = "simulate"))]
pub mod simulated;
pub mod state;
pub mod task;
pub mod views;

pub use calibrate::{CameraFit, EffectOf, HeldOf, RigCalibrated, RigOptions, TimeOffset, calibrate_rig};
pub use capture::{CameraCapture, RigCapture};
pub use error::RigError;
pub use placed::PlacedCamera;
