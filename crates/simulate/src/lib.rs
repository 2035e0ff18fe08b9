//! Renders captures of a board by a depth camera whose errors are known, independently of the fitted model.
//!
//! A [`Simulation`] has a camera, a distribution of board poses ([`Kind`]), and [`Effect`]s: systematic errors of
//! camera or board that the model of a calibration may lack. There are two ways to observe it:
//! [`Simulation::observe_points`] gives marker positions and depth samples with white noise, for statistics over many
//! seeds; [`Simulation::write_dataset`] renders images and depth images as a camera would deliver them.
//!
//! Invariants:
//! - no code is shared with the crates that fit;
//! - effects are applied to the scene, the ray or the measurement, never added to residuals;
//! - a dataset does not reveal what was simulated, only the returned [`Truth`] does;
//! - the same seed gives the same bytes for any number of threads.
//!
//! Camera frame: x right, y down, z forward; mm, px, radians. Depth is z. Inverse depth ρ = 1/z.

mod board;
mod camera;
mod conditions;
mod dataset;
mod defects;
mod effects;
mod error;
mod instrument;
mod kind;
mod light;
mod noise;
mod optics;
mod plant;
mod points;
mod pose;
mod render;
mod rendering;
mod rig;
mod scene;
mod session;
mod simulation;
mod streams;
mod truth;

pub use board::{Board, Pattern};
pub use camera::CameraTruth;
pub use conditions::Conditions;
pub use defects::{DefectiveFrames, Defects};
pub use effects::{
    Effect, EffectInfo, EffectTruth, Form, GivenEffect, Observation, Parameters, Place, catalogue, of_whole_frames,
    uncatalogued,
};
pub use error::SimulateError;
pub use kind::Kind;
pub use light::Exposure;
pub use noise::{DepthNoise, Noise};
pub use plant::{PlantView, plant};
pub use points::{DepthSample, FramePoints, MarkerPoint, PointObservations, PointOptions};
pub use pose::Pose;
pub use render::{RenderedFrame, Renderer};
pub use rendering::Rendering;
pub use rig::{Drift, RigCamera, RigCameraTruth, RigPoints, RigSimulation, RigTruth, Streams, Waved};
pub use simulation::Simulation;
pub use truth::{FrameTruth, Truth};
