//! Runs that are cut short and resumed from a file.

use std::fs;
use std::path::PathBuf;

use crate::common::{Bundle, Exponential, bundle};
use argmin::core::checkpointing::CheckpointingFrequency;
use argmin::core::{Error, Executor, State};
use depthcal_solver::{
    Batch, CheckpointError, CheckpointFile, CheckpointOptions, Damping, Graph, Interrupt, LevenbergMarquardt, Loss,
    Method, Options, Prior, Report, SolveError, SolverState, Values, Variable, minimize,
};
use nalgebra::{DVector, Isometry3, Unit, UnitQuaternion, Vector2, Vector3};

/// The path of a file that does not exist at first and is removed at the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("depthcal-solver-{}-{name}.json", std::process::id()));
        fs::remove_file(&path).ok();
        Self(path)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        fs::remove_file(&self.0).ok();
    }
}

fn run(graph: &Graph, values: &Values, options: &Options, path: Option<&Scratch>) -> Result<(Values, Report), Error> {
    let mut executor = Executor::new(graph, LevenbergMarquardt::new(options.clone()))
        .configure(|state: SolverState| state.param(values.clone()).max_iters(options.max_iterations))
        .ctrlc(false);
    if let Some(Scratch(path)) = path {
        executor = executor.checkpointing(CheckpointFile::new(path, values, options, CheckpointingFrequency::Always));
    }
    let result = executor.run()?;
    Ok((result.state.get_param().unwrap().clone(), result.solver.report()))
}

fn bits(values: &Values) -> Vec<u64> {
    values.ids().flat_map(|id| values.state(id).unwrap()).map(f64::to_bits).collect()
}

fn trace(report: &Report) -> Vec<(Vec<u64>, bool)> {
    let numbers = |i: &depthcal_solver::Iteration| [i.cost, i.trial_cost, i.predicted, i.gradient, i.step, i.damping];
    report.trace.iter().map(|i| (numbers(i).map(f64::to_bits).to_vec(), i.accepted)).collect()
}

/// A run that is cut after every iteration and resumed by a new solver.
#[test]
fn a_run_that_is_cut_gives_the_same_bits() {
    let Bundle { graph, values, camera, points, .. } = bundle(6, 60, 0.5, Loss::Cauchy { scale: 0.3 }, 3);
    // A curve from a poor start.
    let mut start = Values::new();
    let key = start.insert(Vector2::new(1.0, -4.0));
    let mut curve = Batch::new("curve");
    (0..20).map(|i| 0.1 * f64::from(i)).for_each(|x| curve.push(Exponential { x, y: 2.0 * (1.5 * x).exp() }, (key,)));
    let mut curves = Graph::new();
    curves.add_batch(curve);
    let radius = Damping::Radius { initial: 1e9, max: 1e16 };
    // Some of these steps are rejected, so that the state since the last linearisation matters, too.
    let methods = [
        ("lm", Method::LevenbergMarquardt, Damping::Nielsen { tau: 1e-12 }),
        ("radius", Method::LevenbergMarquardt, radius),
        ("dog-leg", Method::DogLeg { radius: 3e4 }, Damping::default()),
        ("gauss-newton", Method::GaussNewton, Damping::default()),
    ];
    let mut rejected = 0;
    let mut bounded = graph.clone();
    bounded.bound(camera, 0, 0.0, 490.0);
    bounded.bound(camera, 1, -0.06, 0.0);
    points.iter().for_each(|p| bounded.bound(*p, 2, -0.5, 0.5));
    let problems = [(&graph, &values), (&curves, &start), (&bounded, &values)];
    for ((name, method, damping), (graph, values)) in methods.into_iter().flat_map(|m| problems.map(|p| (m, p))) {
        let options = Options { method, damping, threads: 1, ..Options::default() };
        let (whole, report) = run(graph, values, &options, None).unwrap();
        assert!(report.iterations > 2, "{report}");
        rejected += report.trace.iter().filter(|i| !i.accepted).count();
        let path = Scratch::new(name);
        for most in 1..=report.iterations as u64 {
            let cut = Options { max_iterations: most, ..options.clone() };
            assert_eq!(run(graph, values, &cut, Some(&path)).unwrap().1.iterations as u64, most);
        }
        let (pieces, resumed) = run(graph, values, &options, Some(&path)).unwrap();
        assert_eq!(bits(&pieces), bits(&whole), "{name}");
        assert_eq!(trace(&resumed), trace(&report), "{name}");
        assert_eq!((resumed.cost0, resumed.cost), (report.cost0, report.cost));
        assert_eq!(resumed.termination, report.termination);
    }
    assert!(rejected > 4, "{rejected}");
}

#[test]
fn an_interrupted_run_goes_on() {
    let Bundle { graph, values, .. } = bundle(6, 60, 0.5, Loss::Trivial, 3);
    let (whole, _) = run(&graph, &values, &Options { threads: 1, ..Options::default() }, None).unwrap();
    let path = Scratch::new("interrupt");
    let interrupt = Interrupt::new();
    let options = Options { threads: 1, max_iterations: 2, interrupt: Some(interrupt.clone()), ..Options::default() };
    run(&graph, &values, &options, Some(&path)).unwrap();
    interrupt.raise();
    let stopped = Options { max_iterations: 50, ..options.clone() };
    let executor = Executor::new(&graph, LevenbergMarquardt::new(stopped.clone()))
        .checkpointing(CheckpointFile::new(&path.0, &values, &stopped, CheckpointingFrequency::Always))
        .ctrlc(false);
    assert_eq!(executor.run().unwrap().solver.report().iterations, 2);
    let free = Options { interrupt: None, max_iterations: 50, ..options };
    assert_eq!(bits(&run(&graph, &values, &free, Some(&path)).unwrap().0), bits(&whole));
}

#[test]
fn minimize_goes_on_from_its_checkpoint() {
    let Bundle { graph, values, .. } = bundle(6, 60, 0.5, Loss::Trivial, 3);
    let path = Scratch::new("minimize");
    let whole = minimize(&graph, values.clone(), &Options::default()).unwrap();
    let checkpoint = |every| Some(CheckpointOptions { path: path.0.clone(), every });
    let cut = Options { max_iterations: 3, checkpoint: checkpoint(1), ..Options::default() };
    assert_eq!(minimize(&graph, values.clone(), &cut).unwrap().report.iterations, 3);
    // If there is a file, the start values have no effect, and neither has the number of threads.
    let mut elsewhere = values.clone();
    elsewhere.ids().for_each(|id| elsewhere.retract(id, &vec![0.01; elsewhere.dim(id)]));
    let resuming = Options { checkpoint: checkpoint(2), threads: 3, ..Options::default() };
    let resumed = minimize(&graph, elsewhere, &resuming).unwrap();
    assert_eq!(bits(&resumed.values), bits(&whole.values));
    assert_eq!(trace(&resumed.report), trace(&whole.report));
    let error = |options: &Options| minimize(&graph, values.clone(), options).unwrap_err();
    let other = Options { method: Method::GaussNewton, ..resuming.clone() };
    assert!(matches!(error(&other), SolveError::Checkpoint(CheckpointError::Options { .. })));
    fs::write(&path.0, "{}").unwrap();
    assert!(matches!(error(&resuming), SolveError::Checkpoint(CheckpointError::Corrupt { .. })));
    let never = Options { checkpoint: checkpoint(0), ..Options::default() };
    assert!(matches!(error(&never), SolveError::Option { option: "checkpoint.every", .. }));
}

#[test]
fn the_state_of_every_variable_keeps_its_bits() {
    let mut values = Values::new();
    let rotation = UnitQuaternion::from_euler_angles(0.1, -2.0, 0.7);
    values.insert(Vector3::new(0.1, -0.0, 1.0 / 3.0));
    values.insert(DVector::from_vec(vec![1e-300, f64::MAX]));
    values.insert(rotation);
    values.insert(Isometry3::from_parts(Vector3::new(1.0, 2.0, 0.3).into(), rotation));
    values.insert(Unit::new_normalize(Vector3::new(0.3, -0.2, 0.7)));
    for id in values.ids() {
        let mut other = values.clone();
        other.retract(id, &vec![0.1; values.dim(id)]);
        assert_ne!(bits(&other), bits(&values));
        assert!(other.set_state(id, &values.state(id).unwrap()));
        assert_eq!(bits(&other), bits(&values));
        assert!(!other.set_state(id, &[1.0; 11]));
        assert_eq!(bits(&other), bits(&values));
    }
}

fn error(result: Result<(Values, Report), Error>) -> CheckpointError {
    let error = result.map(|(_, report)| report).unwrap_err();
    match error.downcast::<depthcal_solver::SolveError>() {
        Ok(depthcal_solver::SolveError::Checkpoint(error)) => error,
        Ok(other) => panic!("{other}"),
        Err(error) => error.downcast().unwrap(),
    }
}

#[test]
fn damaged_and_foreign_files_are_named() {
    let Bundle { graph, values, .. } = bundle(4, 30, 0.5, Loss::Trivial, 3);
    let path = Scratch::new("foreign");
    let options = Options { threads: 1, max_iterations: 2, ..Options::default() };
    run(&graph, &values, &options, Some(&path)).unwrap();
    let text = fs::read_to_string(&path.0).unwrap();
    let name = path.0.display().to_string();
    let check = |e: CheckpointError, remedy: &str| {
        let message = e.to_string();
        assert!(message.contains(&name) && message.contains(remedy), "{message}");
        e
    };

    for damaged in [&text[..text.len() / 2], "", "{}", "\u{0}\u{1}", "{\"format\": \"x\", \"version\": 1}"] {
        fs::write(&path.0, damaged).unwrap();
        let e = check(error(run(&graph, &values, &options, Some(&path))), "delete the file");
        assert!(matches!(e, CheckpointError::Corrupt { .. }));
    }
    fs::write(&path.0, [0xff, 0xfe, 0x00]).unwrap();
    assert!(matches!(error(run(&graph, &values, &options, Some(&path))), CheckpointError::Corrupt { .. }));
    // Change one digit of one number.
    let digit = text.rfind(|c: char| ('1'..='8').contains(&c)).unwrap();
    let next = (text.as_bytes()[digit] + 1) as char;
    fs::write(&path.0, format!("{}{next}{}", &text[..digit], &text[digit + 1..])).unwrap();
    let e = check(error(run(&graph, &values, &options, Some(&path))), "delete the file");
    assert!(matches!(&e, CheckpointError::Corrupt { reason, .. } if reason.contains("checksum")), "{e}");
    fs::write(&path.0, text.replace("\"version\": 1", "\"version\": 7")).unwrap();
    let e = check(error(run(&graph, &values, &options, Some(&path))), "delete it");
    assert!(matches!(e, CheckpointError::Version { found: 7, .. }));

    fs::write(&path.0, &text).unwrap();
    let others = [bundle(5, 30, 0.5, Loss::Trivial, 3), bundle(4, 30, 0.5, Loss::Trivial, 4)];
    for other in others {
        let e = check(
            error(run(&other.graph, &other.values, &Options { max_iterations: 9, ..options.clone() }, Some(&path))),
            "another file",
        );
        assert!(matches!(e, CheckpointError::Foreign { .. }), "{e}");
    }
    let other = Options { method: Method::GaussNewton, ..options.clone() };
    let e = check(error(run(&graph, &values, &other, Some(&path))), "use the same");
    assert!(matches!(&e, CheckpointError::Options { option, .. } if option == "method"), "{e}");
    assert_eq!(fs::read_to_string(&path.0).unwrap(), text, "a file that does not fit is not overwritten");
}

#[test]
fn a_missing_folder_is_named() {
    let Bundle { graph, values, .. } = bundle(4, 30, 0.5, Loss::Trivial, 3);
    let path = Scratch(std::env::temp_dir().join("no-such-folder-of-depthcal").join("a.json"));
    let e = error(run(&graph, &values, &Options::default(), Some(&path)));
    assert!(matches!(e, CheckpointError::Io { .. }) && e.to_string().contains("no-such-folder"), "{e}");
}

/// A link under the temporary name, as in a folder that others may write into too, is replaced; what it points to is not written.
#[cfg(unix)]
#[test]
fn a_link_is_not_followed() {
    let Bundle { graph, values, .. } = bundle(4, 30, 0.5, Loss::Trivial, 3);
    let (path, victim) = (Scratch::new("link"), Scratch::new("link-victim"));
    let link = Scratch(format!("{}.{}.tmp", path.0.display(), std::process::id()).into());
    fs::remove_file(&link.0).ok();
    fs::write(&victim.0, "theirs").unwrap();
    std::os::unix::fs::symlink(&victim.0, &link.0).unwrap();
    run(&graph, &values, &Options::default(), Some(&path)).unwrap();
    assert_eq!(fs::read_to_string(&victim.0).unwrap(), "theirs");
    assert!(path.0.symlink_metadata().unwrap().is_file() && !link.0.exists());
}

/// A variable without `Variable::state`.
#[derive(Clone, Debug)]
struct Opaque(Vector2<f64>);

impl Variable for Opaque {
    fn dim(&self) -> usize {
        2
    }

    fn retract(&self, delta: &[f64]) -> Self {
        Self(self.0.retract(delta))
    }

    fn local(&self, other: &Self, delta: &mut [f64]) {
        self.0.local(&other.0, delta);
    }
}

#[test]
fn a_variable_without_a_state_is_named() {
    let mut values = Values::new();
    let key = values.insert(Opaque(Vector2::new(3.0, 4.0)));
    let mut graph = Graph::new();
    graph.add_batch(Prior::isotropic("origin", key, Opaque(Vector2::zeros()), 1.0).unwrap());
    let path = Scratch::new("opaque");
    let e = error(run(&graph, &values, &Options::default(), Some(&path)));
    assert!(matches!(e, CheckpointError::Unsupported { .. }));
    assert!(e.to_string().contains("Opaque") && e.to_string().contains("Variable::state"), "{e}");
}
