//! Levenberg–Marquardt, dog-leg and Gauss–Newton as a solver of argmin.

mod damping;
mod resume;
mod step;

use std::borrow::Borrow;
use std::time::Instant;

use argmin::core::{Error, IterState, KV, Problem, Solver, State};

use crate::error::SolveError;
use crate::graph::Graph;
use crate::interrupt::Interrupt;
use crate::normal::NormalEquations;
use crate::options::{Method, Options};
use crate::report::{Iteration, Report, StageSeconds, Termination, Weakest};
use crate::snapshot::Resumed;
use crate::spare::Spare;
use crate::values::Values;

/// State of the iteration as argmin keeps it.
pub type SolverState = IterState<Values, (), (), (), (), f64>;

/// Relative pivots that raise suspicion if the damping explains them, and those that rounding errors leave of zero.
const SMALL_PIVOT: f64 = 1e-6;
const ROUNDING_PIVOT: f64 = 1e-13;

/// Levenberg 1944, Marquardt 1963: minimises ½ Σ ρ(‖r(x)‖²) by steps (H + μ D²) δ = −g with H = Jᵀ W J, g = Jᵀ W r and W the
/// weights ρ′ of the loss. With [`Options::method`] the same solver makes dog-leg or Gauss–Newton steps.
///
/// An `argmin` solver for problems that lend a [`Graph`]: `&Graph`, `Graph` or `Arc<Graph>`. [`minimize`](crate::minimize)
/// runs it; use argmin's `Executor` for observers, checkpoints and the like:
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
    /// What an earlier solver laid out.
    previous: Option<Box<NormalEquations>>,
    /// What a checkpoint says, until the problem has been linearised where it stood.
    resumed: Option<Resumed>,
    options: Options,
    system: Option<Box<NormalEquations>>,
    pool: Option<rayon::ThreadPool>,
    mu: f64,
    /// By what the next rejected step multiplies μ.
    nu: f64,
    /// D².
    d2: Vec<f64>,
    step: Vec<f64>,
    /// The Gauss–Newton step of the last linearisation, for other methods than Levenberg–Marquardt, once it is known.
    newton: Vec<f64>,
    newton_known: bool,
    /// Memory for trial values.
    spare: Spare,
    /// Radius of the dog-leg, share of the Gauss–Newton step.
    radius: f64,
    linearized: bool,
    /// What the model predicted at the first trial since the last linearisation.
    first_prediction: Option<f64>,
    cost0: f64,
    cost: f64,
    gradient: f64,
    trace: Vec<Iteration>,
    seconds: StageSeconds,
    termination: Option<Termination>,
}

impl std::fmt::Debug for LevenbergMarquardt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LevenbergMarquardt")
            .field("options", &self.options)
            .field("damping", &self.mu)
            .field("cost", &self.cost)
            .field("termination", &self.termination)
            .finish_non_exhaustive()
    }
}

impl LevenbergMarquardt {
    /// A solver with these options. `max_iterations`, `time_limit` and `ctrlc` are for [`minimize`](crate::minimize);
    /// with an executor of your own, set them there.
    pub fn new(options: Options) -> Self {
        Self {
            previous: None,
            resumed: None,
            options,
            system: None,
            pool: None,
            mu: 0.0,
            nu: 2.0,
            d2: Vec::new(),
            step: Vec::new(),
            newton: Vec::new(),
            newton_known: false,
            spare: Spare::default(),
            radius: 0.0,
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

    /// What happened so far.
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
        let damping = if self.options.method == Method::LevenbergMarquardt { last.damping } else { self.mu };
        // The pivot of a combination of n components, none of them more than the others, is n times the damping.
        let suspect = pivot < SMALL_PIVOT && pivot < 2.0 * system.dim() as f64 * damping + ROUNDING_PIVOT;
        Some(Weakest { variable, label: system.label(variable), component, pivot, damping, suspect })
    }

    /// A solver that takes over what an earlier one laid out, where it fits.
    pub(crate) fn renew(options: Options, remains: Remains) -> Self {
        let mu = if options.method == Method::LevenbergMarquardt { remains.mu } else { 0.0 };
        Self { previous: remains.system, pool: remains.pool, mu, ..Self::new(options) }
    }

    /// What a later one may take over.
    pub(crate) fn remains(self) -> Remains {
        Remains { system: self.system, pool: self.pool, mu: self.mu }
    }

    fn start_pool(&mut self) -> Result<(), SolveError> {
        if self.pool.is_none() {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(self.options.threads).build();
            self.pool = Some(pool.map_err(|e| SolveError::Option { option: "threads", reason: e.to_string() })?);
        }
        Ok(())
    }

    /// Lays out memory for a problem.
    fn prepare(&mut self, graph: &Graph, values: &Values) -> Result<(), SolveError> {
        self.options.check()?;
        // Threads take time to start: one thread does without others where it can.
        let parallel = self.options.threads != 1;
        if parallel && self.options.threads > 0 {
            self.start_pool()?;
        }
        let choice = self.options.linear_solver;
        let previous = self.previous.take().map(|p| *p);
        let renew = || NormalEquations::renew(previous, graph, values, choice, parallel);
        let system = in_pool(self.pool.as_ref(), renew)?;
        if !parallel && system.wants_pool() {
            self.start_pool()?;
        }
        let n = system.dim();
        self.step = vec![0.0; n];
        self.newton_known = false;
        self.trace.reserve(self.options.max_iterations.min(200) as usize);
        match &self.resumed {
            Some(resumed) => resumed.check_layout(system.layout.rows, n, self.d2.len())?,
            None => {
                self.d2 = vec![0.0; n];
                self.radius = match self.options.method {
                    Method::DogLeg { radius } => radius,
                    _ => 1.0,
                };
            }
        }
        self.system = Some(Box::new(system));
        self.linearized = false;
        Ok(())
    }
}

/// Runs within the solver's own threads, if it has any.
pub(crate) fn in_pool<T: Send>(pool: Option<&rayon::ThreadPool>, f: impl FnOnce() -> T + Send) -> T {
    match pool {
        Some(pool) => pool.install(f),
        None => f(),
    }
}

impl<G: Borrow<Graph>> Solver<G, SolverState> for LevenbergMarquardt {
    fn name(&self) -> &str {
        match self.options.method {
            Method::LevenbergMarquardt => "Levenberg-Marquardt",
            Method::DogLeg { .. } => "dog-leg",
            Method::GaussNewton => "Gauss-Newton",
        }
    }

    fn init(&mut self, problem: &mut Problem<G>, mut state: SolverState) -> Result<(SolverState, Option<KV>), Error> {
        let begin = Instant::now();
        let mut values = take_values(&mut state)?;
        problem.problem("structure_count", |graph| Ok(self.prepare(graph.borrow(), &values)?))?;
        self.seconds.structure += begin.elapsed().as_secs_f64();
        if let Some(system) = &self.system {
            system.bounds.project(&mut values);
        }
        problem.problem("linearize_count", |_| Ok(self.linearize(&values).map_err(SolveError::Start)?))?;
        self.cost0 = self.cost;
        self.seconds.total += begin.elapsed().as_secs_f64();
        let kv = argmin::kv!("gradient" => self.gradient; "damping" => self.mu;);
        let cost = self.cost;
        Ok((state.param(values).cost(cost), Some(kv)))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<G>,
        mut state: SolverState,
    ) -> Result<(SolverState, Option<KV>), Error> {
        let begin = Instant::now();
        let values = take_values(&mut state)?;
        if self.system.is_none() {
            problem.problem("structure_count", |graph| Ok(self.prepare(graph.borrow(), &values)?))?;
        }
        if !self.linearized
            && let Err(failure) = problem.problem("linearize_count", |_| Ok(self.linearize(&values)))?
        {
            self.termination = Some(Termination::NotDifferentiable(failure.to_string()));
        }
        if let Some(resumed) = self.resumed.take() {
            resumed.check_cost(self.cost).map_err(SolveError::from)?;
            self.first_prediction = resumed.first_prediction;
        }
        if self.step.is_empty() {
            self.termination = Some(Termination::NothingToEstimate);
        } else if self.gradient <= self.options.gradient_tolerance {
            self.termination = Some(Termination::Gradient);
        }
        if self.termination.is_none() && self.options.interrupt.as_ref().is_some_and(Interrupt::is_raised) {
            self.termination = Some(Termination::Interrupted);
        }
        let trial = match self.termination {
            Some(_) => None,
            None => problem.problem("step_count", |_| Ok(self.try_step(&values)))?,
        };
        self.seconds.total += begin.elapsed().as_secs_f64();
        let cost = self.cost;
        let values = match trial {
            Some(trial) => {
                self.spare.put(values);
                trial
            }
            None => values,
        };
        let mut state = state.param(values).cost(cost);
        if let Some(termination) = &self.termination {
            state = state.terminate_with(termination.reason());
        }
        let kv = argmin::kv!("gradient" => self.gradient; "damping" => self.mu;);
        Ok((state, Some(kv)))
    }
}

/// What is left of a solver for a later one.
#[derive(Default)]
pub(crate) struct Remains {
    pub system: Option<Box<NormalEquations>>,
    pub pool: Option<rayon::ThreadPool>,
    pub mu: f64,
}

fn take_values(state: &mut SolverState) -> Result<Values, Error> {
    state.take_param().ok_or_else(|| {
        let reason = "the executor's state has no values to start from".to_owned();
        SolveError::Executor { reason }.into()
    })
}
