//! Pose graphs: measured relative poses in the plane (D = 2) and in space (D = 3), their factors, a start that needs no
//! odometry, and a certificate that an optimum is the global one.
//!
//! Poses are the variables `Vector3<f64>` (x, y, angle) in the plane and `Isometry3<f64>` in space; where linear algebra on
//! rotation matrices is meant, [`RigidMotion`].
//!
//! ```
//! use depthcal_solver::pose_graph::{ChordalPlane, RelativePose, certify, chordal_start};
//! use depthcal_solver::{Batch, Damping, Graph, Options, Values, minimize};
//! use nalgebra::Vector3;
//!
//! // Four sides of a square, each measured as one step ahead and a turn to the left.
//! let information = [[400.0, 0.0, 0.0], [0.0, 400.0, 0.0], [0.0, 0.0, 2500.0]];
//! let turn = std::f64::consts::FRAC_PI_2;
//! let sides: Vec<RelativePose<2>> = (0..4)
//!     .map(|i| RelativePose::in_plane(i, (i + 1) % 4, [1.0 + 0.01 * i as f64, 0.0, turn], &information))
//!     .collect::<Result<_, _>>()?;
//! let start = chordal_start(4, &sides)?;
//! let mut values = Values::new();
//! let poses: Vec<_> = start.iter().map(|pose| values.insert(Vector3::from(*pose))).collect();
//! let mut batch = Batch::new("sides");
//! sides.iter().for_each(|side| batch.push(ChordalPlane::new(side), (poses[side.from], poses[side.to])));
//! let mut graph = Graph::new();
//! graph.add_batch(batch);
//! graph.fix(poses[0]);
//! let options = Options { damping: Damping::WhenNeeded { tau: 1e-4 }, ..Options::default() };
//! let solution = minimize(&graph, values, &options)?;
//! let optimum: Vec<_> = poses.iter().map(|pose| (*solution.values.get(*pose)).into()).collect();
//! let certificate = certify(&optimum, &sides)?;
//! assert!((certificate.objective - 2.0 * solution.report.cost).abs() < 1e-9 * certificate.objective);
//! assert!(certificate.relative_gap().is_some_and(|gap| gap < 1e-6));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Sources: Martinec and Pajdla, *Robust rotation and translation estimation in multiview reconstruction*, CVPR 2007; Carlone,
//! Tron, Daniilidis and Dellaert, *Initialization techniques for 3D SLAM*, ICRA 2015; Rosen, Carlone, Bandeira and Leonard,
//! *SE-Sync: a certifiably correct algorithm for synchronization over the special Euclidean group*, IJRR 2019 (here
//! "SE-Sync"); Kümmerle, Grisetti, Strasdat, Konolige and Burgard, *g2o: a general framework for graph optimization*, ICRA 2011.

mod certificate;
mod chordal_start;
mod error;
mod factors;
mod relative_pose;
mod rigid_motion;
mod tree_start;

pub use certificate::{Certificate, certify};
pub use chordal_start::chordal_start;
pub use error::PoseGraphError;
pub use factors::{BetweenPlane, BetweenSpace, ChordalPlane, ChordalSpace};
pub use relative_pose::{RelativePose, chordal_objective};
pub use rigid_motion::RigidMotion;
pub use tree_start::tree_start;
