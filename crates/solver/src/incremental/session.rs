//! A session that adds and removes frames and solves again only for what changes.

use faer::prelude::Solve;
use faer::{Mat, Side};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::incremental::error::IncrementalError;
use crate::incremental::frame::Frame;
use crate::incremental::options::IncrementalOptions;
use crate::problem::error::EvaluationFailure;
use crate::problem::graph::Graph;
use crate::problem::values::Values;
use crate::step::levenberg_marquardt::in_pool;
use crate::step::minimize::minimize;
use crate::step::options::{Damping, Options};

/// Damping with which steps that fail begin, by which factors it grows and falls, and where it ends.
const FIRST_DAMPING: f64 = 1e-5;
const GROWTH: f64 = 100.0;
const FALL: f64 = 0.1;
const MAX_DAMPING: f64 = 1e12;
/// Mean square change of a frame's residuals, its own variables held, from which on it is linearised again in any case: where
/// shared variables are hardly determined, standard deviations say nothing about how far is far.
const FAR: f64 = 100.0;
/// Number of the frame of the session's own factors.
const PRIORS: u64 = 0;
/// Fewest frames that are shared out among threads.
const PARALLEL_FRAMES: usize = 16;
/// Relative difference of costs below which it is due to rounding errors.
const COST_ROUNDING: f64 = 1e-12;

/// Identifies a frame of an [`IncrementalSession`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameId(u64);

/// Minimises ½ Σ ρ(‖r‖²) over shared variables and over frames' own ones, while frames are added and removed.
///
/// A frame's factors depend on the shared variables and on variables of the frame alone, such as a camera and the pose of a
/// board. Each frame is kept as its Schur complement onto the shared variables. A new frame is solved with these held; then
/// the reduced system, as large as the shared variables, gives a step, and only frames are linearised again since whose
/// linearisation the shared variables have moved by more than [`IncrementalOptions::threshold`]. What this leaves is of second
/// order in the threshold, and [`settle`](Self::settle) removes it: the result is then the optimum of the whole problem.
///
/// All sums are in the order of the frames: bits do not depend on threads.
/// Memory is that of the buffers of each frame's factors, some ten times its Jacobian.
///
/// ```
/// use depthcal_solver::{Batch, Factor, Graph, IncrementalOptions, IncrementalSession, Over, Scalar, Values};
/// use nalgebra::{SVector, Vector1};
///
/// /// A straight line of the frame's own height and of a slope that all have in common.
/// struct Point {
///     x: f64,
///     y: f64,
/// }
///
/// impl Factor<1> for Point {
///     type Variables = (Vector1<f64>, Vector1<f64>);
///     fn residual<T: Scalar>(&self, (slope, height): Over<Self::Variables, T>) -> SVector<T, 1> {
///         SVector::<T, 1>::new(slope[0] * self.x + height[0] - self.y)
///     }
/// }
///
/// let mut shared = Values::new();
/// let slope = shared.insert(Vector1::new(0.0));
/// let mut session = IncrementalSession::new(shared, &Graph::new(), IncrementalOptions::default())?;
/// for height in [1.0, 5.0, -2.0] {
///     let (frame, key) = session.add(|values, graph| {
///         let key = values.insert(Vector1::new(0.0));
///         let mut batch = Batch::new("line");
///         (0..3).for_each(|x| batch.push(Point { x: f64::from(x), y: 2.0 * f64::from(x) + height }, (slope, key)));
///         graph.add_batch(batch);
///         key
///     })?;
///     assert!((session.frame_values(frame)?.get(key)[0] - height).abs() < 1e-9);
/// }
/// assert!((session.shared().get(slope)[0] - 2.0).abs() < 1e-9);
/// # Ok::<(), depthcal_solver::IncrementalError>(())
/// ```
pub struct IncrementalSession {
    options: IncrementalOptions,
    shared: Values,
    /// Graph of frames before they add factors: what is fixed.
    template: Graph,
    /// First component of each shared variable.
    firsts: Vec<usize>,
    frames: Vec<Frame>,
    next: u64,
    pool: Option<rayon::ThreadPool>,
    system: SharedSystem,
    linearizations: usize,
    /// Whether the shared variables have stayed where they started.
    held: bool,
}

/// The reduced system of the shared variables.
struct SharedSystem {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Diagonal of Σ H_cc, before elimination.
    scale: DVector<f64>,
}

impl SharedSystem {
    fn new(n: usize) -> Self {
        Self { hessian: DMatrix::zeros(n, n), gradient: DVector::zeros(n), scale: DVector::zeros(n) }
    }

    /// The step δ of (S + μ D²) δ = −g; `None` if the matrix is not positive definite. Components on which no frame depends stay.
    fn step(&self, mu: f64) -> Option<Vec<f64>> {
        let n = self.scale.len();
        let diagonal = |i: usize| if self.scale[i] > 0.0 { mu * self.scale[i] } else { 1.0 };
        let matrix = Mat::from_fn(n, n, |i, j| self.hessian[(i, j)] + if i == j { diagonal(i) } else { 0.0 });
        let solution = matrix.llt(Side::Lower).ok()?.solve(Mat::from_fn(n, 1, |i, _| -self.gradient[i]));
        let step: Vec<f64> = (0..n).map(|i| solution[(i, 0)]).collect();
        step.iter().all(|x| x.is_finite()).then_some(step)
    }

    /// The decrease of the cost that the quadratic function predicts.
    fn decrease(&self, step: &[f64]) -> f64 {
        let step = DVector::from_column_slice(step);
        -self.gradient.dot(&step) - 0.5 * step.dot(&(&self.hessian * &step))
    }
}

/// How a step ended.
enum Outcome {
    /// It was taken, with this decrease of the cost; at least one frame was linearised again, or none.
    Accepted { decrease: f64, linearized: bool },
    /// It would not have decreased the cost, or there was none.
    Rejected,
}

impl std::fmt::Debug for IncrementalSession {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("IncrementalSession").field("frames", &self.frames.len()).finish_non_exhaustive()
    }
}

impl IncrementalSession {
    /// A session without frames, in which all variables of `shared` are shared. `graph` has factors of shared variables alone,
    /// such as priors, and fixes variables or components of them, which no frame moves.
    ///
    /// # Errors
    /// [`IncrementalError::Threads`]; if graph and values do not fit together.
    pub fn new(shared: Values, graph: &Graph, options: IncrementalOptions) -> Result<Self, IncrementalError> {
        let mut n = 0;
        let firsts = shared.ids().map(|id| {
            n += shared.dim(id);
            n - shared.dim(id)
        });
        let firsts: Vec<usize> = firsts.collect();
        let pool = match options.threads {
            0 | 1 => None,
            threads => {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                Some(pool.map_err(|e| IncrementalError::Threads { reason: e.to_string() })?)
            }
        };
        let mut template = graph.clone();
        let batches: Vec<_> = graph.batches().map(|(id, _)| id).collect();
        batches.iter().for_each(|batch| _ = template.remove_batch(*batch));
        let mut frames = Vec::new();
        if !batches.is_empty() {
            frames.push(Frame::new(PRIORS, graph, shared.clone(), shared.len(), &firsts)?);
        }
        let (system, linearizations) = (SharedSystem::new(n), frames.len());
        Ok(Self {
            options,
            shared,
            template,
            firsts,
            frames,
            next: PRIORS + 1,
            pool,
            system,
            linearizations,
            held: true,
        })
    }

    /// Adds a frame. `build` inserts the frame's variables into values that have the shared ones already, and adds the frame's
    /// factors to a graph. Returns the frame and whatever `build` returns, such as keys.
    ///
    /// # Errors
    /// If the frame alone cannot be solved, does not determine its own variables, fixes shared ones, or has bounds. The session
    /// is then as it was.
    pub fn add<R>(
        &mut self,
        build: impl FnOnce(&mut Values, &mut Graph) -> R,
    ) -> Result<(FrameId, R), IncrementalError> {
        let (mut values, mut graph) = (self.shared.clone(), self.template.clone());
        let result = build(&mut values, &mut graph);
        if let Some(id) = self.shared.ids().find(|id| graph.fixed(*id) != self.template.fixed(*id)) {
            return Err(IncrementalError::Fixed { variable: graph.label_of(id) });
        }
        let own_from = self.shared.len();
        self.shared.ids().for_each(|id| values.copy_variable(id, &self.shared));
        if values.len() > own_from {
            let mut alone = graph.clone();
            self.shared.ids().for_each(|id| alone.fix(id));
            let options = Options { threads: 1, damping: Damping::WhenNeeded { tau: 1e-4 }, ..Options::default() };
            values = minimize(&alone, values, &options)?.values;
        }
        let frame = Frame::new(self.next, &graph, values, own_from, &self.firsts)?;
        self.frames.push(frame);
        self.linearizations += 1;
        let id = FrameId(self.next);
        self.next += 1;
        let count = self.frames().len();
        if self.held && count >= self.options.hold_until {
            self.held = false;
            if count > 1 {
                self.settle()?;
            }
        }
        self.update()?;
        Ok((id, result))
    }

    /// Removes a frame.
    ///
    /// # Errors
    /// [`IncrementalError::UnknownFrame`].
    pub fn remove(&mut self, frame: FrameId) -> Result<(), IncrementalError> {
        let index = self.find(frame)?;
        self.frames.remove(index);
        self.update()
    }

    /// The shared variables.
    pub fn shared(&self) -> &Values {
        &self.shared
    }

    /// A frame's values: the shared variables and its own ones, under the keys of its `build`.
    ///
    /// # Errors
    /// [`IncrementalError::UnknownFrame`].
    pub fn frame_values(&mut self, frame: FrameId) -> Result<Values, IncrementalError> {
        let index = self.find(frame)?;
        Ok(self.frames[index].values(&self.shared))
    }

    /// The frames of the session, in the order of additions.
    pub fn frames(&self) -> impl ExactSizeIterator<Item = FrameId> + '_ {
        let first = usize::from(self.frames.first().is_some_and(|frame| frame.id == PRIORS));
        self.frames[first..].iter().map(|frame| FrameId(frame.id))
    }

    /// The cost ½ Σ ρ(‖r‖²), by the frames' linearisations; exact after [`settle`](Self::settle).
    pub fn cost(&self) -> f64 {
        self.frames.iter().map(|frame| frame.predicted(false)).sum()
    }

    /// The information (inverse covariance) of the shared variables, all of their components in the order of the variables, with
    /// frames' own variables estimated; by the frames' linearisations.
    pub fn information(&mut self) -> DMatrix<f64> {
        self.assemble(0.0);
        self.system.hessian.clone()
    }

    /// Number of times that a frame was linearised so far.
    pub fn linearizations(&self) -> usize {
        self.linearizations
    }

    /// Iterates with all frames linearised in every step, until the cost no longer falls, whether shared variables are held or
    /// not. Returns whether it converged.
    ///
    /// # Errors
    /// [`IncrementalError::Evaluation`].
    pub fn settle(&mut self) -> Result<bool, IncrementalError> {
        let shared = &self.shared;
        run(self.pool.as_ref(), self.options.threads, &mut self.frames, |frame| frame.relinearize(shared))?;
        self.linearizations += self.frames.len();
        let mut mu = 0.0;
        for _ in 0..self.options.max_settling_steps {
            let before: f64 = self.frames.iter().map(|frame| frame.cost).sum();
            match self.take_step(mu, true)? {
                Outcome::Accepted { decrease, .. } if mu == 0.0 && decrease <= self.options.cost_tolerance * before => {
                    return Ok(true);
                }
                Outcome::Accepted { .. } => mu = if mu <= FIRST_DAMPING { 0.0 } else { FALL * mu },
                Outcome::Rejected if mu > MAX_DAMPING => return Ok(false),
                Outcome::Rejected => mu = if mu == 0.0 { FIRST_DAMPING } else { GROWTH * mu },
            }
        }
        Ok(false)
    }

    fn find(&self, frame: FrameId) -> Result<usize, IncrementalError> {
        // The first frame may be that of the session's own factors, whose number no one has.
        let index = self.frames.binary_search_by_key(&frame.0, |f| f.id);
        index.map_err(|_| IncrementalError::UnknownFrame { frame: frame.0 })
    }

    /// Moves the shared variables after a change of the frames.
    fn update(&mut self) -> Result<(), IncrementalError> {
        if self.held {
            return Ok(());
        }
        let mut mu = 0.0;
        for _ in 0..self.options.max_steps {
            match self.take_step(mu, false)? {
                // Where no frame was linearised again the quadratic function is the one that was just minimised.
                Outcome::Accepted { linearized: false, .. } => return Ok(()),
                Outcome::Accepted { .. } => {}
                Outcome::Rejected => mu = if mu == 0.0 { FIRST_DAMPING } else { GROWTH * mu },
            }
        }
        Ok(())
    }

    /// Sums the reduced systems of all frames; false if one cannot be eliminated.
    fn assemble(&mut self, mu: f64) -> bool {
        let SharedSystem { hessian, gradient, scale } = &mut self.system;
        hessian.fill(0.0);
        gradient.fill(0.0);
        scale.fill(0.0);
        self.frames.iter_mut().all(|frame| {
            let eliminated = frame.eliminate(mu);
            frame.add_to(hessian, gradient, scale);
            eliminated
        })
    }

    /// Tries a step of the shared variables, with all frames linearised again or with those that have moved too far.
    fn take_step(&mut self, mu: f64, all: bool) -> Result<Outcome, IncrementalError> {
        if !self.assemble(mu) {
            return Ok(Outcome::Rejected);
        }
        let Some(step) = self.system.step(mu) else { return Ok(Outcome::Rejected) };
        let promised = self.system.decrease(&step);
        let mut shared = self.shared.clone();
        for id in self.shared.ids() {
            let first = self.firsts[id.index()];
            shared.retract(id, &step[first..first + shared.dim(id)]);
        }
        let limit = self.options.threshold * self.options.threshold;
        let (mut before, mut after) = (0.0, 0.0);
        for frame in &mut self.frames {
            let (together, alone) = frame.plan(&shared, &self.system.hessian);
            frame.flagged = all || together > limit || alone > FAR;
        }
        let (pool, threads) = (self.pool.as_ref(), self.options.threads);
        run(pool, threads, &mut self.frames, |frame| {
            if frame.flagged {
                frame.try_move(&shared);
            }
            Ok(())
        })?;
        for frame in &self.frames {
            // A frame that has been linearised here has a cost; one that has moved since has an estimate.
            before += if all { frame.cost } else { frame.predicted(false) };
            after += if frame.flagged { frame.trial_cost } else { frame.predicted(true) };
        }
        let decrease = before - after;
        let rounding = COST_ROUNDING * before;
        // Without frames that are evaluated the decrease is that of the quadratic function.
        let evaluated = self.frames.iter().any(|frame| frame.flagged);
        let tolerance = if all { rounding } else { rounding.max(0.1 * promised.abs()) + limit };
        if evaluated && (!after.is_finite() || decrease < -tolerance) {
            if !all {
                let present = &self.shared;
                let again = |frame: &mut Frame| if frame.flagged { frame.relinearize(present) } else { Ok(()) };
                run(pool, threads, &mut self.frames, again)?;
                self.linearizations += self.frames.iter().filter(|frame| frame.flagged).count();
            }
            return Ok(Outcome::Rejected);
        }
        run(pool, threads, &mut self.frames, Frame::accept)?;
        self.linearizations += self.frames.iter().filter(|frame| frame.flagged).count();
        self.shared = shared;
        Ok(Outcome::Accepted { decrease, linearized: evaluated })
    }
}

/// Calls `f` for all frames, on several threads where that pays.
fn run(
    pool: Option<&rayon::ThreadPool>,
    threads: usize,
    frames: &mut [Frame],
    f: impl Fn(&mut Frame) -> Result<(), EvaluationFailure> + Sync + Send,
) -> Result<(), EvaluationFailure> {
    if threads == 1 || frames.len() < PARALLEL_FRAMES {
        return frames.iter_mut().try_for_each(f);
    }
    in_pool(pool, || frames.par_iter_mut().with_min_len(PARALLEL_FRAMES / 2).try_for_each(f))
}
