//! Solving again after a change.

use argmin::core::checkpointing::CheckpointingFrequency;
use argmin::core::{Executor, State};

use crate::checkpoint::{CheckpointError, CheckpointFile};
use crate::covariance::undetermined;
use crate::error::SolveError;
use crate::graph::Graph;
use crate::levenberg_marquardt::{LevenbergMarquardt, Remains, SolverState};
use crate::minimize::Solution;
use crate::options::{LinearSolver, Options};
use crate::values::Values;

/// Solves a problem again and again while factors and variables come and go, from where it stood.
///
/// It keeps the damping, the threads, and the ordering and symbolic factorisation of a sparse linear system for as long as
/// they fit: that is, while the estimated variables are the same in number and size, and factors are added between variables
/// that are linked already, or taken away. [`symbolic_analyses`](crate::LinearSolverUsed::symbolic_analyses) tells whether
/// they did.
///
/// ```
/// use depthcal_solver::{Graph, Options, Prior, Session, Values};
/// use nalgebra::Vector2;
///
/// let mut values = Values::new();
/// let x = values.insert(Vector2::new(3.0, 4.0));
/// let mut graph = Graph::new();
/// let first = graph.add_batch(Prior::isotropic("first", x, Vector2::zeros(), 1.0)?);
/// let mut session = Session::new(Options::default());
/// let solution = session.solve(&graph, values)?;
/// // Later something else is known, and what was known before no longer holds.
/// graph.add_batch(Prior::isotropic("second", x, Vector2::new(1.0, 1.0), 1.0)?);
/// graph.remove_batch(first);
/// let solution = session.solve(&graph, solution.values)?;
/// assert!((solution.values.get(x) - Vector2::new(1.0, 1.0)).norm() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Session {
    options: Options,
    remains: Remains,
    symbolic_analyses: usize,
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session")
            .field("options", &self.options)
            .field("symbolic_analyses", &self.symbolic_analyses)
            .finish_non_exhaustive()
    }
}

impl Session {
    /// Nothing has been solved yet.
    pub fn new(options: Options) -> Self {
        Self { options, remains: Remains::default(), symbolic_analyses: 0 }
    }

    /// The options of the next solution.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Changes options of the next solution; the number of threads stays as it is once there are some.
    pub fn options_mut(&mut self) -> &mut Options {
        &mut self.options
    }

    /// Orderings and symbolic factorisations that were made so far.
    pub fn symbolic_analyses(&self) -> usize {
        self.symbolic_analyses
    }

    /// Like [`minimize`](crate::minimize), with what the solutions before have left.
    ///
    /// # Errors
    /// Like [`minimize`](crate::minimize). What was kept is lost then.
    pub fn solve(&mut self, graph: &Graph, values: Values) -> Result<Solution, SolveError> {
        let options = &self.options;
        let checkpoint = match &options.checkpoint {
            Some(c) => {
                options.check()?;
                let frequency = CheckpointingFrequency::Every(c.every);
                Some(CheckpointFile::new(&c.path, &values, options, frequency))
            }
            None => None,
        };
        let solver = LevenbergMarquardt::renew(options.clone(), std::mem::take(&mut self.remains));
        let mut executor = Executor::new(graph, solver)
            .configure(|state: SolverState| state.param(values).max_iters(options.max_iterations))
            .ctrlc(options.ctrlc)
            .timer(false);
        if let Some(limit) = options.time_limit {
            executor = executor.timeout(limit);
        }
        if let Some(checkpoint) = checkpoint {
            executor = executor.checkpointing(checkpoint);
        }
        let mut result = executor.run().map_err(|error| match error.downcast::<SolveError>() {
            Ok(error) => error,
            Err(error) => match error.downcast::<CheckpointError>() {
                Ok(error) => error.into(),
                Err(error) => SolveError::Executor { reason: error.to_string() },
            },
        })?;
        result.solver.stopped_by_executor(result.state.get_termination_reason());
        let mut report = result.solver.report();
        self.symbolic_analyses += report.linear_solver.symbolic_analyses;
        self.remains = result.solver.remains();
        // Steps never make the cost worse but for rounding: the last values are the best.
        let values = result.state.take_param().or_else(|| result.state.take_best_param());
        let Some(values) = values else {
            return Err(SolveError::Executor { reason: "the executor lost the values".to_owned() });
        };
        if options.name_undetermined {
            let by_rows = options.linear_solver == LinearSolver::SparseQr;
            // Values at which the derivatives do not exist have their own termination.
            report.undetermined = undetermined(graph, &values, by_rows).ok().flatten().unwrap_or_default();
        }
        Ok(Solution { values, report })
    }
}
