//! Nonlinear least squares on factor graphs.
//!
//! The solver minimises ½ Σᵢ ρᵢ(‖rᵢ(x)‖²) over variables x on smooth manifolds, where the rᵢ are whitened residuals and
//! the ρᵢ are losses. It is independent of any application.
//!
//! - variables: [`Variable`]: vectors, rotations, poses, directions, and your own types; [`Values`] stores them under typed
//!   [`Key`]s
//! - residuals: [`Factor`]: one generic function, with automatic derivatives; [`Batch`]: factors of one type, with [`Noise`] and
//!   [`Loss`]; [`Prior`]; [`FactorBatch`]: full control, with hand-written
//!   Jacobians
//! - problem: [`Graph`]: batches, fixed and bounded variables, variables to eliminate
//! - solution: [`minimize`], or [`LevenbergMarquardt`] with argmin's executor; [`Options`]; [`Report`]
//! - changing problems: [`Session`]: solves again after factors and variables were added or removed
//! - growing problems: [`IncrementalSession`]: frames that share some variables, added and removed in a time that does not
//!   depend on how many there are
//! - interruption: [`Interrupt`]; [`CheckpointFile`]: resume from a file, with bitwise the same result
//! - uncertainty: [`Covariance`]: joint and marginal, of some or all variables of large sparse problems; undetermined
//!   combinations of variables by name
//! - missing effects: [`score`]: score tests of fixed variables, gain on held-out clusters, detectable sizes
//! - missing functions: [`additive`]: smooth functions of known quantities that residuals depend on, several at once
//! - pose graphs: [`pose_graph`]: factors, a start by chordal relaxation, a certificate of the global optimum
//! - checks: [`check_jacobians`]
//!
//! A straight line through three points:
//!
//! ```
//! use depthcal_solver::{Batch, Covariance, CovarianceOptions, Factor, Graph, Noise, Options, Over, Scalar, Values, minimize};
//! use nalgebra::{SVector, Vector2};
//!
//! struct Line { x: f64, y: f64 }
//!
//! impl Factor<1> for Line {
//!     type Variables = (Vector2<f64>,);
//!     fn residual<T: Scalar>(&self, (p,): Over<Self::Variables, T>) -> SVector<T, 1> {
//!         SVector::<T, 1>::new(p[0] + p[1] * self.x - self.y)
//!     }
//! }
//!
//! let mut values = Values::new();
//! let line = values.insert(Vector2::zeros());
//! let mut points = Batch::new("points").with_noise(Noise::isotropic(0.1)?);
//! for (x, y) in [(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)] {
//!     points.push(Line { x, y }, (line,));
//! }
//! let mut graph = Graph::new();
//! graph.add_batch(points);
//!
//! let solution = minimize(&graph, values, &Options::default())?;
//! assert!(solution.report.converged);
//! assert!((solution.values.get(line) - Vector2::new(1.0, 2.0)).norm() < 1e-9);
//! let covariance = Covariance::compute(&graph, &solution.values, &CovarianceOptions::default())?;
//! assert!((covariance.marginal(line)[(1, 1)] - 0.1 * 0.1 / 2.0).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Variables may be points of any smooth manifold. Here, poses are linked by relative poses, with a robust loss, and the
//! graph grows:
//!
//! ```
//! use depthcal_solver::{Batch, Factor, Graph, Loss, Noise, Options, Over, Pose, Scalar, Session, Values};
//! use nalgebra::{Isometry3, SVector, Vector3};
//!
//! /// The pose of `b` in the frame of `a`.
//! struct Between(Isometry3<f64>);
//!
//! impl Factor<6> for Between {
//!     type Variables = (Isometry3<f64>, Isometry3<f64>);
//!     fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, 6> {
//!         let error = Pose::<T>::constant(&self.0.inverse()).compose(&a.inverse().compose(&b));
//!         let (r, t) = (error.rotation.log(), error.translation);
//!         SVector::<T, 6>::new(r[0], r[1], r[2], t[0], t[1], t[2])
//!     }
//! }
//!
//! let mut values = Values::new();
//! let poses: Vec<_> = (0..4).map(|_| values.insert(Isometry3::identity())).collect();
//! let step = Isometry3::new(Vector3::x(), Vector3::z() * std::f64::consts::FRAC_PI_2);
//! let noise = || Noise::diagonal([0.01, 0.01, 0.01, 0.05, 0.05, 0.05]);
//! let mut odometry = Batch::new("odometry").with_noise(noise()?).with_loss(Loss::Huber { delta: 3.0 });
//! poses.windows(2).for_each(|p| odometry.push(Between(step), (p[0], p[1])));
//! let mut graph = Graph::new();
//! graph.add_batch(odometry);
//! graph.fix(poses[0]);
//! let mut session = Session::new(Options::default());
//! let solution = session.solve(&graph, values)?;
//! // Loop closure: add a factor and continue from the last solution.
//! let mut closure = Batch::new("closure").with_noise(noise()?);
//! closure.push(Between(step), (poses[3], poses[0]));
//! graph.add_batch(closure);
//! let solution = session.solve(&graph, solution.values)?;
//! assert!((solution.values.get(poses[2]).translation.vector - Vector3::new(1.0, 1.0, 0.0)).norm() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The linear solver
//!
//! Every iteration solves a linear system (H + μ D²) δ = −g with H = JᵀJ. By default, [`LinearSolver::Auto`] estimates
//! the work of the methods below and takes the cheapest; [`Report::linear_solver`] has the choice and the estimates.
//!
//! - `Dense`: up to some hundred unknowns
//! - `SparseCholesky`: graphs whose variables are linked to few others, such as pose graphs; supernodal, with variables ordered
//!   as blocks by approximate minimum degree
//! - `DenseSchur`: many variables that share no factor with each other, linked by a few others: frames and a camera, points and
//!   some cameras
//! - `SparseSchur`: the same with many linking variables, each linked to few others: points and many cameras
//! - `ConjugateGradients`: the same if the reduced system is too large to factorise; it is not formed
//! - `SparseQr`: ill-conditioned problems: does not square the condition number of J; only on request
//!
//! If a combination of variables is undetermined, the damping still leads to a minimum. [`Report::weakest`] hints at such a
//! combination; [`Options::name_undetermined`] and [`Covariance`] identify it.
//!
//! # How it works
//!
//! Normal equations are accumulated group by group, without storing the Jacobian (except for QR). The groups are divided
//! into chunks in a way that depends on the problem alone, and the chunks' sums are added in a fixed order: results are
//! bitwise identical for any number of threads. Iterations do not allocate memory.
//!
//! # Layout
//!
//! | folder | contents |
//! |---|---|
//! | `problem` | variables, factors, batches, losses, noise, priors, the graph |
//! | `plan` | decided once: layout of the step, linear solver, partition, ordering, chunks |
//! | `normal` | every iteration: normal equations, elimination, reduced system, conjugate gradients, QR |
//! | `uncertainty` | covariances and undetermined combinations |
//! | `step` | Levenberg–Marquardt, damping, dog-leg, sessions, checkpoints, reports |
//! | `score` | score tests |
//! | `additive` | functions that residuals depend on |
//! | `incremental` | frames reduced onto what they share |
//! | `pose_graph` | relative poses, their start and their certificate |
//!
//! Every folder uses only those above it; `score` uses only `problem`, and `additive` only `problem` and `score`.
//!
//! Sources: Nocedal and Wright, *Numerical Optimization*, 2006; Triggs, McLauchlan, Hartley and Fitzgibbon, *Bundle
//! adjustment, a modern synthesis*, 2000; Madsen, Nielsen and Tingleff, *Methods for non-linear least squares problems*,
//! 2004; Agarwal, Snavely, Seitz and Szeliski, *Bundle adjustment in the large*, 2010; Björck, *Numerical Methods for Least
//! Squares Problems*, 1996. Equations are cited where they are used.

pub mod additive;
mod incremental;
mod normal;
mod plan;
pub mod pose_graph;
mod problem;
pub mod score;
mod step;
mod uncertainty;

pub use incremental::{FrameId, IncrementalError, IncrementalOptions, IncrementalSession};
pub use plan::linear_solver::{LinearSolver, LinearSolverUsed, Preconditioner, WorkEstimate};
pub use problem::autodiff::{AutoDiffVariable, Scalar};
pub use problem::batch::Batch;
pub use problem::error::{EvaluationError, EvaluationFailure, StructureError};
pub use problem::factor::{Factor, Over, VariableTuple};
pub use problem::factor_batch::FactorBatch;
pub use problem::graph::{BatchId, Graph};
pub use problem::jacobian_check::{JacobianError, check_jacobians};
pub use problem::key::{Key, VariableId};
pub use problem::loss::Loss;
pub use problem::noise::{Noise, NoiseError};
pub use problem::prior::Prior;
pub use problem::rigid_motion::{Pose, Rotation};
pub use problem::values::Values;
pub use problem::variable::Variable;
pub use step::checkpoint::CheckpointFile;
pub use step::checkpoint_error::CheckpointError;
pub use step::error::SolveError;
pub use step::interrupt::Interrupt;
pub use step::levenberg_marquardt::{LevenbergMarquardt, SolverState};
pub use step::minimize::minimize;
pub use step::options::{CheckpointOptions, Damping, Method, Options, Scaling};
pub use step::report::{Iteration, Report, StageSeconds, Termination, Weakest};
pub use step::session::Session;
pub use step::solution::Solution;
pub use uncertainty::covariance::{Covariance, CovarianceOptions};
pub use uncertainty::error::CovarianceError;
pub use uncertainty::null_direction::{NullComponent, NullDirection};

/// Vectors, rotations and poses of variables, in the version that this crate has.
pub use nalgebra;

/// The snippet of the README is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
