//! Nonlinear least squares on factor graphs.
//!
//! The problem is to minimise ½ Σᵢ ρᵢ(‖rᵢ(x)‖²) over variables x on smooth manifolds, where rᵢ are whitened residuals and ρᵢ
//! losses. The crate knows nothing of cameras.
//!
//! | step | types |
//! |---|---|
//! | variables | [`Variable`]: vectors, rotations, poses, directions, own ones; [`Values`] keeps them under typed [`Key`]s |
//! | residuals | [`Factor`]: one generic function, derivatives follow; [`Batch`]: many of a kind, with [`Noise`] and [`Loss`]; [`Prior`]; [`LaneBatch`]: many that share their variables, eight at a time; [`FactorBatch`]: anything, with Jacobians by hand |
//! | problem | [`Graph`]: batches, fixed and bounded variables, variables to eliminate |
//! | solution | [`minimize`], or [`LevenbergMarquardt`] with argmin's executor; [`Options`]; [`Report`] |
//! | interruption | [`CheckpointFile`]: go on from a file to the same bits; [`Interrupt`] |
//! | uncertainty | [`Covariance`]: any joint or marginal; names what is not determined |
//! | checks | [`check_jacobians`] |
//!
//! A straight line through three points:
//!
//! ```
//! use depthcal_solver::{Batch, Covariance, CovarianceOptions, Factor, Graph, Lifted, Noise, Options, Scalar, Values, minimize};
//! use nalgebra::{SVector, Vector2};
//!
//! struct Line { x: f64, y: f64 }
//!
//! impl Factor<1> for Line {
//!     type Variables = (Vector2<f64>,);
//!     fn residual<T: Scalar>(&self, (p,): Lifted<Self::Variables, T>) -> SVector<T, 1> {
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
//! Normal equations are accumulated group by group and no Jacobian is kept. Work is divided into chunks that depend on the
//! problem alone and is summed in their order: the same input gives the same bits for any number of threads.

mod accumulate;
mod batch;
mod blocks;
mod bounds;
mod check;
mod checkpoint;
mod choice;
mod chunk;
mod conjugate;
mod covariance;
mod dog_leg;
mod eliminate;
mod error;
mod exact;
mod factor;
mod graph;
mod hold;
mod interrupt;
mod inverse;
mod kernels;
mod lanes;
mod layout;
mod levenberg_marquardt;
mod lift;
mod loss;
mod manifold;
mod minimize;
mod noise;
mod normal;
mod options;
mod ordering;
mod part;
mod partition;
mod prior;
mod qr;
mod reduced;
mod report;
mod scatter;
mod selected;
mod session;
mod shares;
mod snapshot;
mod spare;
mod undetermined;
mod values;
mod variable;

pub use batch::Batch;
pub use check::{JacobianError, check_jacobians};
pub use checkpoint::{CheckpointError, CheckpointFile};
pub use covariance::{Covariance, CovarianceError, CovarianceOptions, NullComponent, NullDirection};
pub use error::{EvaluationError, EvaluationFailure, SolveError, StructureError};
pub use factor::{Borrowed, Factor, Lifted, VariableTuple};
pub use graph::{BatchId, FactorBatch, Graph};
pub use interrupt::Interrupt;
pub use lanes::{LANES, Lane, LaneAccess, LaneBatch, Lanes};
pub use levenberg_marquardt::{LevenbergMarquardt, SolverState};
pub use lift::{Lift, Pose, Rotation, Scalar};
pub use loss::Loss;
pub use minimize::{Solution, minimize};
pub use noise::{Noise, NoiseError};
pub use options::{
    CheckpointOptions, Damping, Estimate, LinearSolver, LinearSolverUsed, Method, Options, Preconditioner, Scaling,
};
pub use prior::Prior;
pub use report::{Iteration, Report, StageSeconds, Termination, Weakest};
pub use session::Session;
pub use values::{Key, Values, VariableId};
pub use variable::Variable;
