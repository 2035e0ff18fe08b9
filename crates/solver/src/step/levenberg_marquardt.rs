//! Levenberg–Marquardt, dog-leg and Gauss–Newton as a solver of argmin: its state, and its set-up for a problem.

use argmin::core::IterState;

use crate::normal::normal_equations::NormalEquations;
use crate::problem::graph::Graph;
use crate::problem::values::Values;
use crate::step::damping::StepControl;
use crate::step::error::SolveError;
use crate::step::options::{Method, Options};
use crate::step::report::{Iteration, Report, StageSeconds, Termination, Weakest};
use crate::step::snapshot::ResumeCheck;
use crate::step::values_pool::ValuesPool;

/// The state that argmin keeps between iterations.
pub type SolverState = IterState<Values, (), (), (), (), f64>;

/// Relative pivot below which a component may be undetermined, if the damping alone explains the pivot, and relative pivot
/// that rounding errors may leave of zero.
const SMALL_PIVOT: f64 = 1e-6;
const ROUNDING_PIVOT: f64 = 1e-13;

/// The Levenberg–Marquardt method (Levenberg 1944, Marquardt 1963): minimises ½ Σ ρ(‖r(x)‖²) by steps (H + μ D²) δ = −g with
/// H = Jᵀ W J, g = Jᵀ W r and W the weights ρ′ of the loss. According to [`Options::method`] it computes dog-leg or
/// Gauss–Newton steps instead.
///
/// This is an argmin solver; the problem is anything that borrows as a [`Graph`]: `&Graph`, `Graph` or `Arc<Graph>`.
/// [`minimize`](crate::minimize) runs it. Use argmin's `Executor` directly for observers and the like:
///
/// ```
/// use argmin::core::{Executor, State};
/// use depthcal_solver::{Graph, LevenbergMarquardt, Options, Prior, SolverState, Values};
/// use nalgebra::Vector2;
///
/// let mut values = Values::new();
/// let x = values.insert(Vector2::new(3.0, 4.0));
/// let mut graph = Graph::new();
/// graph.add_batch(Prior::isotropic("origin", x, Vector2::zeros(), 1.0)?);
/// let result = Executor::new(&graph, LevenbergMarquardt::new(Options::default()))
///     .configure(|state: SolverState| state.param(values).max_iters(20))
///     .ctrlc(false)
///     .run()?;
/// assert!(result.state.get_best_cost() < 1e-6);
/// println!("{}", result.solver.report());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct LevenbergMarquardt {
    /// Normal equations of an earlier solver, whose symbolic factorisation may be used again.
    pub(super) previous: Option<Box<NormalEquations>>,
    /// For a run resumed from a checkpoint, until the problem has been linearised at the checkpoint's values.
    pub(super) resume_check: Option<ResumeCheck>,
    pub(super) options: Options,
    pub(super) system: Option<Box<NormalEquations>>,
    pub(super) pool: Option<rayon::ThreadPool>,
    pub(super) control: StepControl,
    /// Diagonal of D².
    pub(super) d2: Vec<f64>,
    pub(super) step: Vec<f64>,
    /// The Gauss–Newton step of the last linearisation, for dog-leg and Gauss–Newton, valid if `newton_known`.
    pub(super) newton: Vec<f64>,
    pub(super) newton_known: bool,
    /// Memory for trial values.
    pub(super) values_pool: ValuesPool,
    /// Whether the last linearisation is at the present values.
    pub(super) linearized: bool,
    /// Predicted decrease of the cost at the first trial since the last linearisation.
    pub(super) first_prediction: Option<f64>,
    pub(super) cost0: f64,
    pub(super) cost: f64,
    /// max |g_j|.
    pub(super) gradient: f64,
    pub(super) trace: Vec<Iteration>,
    pub(super) seconds: StageSeconds,
    pub(super) termination: Option<Termination>,
}

impl std::fmt::Debug for LevenbergMarquardt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LevenbergMarquardt")
            .field("options", &self.options)
            .field("damping", &self.control.mu)
            .field("cost", &self.cost)
            .field("termination", &self.termination)
            .finish_non_exhaustive()
    }
}

impl LevenbergMarquardt {
    /// A solver with these options. It ignores `max_iterations`, `time_limit`, `ctrlc` and `checkpoint`, which
    /// [`minimize`](crate::minimize) hands to argmin's executor; with an executor of your own, set them there.
    pub fn new(options: Options) -> Self {
        let control = StepControl::new(options.method, options.damping);
        Self {
            previous: None,
            resume_check: None,
            options,
            system: None,
            pool: None,
            control,
            d2: Vec::new(),
            step: Vec::new(),
            newton: Vec::new(),
            newton_known: false,
            values_pool: ValuesPool::default(),
            linearized: false,
            first_prediction: None,
            cost0: f64::INFINITY,
            cost: f64::INFINITY,
            gradient: f64::INFINITY,
            trace: Vec::new(),
            seconds: StageSeconds::default(),
            termination: None,
        }
    }

    /// The report of the run so far.
    pub fn report(&self) -> Report {
        let termination = self.termination.clone().unwrap_or(Termination::MaxIterations);
        Report {
            cost0: self.cost0,
            cost: self.cost,
            iterations: self.trace.len(),
            converged: termination.converged(),
            termination,
            trace: self.trace.clone(),
            seconds: self.seconds,
            linear_solver: self.system.as_ref().map(|s| s.used().clone()).unwrap_or_default(),
            residuals: self.system.as_ref().map_or(0, |s| s.layout.rows),
            unknowns: self.system.as_ref().map_or(0, |s| s.dim()),
            weakest: self.weakest(),
            undetermined: Vec::new(),
        }
    }

    fn weakest(&self) -> Option<Weakest> {
        let system = self.system.as_ref()?;
        let last = self.trace.last()?;
        let (index, pivot) = system.weakest(&self.d2)?;
        let (variable, component) = system.layout.component(index)?;
        let damping = if self.options.method == Method::LevenbergMarquardt { last.damping } else { self.control.mu };
        // If a combination of n components, each with the same weight, is undetermined, the relative pivot is n μ.
        let suspect = pivot < SMALL_PIVOT && pivot < 2.0 * system.dim() as f64 * damping + ROUNDING_PIVOT;
        Some(Weakest { variable, label: system.label(variable), component, pivot, damping, suspect })
    }

    /// A solver that uses parts of an earlier one again.
    pub(crate) fn reuse(options: Options, parts: ReusableParts) -> Self {
        let mut solver = Self::new(options);
        if solver.options.method == Method::LevenbergMarquardt {
            solver.control.mu = parts.mu;
        }
        Self { previous: parts.system, pool: parts.pool, ..solver }
    }

    /// The parts that a later solver may use again.
    pub(crate) fn into_reusable_parts(self) -> ReusableParts {
        ReusableParts { system: self.system, pool: self.pool, mu: self.control.mu }
    }

    /// Starts the solver's own threads, unless they are running.
    fn start_pool(&mut self) -> Result<(), SolveError> {
        if self.pool.is_none() {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(self.options.threads).build();
            self.pool = Some(pool.map_err(|e| SolveError::Option { option: "threads", reason: e.to_string() })?);
        }
        Ok(())
    }

    /// Plans the solution of a problem and allocates memory.
    pub(super) fn prepare(&mut self, graph: &Graph, values: &Values) -> Result<(), SolveError> {
        self.options.check()?;
        // Threads take time to start. With one thread, a pool is needed only if the factorisation is split into parts.
        let parallel = self.options.threads != 1;
        if parallel && self.options.threads > 0 {
            self.start_pool()?;
        }
        let wanted = self.options.linear_solver;
        let previous = self.previous.take().map(|p| *p);
        let set_up = || NormalEquations::reuse(previous, graph, values, wanted, parallel);
        let system = in_pool(self.pool.as_ref(), set_up)?;
        if !parallel && system.wants_pool() {
            self.start_pool()?;
        }
        let n = system.dim();
        self.step = vec![0.0; n];
        self.newton_known = false;
        self.trace.reserve(self.options.max_iterations.min(200) as usize);
        match &self.resume_check {
            Some(check) => check.check_layout(system.layout.rows, n, self.d2.len())?,
            None => {
                self.d2 = vec![0.0; n];
                self.control.reset_radius();
            }
        }
        self.system = Some(Box::new(system));
        self.linearized = false;
        Ok(())
    }
}

/// Calls `f` in the solver's own threads, if it has any.
pub(crate) fn in_pool<T: Send>(pool: Option<&rayon::ThreadPool>, f: impl FnOnce() -> T + Send) -> T {
    match pool {
        Some(pool) => pool.install(f),
        None => f(),
    }
}

/// The parts of a solver that a later one may use again.
#[derive(Default)]
pub(crate) struct ReusableParts {
    pub system: Option<Box<NormalEquations>>,
    pub pool: Option<rayon::ThreadPool>,
    pub mu: f64,
}
