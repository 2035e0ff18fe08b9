//! Checkpoint files: the state of a minimisation on disk.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use argmin::core::checkpointing::{Checkpoint, CheckpointingFrequency};
use argmin::core::{Error, State};
use serde::{Deserialize, Serialize};

use crate::problem::values::Values;
use crate::step::checkpoint_error::CheckpointError;
use crate::step::exact::Exact;
use crate::step::levenberg_marquardt::{LevenbergMarquardt, SolverState};
use crate::step::options::Options;
use crate::step::report::{Iteration, StageSeconds, Termination};
use crate::step::snapshot::{Snapshot, step_options};

const FORMAT: &str = "depthcal-solver checkpoint";
const VERSION: u32 = 1;

/// A checkpoint on disk, for argmin's executor. A run that was cut short and resumed gives bitwise the same result as one
/// that was not.
///
/// The file is JSON with a checksum, and its numbers preserve every bit. It is written under a temporary name and then
/// renamed, so that it is complete at any time. It is not deleted at the end: a finished run that is started again
/// returns its result at once.
///
/// [`Options::max_iterations`] counts from the start of the first run, and replaces the limit in the executor's state
/// when the file exists. Between runs, limits and tolerances may be changed; the method, damping, scaling, linear solver
/// and minimum gain ratio may not.
///
/// ```
/// use argmin::core::{Executor, State, checkpointing::CheckpointingFrequency};
/// use depthcal_solver::{CheckpointFile, Graph, LevenbergMarquardt, Options, Prior, SolverState, Values};
/// use nalgebra::Vector2;
///
/// let mut values = Values::new();
/// let x = values.insert(Vector2::new(3.0, 4.0));
/// let mut graph = Graph::new();
/// graph.add_batch(Prior::isotropic("origin", x, Vector2::zeros(), 1.0)?);
/// let path = std::env::temp_dir().join(format!("checkpoint-{}.json", std::process::id()));
/// let options = Options::default();
/// let checkpoint = CheckpointFile::new(&path, &values, &options, CheckpointingFrequency::Every(5));
/// let result = Executor::new(&graph, LevenbergMarquardt::new(options))
///     .configure(|state: SolverState| state.param(values).max_iters(100))
///     .checkpointing(checkpoint)
///     .ctrlc(false)
///     .run()?;
/// assert!(result.state.get_best_cost() < 1e-6);
/// # std::fs::remove_file(&path).ok();
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct CheckpointFile {
    path: PathBuf,
    values: Values,
    options: Options,
    frequency: CheckpointingFrequency,
}

#[derive(Serialize, Deserialize)]
struct Document {
    format: String,
    version: u32,
    checksum: String,
    state: Stored,
}

/// The part that all versions of the format have in common.
#[derive(Deserialize)]
struct Head {
    format: String,
    version: u32,
}

#[derive(Serialize, Deserialize)]
struct Stored {
    options: Vec<(String, String)>,
    iteration: u64,
    best_iteration: u64,
    residuals: usize,
    /// μ, ν, radius.
    damping: Exact,
    scaling: Exact,
    /// Costs: at the start, current, previous, best, previous best; max |g_j|; target cost.
    costs: Exact,
    first_prediction: Option<Exact>,
    /// For each iteration: cost, trial cost, predicted decrease, gradient, step, damping, 1 if accepted.
    trace: Vec<Exact>,
    seconds: Exact,
    termination: Option<Termination>,
    /// Type and state of every variable.
    values: Vec<(String, Exact)>,
    /// The best values, if they differ from `values`.
    best: Option<Vec<(String, Exact)>>,
}

impl CheckpointFile {
    /// A checkpoint at `path`. `values` has the variables of the problem, and `options` are those of the solver.
    pub fn new(
        path: impl Into<PathBuf>,
        values: &Values,
        options: &Options,
        frequency: CheckpointingFrequency,
    ) -> Self {
        Self { path: path.into(), values: values.clone(), options: options.clone(), frequency }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn corrupt(&self, reason: impl Into<String>) -> CheckpointError {
        CheckpointError::Corrupt { path: self.path.clone(), reason: reason.into() }
    }

    fn foreign(&self, reason: String) -> CheckpointError {
        CheckpointError::Foreign { path: self.path.clone(), reason }
    }

    fn io(&self, action: &'static str) -> impl Fn(io::Error) -> CheckpointError {
        let path = self.path.clone();
        move |source| CheckpointError::Io { path: path.clone(), action, source }
    }

    fn store_values(&self, values: &Values) -> Result<Vec<(String, Exact)>, CheckpointError> {
        let store = |variable| {
            let type_name = values.type_name(variable);
            let path = self.path.clone();
            let state = values.state(variable).ok_or(CheckpointError::Unsupported { path, variable, type_name })?;
            Ok((type_name.to_owned(), Exact(state)))
        };
        values.ids().map(store).collect()
    }

    fn load_values(&self, stored: &[(String, Exact)]) -> Result<Values, CheckpointError> {
        let mut values = self.values.clone();
        if stored.len() != values.len() {
            return Err(self.foreign(format!("it has {} variables, this problem has {}", stored.len(), values.len())));
        }
        for (id, (type_name, state)) in self.values.ids().zip(stored) {
            let (n, expected) = (id.index(), values.type_name(id));
            if expected != type_name {
                return Err(self.foreign(format!(
                    "its variable {n} is of type {type_name}, that of this problem of type {expected}"
                )));
            }
            if !values.set_state(id, &state.0) {
                let reason = format!(
                    "the numbers of its variable {n} are not the state of a {expected} of this problem's dimension"
                );
                return Err(self.foreign(reason));
            }
        }
        Ok(values)
    }

    fn write(&self, solver: &LevenbergMarquardt, state: &SolverState) -> Result<(), CheckpointError> {
        let snapshot = solver.snapshot();
        // An interrupted run can be continued, and the iteration in which the interrupt was noticed did nothing.
        let interrupted = snapshot.termination == Some(Termination::Interrupted);
        let iteration = state.iter - u64::from(interrupted && state.iter > 0);
        let Some(values) = state.param.as_ref().filter(|_| iteration > 0) else { return Ok(()) };
        let values = self.store_values(values)?;
        let best = state.best_param.as_ref().map(|best| self.store_values(best)).transpose()?;
        let record = |i: &Iteration| {
            let accepted = f64::from(u8::from(i.accepted));
            Exact(vec![i.cost, i.trial_cost, i.predicted, i.gradient, i.step, i.damping, accepted])
        };
        let s = snapshot.seconds;
        let costs = [snapshot.cost0, snapshot.cost, state.prev_cost, state.best_cost, state.prev_best_cost];
        let stored = Stored {
            options: snapshot.step_options,
            iteration,
            best_iteration: state.last_best_iter,
            residuals: snapshot.rows,
            damping: Exact(vec![snapshot.mu, snapshot.nu, snapshot.radius]),
            scaling: Exact(snapshot.d2),
            costs: Exact([costs.as_slice(), &[snapshot.gradient, state.target_cost]].concat()),
            first_prediction: snapshot.first_prediction.map(|p| Exact(vec![p])),
            trace: snapshot.trace.iter().map(record).collect(),
            seconds: Exact(vec![s.structure, s.linearize, s.linear_solve, s.evaluate, s.total]),
            termination: snapshot.termination.filter(|_| !interrupted),
            best: best.filter(|best| *best != values),
            values,
        };
        let checksum = self.checksum(&stored)?;
        let document = Document { format: FORMAT.to_owned(), version: VERSION, checksum, state: stored };
        let text = serde_json::to_string_pretty(&document).map_err(|e| self.corrupt(e.to_string()))?;
        self.replace(&text).map_err(self.io("written"))
    }

    /// Writes under a temporary name, then renames.
    fn replace(&self, text: &str) -> io::Result<()> {
        let mut aside = self.path.clone().into_os_string();
        aside.push(format!(".{}.tmp", std::process::id()));
        // A file that a killed run left, or a link that someone else put there, is not written through.
        fs::remove_file(&aside).ok();
        let written = File::create_new(&aside).and_then(|mut file| {
            file.write_all(text.as_bytes())?;
            file.sync_all()
        });
        let result = written.and_then(|()| fs::rename(&aside, &self.path));
        if result.is_err() {
            // The incomplete file is useless; failing to remove it as well must not hide the first error.
            fs::remove_file(&aside).ok();
        }
        result
    }

    /// FNV-1a hash of the state as compact JSON.
    fn checksum(&self, stored: &Stored) -> Result<String, CheckpointError> {
        let text = serde_json::to_string(stored).map_err(|e| self.corrupt(e.to_string()))?;
        let step = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        Ok(format!("{:016x}", text.bytes().fold(0xcbf2_9ce4_8422_2325, step)))
    }

    /// The stored state, `None` if there is no file.
    fn read(&self) -> Result<Option<Stored>, CheckpointError> {
        let text = match fs::read_to_string(&self.path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) if e.kind() == io::ErrorKind::InvalidData => return Err(self.corrupt("it is not a text file")),
            other => other.map_err(self.io("read"))?,
        };
        let head: Head = serde_json::from_str(&text).map_err(|e| self.corrupt(e.to_string()))?;
        if head.format != FORMAT {
            return Err(self.corrupt(format!("its format is \"{}\"", head.format)));
        }
        if head.version != VERSION {
            return Err(CheckpointError::Version { path: self.path.clone(), found: head.version, expected: VERSION });
        }
        let document: Document = serde_json::from_str(&text).map_err(|e| self.corrupt(e.to_string()))?;
        if self.checksum(&document.state)? != document.checksum {
            return Err(self.corrupt("its checksum is wrong"));
        }
        Ok(Some(document.state))
    }

    fn restore(&self, stored: Stored) -> Result<(LevenbergMarquardt, SolverState), CheckpointError> {
        let given = step_options(&self.options);
        if let Some(((option, stored), (_, given))) = stored.options.iter().zip(given).find(|(s, g)| s.1 != g.1) {
            let (path, option, stored) = (self.path.clone(), option.clone(), stored.clone());
            return Err(CheckpointError::Options { path, option, stored, given });
        }
        let values = self.load_values(&stored.values)?;
        let best = stored.best.as_deref().map(|best| self.load_values(best)).transpose()?;
        let incomplete = || self.corrupt("it lacks some numbers");
        let [mu, nu, radius] = numbers(&stored.damping).ok_or_else(incomplete)?;
        let [cost0, cost, prev_cost, best_cost, prev_best_cost, gradient, target_cost] =
            numbers(&stored.costs).ok_or_else(incomplete)?;
        let [structure, linearize, linear_solve, evaluate, total] = numbers(&stored.seconds).ok_or_else(incomplete)?;
        let record = |i: &Exact| {
            let [cost, trial_cost, predicted, gradient, step, damping, accepted] = numbers(i)?;
            Some(Iteration { cost, trial_cost, predicted, gradient, step, damping, accepted: accepted == 1.0 })
        };
        let snapshot = Snapshot {
            step_options: stored.options,
            rows: stored.residuals,
            mu,
            nu,
            radius,
            d2: stored.scaling.0,
            first_prediction: stored.first_prediction.and_then(|p| p.0.first().copied()),
            cost0,
            cost,
            gradient,
            trace: stored.trace.iter().map(record).collect::<Option<_>>().ok_or_else(incomplete)?,
            seconds: StageSeconds { structure, linearize, linear_solve, evaluate, total },
            termination: stored.termination,
        };
        let mut state = SolverState::new().max_iters(self.options.max_iterations).target_cost(target_cost);
        state.best_param = Some(best.unwrap_or_else(|| values.clone()));
        state.param = Some(values);
        (state.cost, state.prev_cost) = (cost, prev_cost);
        (state.best_cost, state.prev_best_cost) = (best_cost, prev_best_cost);
        (state.iter, state.last_best_iter) = (stored.iteration, stored.best_iteration);
        if let Some(termination) = &snapshot.termination {
            state = state.terminate_with(termination.reason());
        }
        Ok((LevenbergMarquardt::resume(self.options.clone(), snapshot, self.path.clone()), state))
    }
}

fn numbers<const N: usize>(stored: &Exact) -> Option<[f64; N]> {
    stored.0.as_slice().try_into().ok()
}

impl Checkpoint<LevenbergMarquardt, SolverState> for CheckpointFile {
    fn save(&self, solver: &LevenbergMarquardt, state: &SolverState) -> Result<(), Error> {
        Ok(self.write(solver, state)?)
    }

    fn load(&self) -> Result<Option<(LevenbergMarquardt, SolverState)>, Error> {
        Ok(self.read()?.map(|stored| self.restore(stored)).transpose()?)
    }

    fn frequency(&self) -> CheckpointingFrequency {
        self.frequency
    }
}
