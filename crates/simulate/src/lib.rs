//! Renders captures of a board by a depth camera whose errors are known, independently of the fitted model.
//!
//! A [`Simulation`] has a camera, a way of holding the board ([`Kind`]), and [`Effect`]s: what is wrong with camera or
//! board and what a calibration's model may lack. It is observed in two ways: [`Simulation::observe_points`] gives marker
//! positions and depth samples with white noise, for statistics over many seeds; [`Simulation::write_dataset`] renders
//! images and depth images as a camera would deliver them.
//!
//! Invariants: nothing here is shared with the code that fits; effects are applied to the scene, the ray or the
//! measurement, never added to residuals; a dataset never tells what was simulated, only the returned [`Truth`] does; the
//! same seed gives the same bytes whatever the number of threads.
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
mod scene;
mod session;
mod simulation;
mod streams;
mod truth;

pub use board::{Board, Pattern};
pub use camera::CameraTruth;
pub use conditions::Conditions;
pub use defects::{DefectiveFrames, Defects};
pub use effects::{Effect, EffectInfo, EffectTruth, Parameters, catalogue, uncatalogued};
pub use error::SimulateError;
pub use kind::Kind;
pub use light::Exposure;
pub use noise::{DepthNoise, Noise};
pub use plant::{PlantView, plant};
pub use points::{DepthSample, FramePoints, MarkerPoint, PointObservations, PointOptions};
pub use pose::Pose;
pub use render::{RenderedFrame, Renderer, Rendering};
pub use simulation::Simulation;
pub use truth::{FrameTruth, Truth};
