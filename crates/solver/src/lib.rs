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
//! | changes | [`Session`]: solves again from where it stood while factors and variables come and go |
//! | interruption | [`CheckpointFile`]: go on from a file to the same bits; [`Interrupt`] |
//! | uncertainty | [`Covariance`]: any joint or marginal, of large sparse problems as well; names what is not determined |
//! | what the model lacks | [`score`]: score tests of held variables, gain on left-out clusters, detectable sizes |
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
//! What a residual is about may be anything with a tangent space. A pose seen from another one, with a robust loss, in a
//! graph that grows:
//!
//! ```
//! use depthcal_solver::{Batch, Factor, Graph, Lifted, Loss, Noise, Options, Pose, Scalar, Session, Values};
//! use nalgebra::{Isometry3, SVector, Vector3};
//!
//! /// The pose of `b` in the frame of `a`.
//! struct Between(Isometry3<f64>);
//!
//! impl Factor<6> for Between {
//!     type Variables = (Isometry3<f64>, Isometry3<f64>);
//!     fn residual<T: Scalar>(&self, (a, b): Lifted<Self::Variables, T>) -> SVector<T, 6> {
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
//! // Back at the start: one more factor, and on from where it stood.
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
//! In every iteration a linear system in H = JᵀJ and the damping is to be solved. By default [`LinearSolver::Auto`] counts
//! operations and takes the cheapest; [`Report::linear_solver`] tells which, and the costs that were compared.
//!
//! | [`LinearSolver`] | for |
//! |---|---|
//! | `Dense` | up to some hundred unknowns |
//! | `SparseCholesky` | graphs whose variables are linked to few others: supernodal, variables ordered as blocks by approximate minimum degree |
//! | `DenseSchur` | many variables that share no factor with each other, and a few that link them: frames and a camera, points and some cameras |
//! | `SparseSchur` | the same with more, of which each is linked to few others |
//! | `ConjugateGradients` | the same where the reduced system is too large to factorise; it is not formed |
//! | `SparseQr` | ill-conditioned problems: the condition number of J counts, not its square; only on request |
//!
//! Where some combination of variables is not determined, damping finds a minimum all the same. [`Report::weakest`] hints at
//! it, [`Options::name_undetermined`] and [`Covariance`] name the combination.
//!
//! # How it works
//!
//! Normal equations are accumulated group by group and no Jacobian is kept (but for QR). Work is divided into chunks that
//! depend on the problem alone and is summed in their order: the same input gives the same bits for any number of threads.
//! Iterations do not allocate memory.
//!
//! Sources: Nocedal and Wright, *Numerical Optimization*, 2006; Triggs, McLauchlan, Hartley and Fitzgibbon, *Bundle
//! adjustment, a modern synthesis*, 2000; Madsen, Nielsen and Tingleff, *Methods for non-linear least squares problems*,
//! 2004; Agarwal, Snavely, Seitz and Szeliski, *Bundle adjustment in the large*, 2010; Björck, *Numerical Methods for Least
//! Squares Problems*, 1996. Equations are cited where they are used.

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
pub mod score;
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
