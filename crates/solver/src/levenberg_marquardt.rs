//! Levenberg–Marquardt, dog-leg and Gauss–Newton as a solver of argmin.

use std::borrow::Borrow;
use std::path::PathBuf;
use std::time::Instant;

use argmin::core::{Error, IterState, KV, Problem, Solver, State, TerminationReason};

use crate::dog_leg::DogLeg;
use crate::error::SolveError;
use crate::graph::Graph;
use crate::interrupt::Interrupt;
use crate::normal::NormalEquations;
use crate::options::{Damping, Method, Options, Scaling};
use crate::report::{Iteration, Report, StageSeconds, Termination};
use crate::snapshot::{Resumed, Snapshot, setup};
use crate::values::Values;

/// State of the iteration as argmin keeps it.
pub type SolverState = IterState<Values, (), (), (), (), f64>;

/// Smallest damping: below, rounding errors of H exceed it.
const MIN_DAMPING: f64 = 1e-15;
/// By what a good step multiplies the damping at least. A third, as Nielsen has it, slows the last iterations down.
const MIN_FACTOR: f64 = 0.1;
/// Damping at which steps are too short to matter.
const MAX_DAMPING: f64 = 1e20;
/// Relative differences of the cost below this are rounding errors.
const COST_ROUNDING: f64 = 1e-12;
/// Root mean square of residuals that counts as zero once a step cannot improve on it.
const ZERO_RESIDUAL: f64 = 1e-10;

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
    /// The Gauss–Newton step of the last linearisation, for other methods than Levenberg–Marquardt.
    newton: Option<Vec<f64>>,
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
            resumed: None,
            options,
            system: None,
            pool: None,
            mu: 0.0,
            nu: 2.0,
            d2: Vec::new(),
            step: Vec::new(),
            newton: None,
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
        }
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
        let system = in_pool(self.pool.as_ref(), || NormalEquations::new(graph, values, choice, parallel))?;
        if !parallel && system.wants_pool() {
            self.start_pool()?;
        }
        let n = system.dim();
        self.step = vec![0.0; n];
        self.newton = None;
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

    /// Linearises at the present values and brings scaling and damping up to date.
    fn linearize(&mut self, values: &Values) -> Result<(), crate::error::EvaluationFailure> {
        let Some(system) = self.system.as_mut() else { return Ok(()) };
        let start = Instant::now();
        let cost = in_pool(self.pool.as_ref(), || system.linearize(values));
        self.seconds.linearize += start.elapsed().as_secs_f64();
        self.cost = cost?;
        self.linearized = true;
        self.newton = None;
        self.first_prediction = None;
        for (d2, h) in self.d2.iter_mut().zip(system.diagonal()) {
            *d2 = match (self.options.damping, self.options.scaling) {
                (Damping::Nielsen { .. }, Scaling::Jacobi) => d2.max(*h),
                (_, Scaling::None) => 1.0,
                (Damping::Radius { .. }, Scaling::Jacobi) => *h,
            };
            if *d2 == 0.0 {
                // A component without influence on the residuals stays where it is.
                *d2 = 1.0;
            }
        }
        system.hold_active(values);
        self.gradient = system.gradient().iter().fold(0.0, |max, g| g.abs().max(max));
        if self.mu == 0.0 {
            self.mu = match self.options.damping {
                _ if self.options.method != Method::LevenbergMarquardt => MIN_DAMPING,
                Damping::Nielsen { tau } => {
                    let scaled = system.diagonal().iter().zip(&self.d2).map(|(h, d2)| h / d2);
                    tau * scaled.fold(0.0, f64::max)
                }
                Damping::Radius { initial, .. } => 1.0 / initial,
            };
            self.mu = self.mu.max(MIN_DAMPING);
        }
        Ok(())
    }

    /// Writes the next step to try; returns the decrease of the cost that the model predicts and ‖D δ‖ where it matters, or
    /// nothing if the linear system is not positive definite.
    fn find_step(&mut self, values: &Values) -> Option<(f64, f64)> {
        let system = self.system.as_mut()?;
        if self.options.method == Method::LevenbergMarquardt {
            let (mu, d2, step) = (self.mu, &self.d2, &mut self.step);
            if !in_pool(self.pool.as_ref(), || system.solve_within(values, mu, d2, step)) {
                return None;
            }
            // F(0) − F(δ) of the model ½ ‖r + J δ‖², with H δ = −g − μ D² δ put in.
            let terms = self.step.iter().zip(system.gradient()).zip(&self.d2);
            return Some((terms.map(|((s, g), d2)| 0.5 * s * (mu * d2 * s - g)).sum(), 0.0));
        }
        if self.newton.is_none() {
            let mut newton = vec![0.0; self.step.len()];
            let (mu, d2) = (self.mu, &self.d2);
            if !in_pool(self.pool.as_ref(), || system.solve_within(values, mu, d2, &mut newton)) {
                return None;
            }
            self.newton = Some(newton);
        }
        let newton = self.newton.as_ref()?;
        let gradient = system.gradient();
        if let Method::DogLeg { .. } = self.options.method {
            for ((s, g), d2) in self.step.iter_mut().zip(gradient).zip(&self.d2) {
                *s = -g / d2;
            }
            let curvature = system.quadratic_form(&self.step);
            let dog_leg = DogLeg { gradient, d2: &self.d2, newton, curvature, radius: self.radius };
            return Some(dog_leg.step(&mut self.step));
        }
        let share = self.radius;
        self.step.iter_mut().zip(newton).for_each(|(s, n)| *s = share * n);
        let slope: f64 = newton.iter().zip(gradient).map(|(n, g)| -n * g).sum();
        Some((share * (1.0 - 0.5 * share) * slope, 0.0))
    }

    /// Solves for a step and tries it; the moved values if the step is good.
    fn try_step(&mut self, values: &Values) -> Option<Values> {
        let start = Instant::now();
        if self.system.as_ref().is_some_and(|s| s.narrowed()) {
            // What the rejected step held may be free to move in a shorter one.
            let first_prediction = self.first_prediction;
            self.linearize(values).ok()?;
            self.first_prediction = first_prediction;
        }
        let found = self.find_step(values);
        self.seconds.linear_solve += start.elapsed().as_secs_f64();
        let mut record = Iteration {
            cost: self.cost,
            trial_cost: f64::INFINITY,
            predicted: f64::NAN,
            gradient: self.gradient,
            step: f64::NAN,
            damping: if self.options.method == Method::LevenbergMarquardt { self.mu } else { self.radius },
            accepted: false,
        };
        let Some((mut predicted, length)) = found else {
            self.trace.push(record);
            self.mu *= self.nu;
            self.nu *= 2.0;
            self.stop_if_stalled();
            return None;
        };
        let system = self.system.as_mut()?;
        let clipped = system.clip(values, &mut self.step);
        predicted = clipped.unwrap_or(predicted);
        // While bounds come into play a small decrease says nothing.
        let whole = clipped.is_none() && !system.narrowed();
        record.predicted = predicted;
        record.step = self.step.iter().zip(system.diagonal()).fold(0.0, |max, (s, h)| (s.abs() * h.sqrt()).max(max));
        let start = Instant::now();
        let trial = system.retract(values, &self.step);
        record.trial_cost =
            in_pool(self.pool.as_ref(), || system.cost(&trial)).ok().filter(|c| c.is_finite()).unwrap_or(f64::INFINITY);
        self.seconds.evaluate += start.elapsed().as_secs_f64();
        let first = self.first_prediction.is_none() && whole;
        let promised = *self.first_prediction.get_or_insert(predicted);
        let decrease = self.cost - record.trial_cost;
        let ratio = decrease / predicted;
        // Close to the minimum the cost can no longer tell a good step from a bad one, but the model can.
        let rounding = COST_ROUNDING * self.cost;
        let level = predicted <= rounding && decrease.abs() <= rounding;
        let last = first && level;
        record.accepted = last || clipped.is_some() && level || decrease > 0.0 && ratio > self.options.min_gain_ratio;
        let still = record.step <= self.options.parameter_tolerance * (2.0 * self.cost).sqrt();
        let tolerance = self.options.cost_tolerance * self.cost;
        let residuals = system.layout.rows as f64;
        let (accepted, trial_cost) = (record.accepted, record.trial_cost);
        self.trace.push(record);
        if accepted {
            // After rejected steps a small decrease is due to the damping and says nothing.
            if first && decrease <= tolerance {
                self.termination = Some(Termination::Cost);
            } else if first && still {
                self.termination = Some(Termination::Parameters);
            } else if last {
                self.termination = Some(Termination::Rounding);
            }
            match self.options.method {
                Method::LevenbergMarquardt if ratio.is_finite() => {
                    let factor = (1.0 - (2.0 * ratio - 1.0).powi(3)).max(MIN_FACTOR);
                    self.mu = (self.mu * factor).max(self.min_damping());
                }
                Method::DogLeg { .. } if ratio > 0.75 => self.radius = self.radius.max(3.0 * length),
                Method::DogLeg { .. } if ratio < 0.25 => self.radius *= 0.5,
                Method::GaussNewton => self.radius = 1.0,
                _ => {}
            }
            self.nu = 2.0;
            self.cost = trial_cost;
            self.linearized = false;
            return Some(trial);
        }
        if whole && promised <= tolerance {
            self.termination = Some(Termination::Cost);
        } else if first && still {
            self.termination = Some(Termination::Parameters);
        } else if self.cost <= 0.5 * residuals * ZERO_RESIDUAL * ZERO_RESIDUAL {
            self.termination = Some(Termination::Rounding);
        }
        self.reject(length);
        None
    }

    fn min_damping(&self) -> f64 {
        match self.options.damping {
            Damping::Nielsen { .. } => MIN_DAMPING,
            Damping::Radius { max, .. } => (1.0 / max).max(MIN_DAMPING),
        }
    }

    fn reject(&mut self, length: f64) {
        match self.options.method {
            Method::LevenbergMarquardt => {
                self.mu *= self.nu;
                self.nu *= 2.0;
            }
            // The region has to shrink below the step just rejected.
            Method::DogLeg { .. } => self.radius = 0.5 * self.radius.min(length),
            Method::GaussNewton => self.radius *= 0.5,
        }
        self.stop_if_stalled();
    }

    fn stop_if_stalled(&mut self) {
        let tiny = match self.options.method {
            Method::LevenbergMarquardt => false,
            Method::DogLeg { .. } => self.radius <= 1.0 / MAX_DAMPING,
            Method::GaussNewton => self.radius <= MIN_DAMPING,
        };
        if (tiny || self.mu > MAX_DAMPING) && self.termination.is_none() {
            self.termination = Some(Termination::Stalled);
        }
    }
}

/// Runs within the solver's own threads, if it has any.
fn in_pool<T: Send>(pool: Option<&rayon::ThreadPool>, f: impl FnOnce() -> T + Send) -> T {
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
        let mut state = state.param(trial.unwrap_or(values)).cost(cost);
        if let Some(termination) = &self.termination {
            state = state.terminate_with(termination.reason());
        }
        let kv = argmin::kv!("gradient" => self.gradient; "damping" => self.mu;);
        Ok((state, Some(kv)))
    }
}

impl LevenbergMarquardt {
    /// What it takes to go on from here.
    pub(crate) fn snapshot(&self) -> Snapshot {
        Snapshot {
            setup: setup(&self.options),
            rows: self.system.as_ref().map_or(0, |s| s.layout.rows),
            mu: self.mu,
            nu: self.nu,
            radius: self.radius,
            d2: self.d2.clone(),
            first_prediction: self.first_prediction.filter(|_| self.linearized),
            cost0: self.cost0,
            cost: self.cost,
            gradient: self.gradient,
            trace: self.trace.clone(),
            seconds: self.seconds,
            termination: self.termination.clone(),
        }
    }

    /// A solver that goes on from a snapshot.
    pub(crate) fn resume(options: Options, snapshot: Snapshot, path: PathBuf) -> Self {
        let resumed =
            Resumed { path, rows: snapshot.rows, cost: snapshot.cost, first_prediction: snapshot.first_prediction };
        Self {
            resumed: Some(resumed),
            mu: snapshot.mu,
            nu: snapshot.nu,
            radius: snapshot.radius,
            d2: snapshot.d2,
            cost0: snapshot.cost0,
            cost: snapshot.cost,
            gradient: snapshot.gradient,
            trace: snapshot.trace,
            seconds: snapshot.seconds,
            termination: snapshot.termination,
            ..Self::new(options)
        }
    }

    /// Takes over why an executor stopped.
    pub(crate) fn stopped_by_executor(&mut self, reason: Option<&TerminationReason>) {
        if self.termination.is_none() {
            self.termination = Some(match reason {
                Some(TerminationReason::Interrupt) => Termination::Interrupted,
                Some(TerminationReason::Timeout) => Termination::TimeLimit,
                _ => Termination::MaxIterations,
            });
        }
    }
}

fn take_values(state: &mut SolverState) -> Result<Values, Error> {
    state.take_param().ok_or_else(|| {
        let reason = "the executor's state has no values to start from".to_owned();
        SolveError::Executor { reason }.into()
    })
}
