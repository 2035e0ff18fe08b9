//! Sessions: solve again after a change of the problem.

use argmin::core::checkpointing::CheckpointingFrequency;
use argmin::core::{Executor, State};

use crate::plan::linear_solver::LinearSolver;
use crate::problem::graph::Graph;
use crate::problem::values::Values;
use crate::step::checkpoint::CheckpointFile;
use crate::step::checkpoint_error::CheckpointError;
use crate::step::error::SolveError;
use crate::step::levenberg_marquardt::{LevenbergMarquardt, ReusableParts, SolverState};
use crate::step::options::Options;
use crate::step::solution::Solution;
use crate::uncertainty::undetermined::undetermined;

/// Solves a problem repeatedly while factors and variables are added and removed.
///
/// Between solutions it keeps the damping, the threads, and, as long as they fit, the ordering and symbolic factorisation
/// of a sparse linear system. They fit while the estimated variables stay the same in number and dimension and no new
/// pair of variables is linked by a factor. [`symbolic_analyses`](crate::LinearSolverUsed::symbolic_analyses) shows
/// whether they were used again.
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
/// // Later the first prior is replaced by another one.
/// graph.add_batch(Prior::isotropic("second", x, Vector2::new(1.0, 1.0), 1.0)?);
/// graph.remove_batch(first);
/// let solution = session.solve(&graph, solution.values)?;
/// assert!((solution.values.get(x) - Vector2::new(1.0, 1.0)).norm() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Session {
    options: Options,
    reusable: ReusableParts,
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
    /// A session in which nothing has been solved yet.
    pub fn new(options: Options) -> Self {
        Self { options, reusable: ReusableParts::default(), symbolic_analyses: 0 }
    }

    /// The options of the next solution.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Number of orderings and symbolic factorisations made so far.
    pub fn symbolic_analyses(&self) -> usize {
        self.symbolic_analyses
    }

    /// Like [`minimize`](crate::minimize), using what was kept from earlier solutions.
    ///
    /// # Errors
    /// Like [`minimize`](crate::minimize). What was kept is then discarded.
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
        let solver = LevenbergMarquardt::reuse(options.clone(), std::mem::take(&mut self.reusable));
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
        self.reusable = result.solver.into_reusable_parts();
        // Accepted steps increase the cost by rounding errors at most: the last values are the best.
        let values = result.state.take_param().or_else(|| result.state.take_best_param());
        let Some(values) = values else {
            return Err(SolveError::Executor { reason: "its state has no values at the end".to_owned() });
        };
        if options.name_undetermined {
            let by_rows = options.linear_solver == LinearSolver::SparseQr;
            // An error means that the derivatives do not exist at these values, which the termination reports already.
            report.undetermined = undetermined(graph, &values, by_rows).ok().flatten().unwrap_or_default();
        }
        Ok(Solution { values, report })
    }
}
