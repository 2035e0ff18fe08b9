//! The solver for problems whose residuals are functions of Python.

use std::collections::BTreeMap;

use depthcal_calibration::progress::ProgressHandle;
use depthcal_solver::{
    Covariance, CovarianceError, CovarianceOptions, Graph, LinearSolver, Loss, Method, Options, Report, SolveError,
    Values, VariableId, minimize,
};
use nalgebra::{DVector, Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use numpy::{IntoPyArray, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::argument;
use crate::array_batch::{ArrayBatch, Family, Group, Layout, Manifold};
use crate::failure::{Failure, input};
use crate::request::json;
use crate::running::run;

/// A problem that was solved.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Solved {
    graph: Graph,
    values: Values,
    families: Vec<Family>,
    report: Report,
}

impl From<CovarianceError> for Failure {
    fn from(error: CovarianceError) -> Self {
        match error {
            CovarianceError::RankDeficient { .. } | CovarianceError::Eigenvalues => Self::Untrusted(error.to_string()),
            other => input(other),
        }
    }
}

/// Tangent dimension and numbers of a variable.
fn sizes(manifold: Manifold, columns: usize) -> Result<(usize, usize), Failure> {
    let (dim, size) = match manifold {
        Manifold::Vector => (columns, columns),
        Manifold::Rotation => (3, 4),
        Manifold::Pose => (6, 7),
        Manifold::Direction => (2, 3),
    };
    if size == columns && size > 0 {
        Ok((dim, size))
    } else {
        Err(input(format!("variables have {columns} numbers, not {size}")))
    }
}

/// Adds a variable with these numbers, in Python's order.
fn insert(values: &mut Values, manifold: Manifold, state: &[f64]) -> VariableId {
    let rotation = |q: &[f64]| UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
    match manifold {
        Manifold::Vector => values.insert(DVector::from_column_slice(state)).id(),
        Manifold::Rotation => values.insert(rotation(state)).id(),
        Manifold::Pose => {
            let translation = Translation3::new(state[4], state[5], state[6]);
            values.insert(Isometry3::from_parts(translation, rotation(state))).id()
        }
        Manifold::Direction => values.insert(Unit::new_normalize(Vector3::from_column_slice(state))).id(),
    }
}

/// A family as it is given: name, kind, numbers.
type GivenFamily<'py> = (String, String, PyReadonlyArray2<'py, f64>);

fn family_of(values: &mut Values, graph: &mut Graph, given: &GivenFamily<'_>) -> Result<(Family, usize), Failure> {
    let (name, kind, numbers) = given;
    let manifold = match kind.as_str() {
        "rotation" => Manifold::Rotation,
        "pose" => Manifold::Pose,
        "direction" => Manifold::Direction,
        _ => Manifold::Vector,
    };
    let numbers = numbers.as_array();
    let (dim, size) = sizes(manifold, numbers.ncols()).map_err(|e| input(format!("{name}: {}", words(&e))))?;
    let mut variables = Vec::with_capacity(numbers.nrows());
    for (row, state) in numbers.rows().into_iter().enumerate() {
        let state: Vec<f64> = state.iter().copied().collect();
        if state.iter().any(|x| !x.is_finite()) {
            return Err(input(format!("{name}[{row}] is {state:?}: give finite numbers")));
        }
        let unit = match manifold {
            Manifold::Vector => 1.0,
            Manifold::Rotation | Manifold::Pose => state[..4].iter().map(|x| x * x).sum(),
            Manifold::Direction => state.iter().map(|x| x * x).sum(),
        };
        if !(unit > 0.0) {
            return Err(input(format!("{name}[{row}] is {state:?}: a quaternion or direction has a length above 0")));
        }
        let id = insert(values, manifold, &state);
        graph.label(id, format!("{name}[{row}]"));
        variables.push(id);
    }
    Ok((Family { manifold, variables, size }, dim))
}

fn words(failure: &Failure) -> String {
    match failure {
        Failure::Input(text) | Failure::Untrusted(text) => text.clone(),
        Failure::Python(error) => error.to_string(),
    }
}

/// The loss of a name and its scale.
fn loss_of(name: &str, scale: f64, alpha: f64) -> Result<Loss, Failure> {
    match name {
        "trivial" => Ok(Loss::Trivial),
        "huber" => Ok(Loss::Huber { delta: scale }),
        "cauchy" => Ok(Loss::Cauchy { scale }),
        "tukey" => Ok(Loss::Tukey { scale }),
        "geman-mcclure" => Ok(Loss::GemanMcClure { scale }),
        "barron" => Ok(Loss::Barron { alpha, scale }),
        other => {
            Err(input(format!("loss '{other}' is unknown; known are huber, cauchy, tukey, geman-mcclure, barron")))
        }
    }
}

/// A batch of residuals as it is given: `name`, `rows`, `families`, `indices` (count, variables), `loss`, `function`.
fn batch_of(
    given: &Bound<'_, PyDict>,
    families: &[(Family, usize)],
    progress: &ProgressHandle,
) -> PyResult<ArrayBatch> {
    let name: String = argument(given, "name")?;
    let members: Vec<usize> = argument(given, "families")?;
    let indices = given.as_any().get_item("indices")?;
    let indices = indices.extract::<PyReadonlyArray2<'_, i64>>()?;
    let indices = indices.as_array();
    let mut groups: BTreeMap<Vec<usize>, Vec<usize>> = BTreeMap::new();
    for (residual, row) in indices.rows().into_iter().enumerate() {
        let mut places = Vec::with_capacity(members.len());
        for (index, member) in row.iter().zip(&members) {
            let known = families[*member].0.variables.len();
            let place = usize::try_from(*index).ok().filter(|place| *place < known);
            let wrong = || {
                input(format!("residuals '{name}': index {index} of residual {residual}: there are {known} variables"))
            };
            places.push(place.ok_or_else(wrong)?);
        }
        groups.entry(places).or_default().push(residual);
    }
    let id = |places: &[usize], i: usize| families[members[i]].0.variables[places[i]];
    let group = |(places, residuals): (Vec<usize>, Vec<usize>)| Group {
        variables: (0..members.len()).map(|i| id(&places, i)).collect(),
        places,
        residuals,
    };
    let (loss, scale, alpha): (String, f64, f64) = argument(given, "loss")?;
    let layout = Layout {
        name,
        rows: argument(given, "rows")?,
        columns: members.iter().map(|member| families[*member].1).sum(),
        count: indices.nrows(),
        loss: loss_of(&loss, scale, alpha)?,
        families: members.iter().map(|member| families[*member].0.clone()).collect(),
        groups: groups.into_iter().map(group).collect(),
    };
    Ok(ArrayBatch::new(layout, argument(given, "function")?, progress.clone()))
}

fn options_of(given: &Bound<'_, PyDict>) -> PyResult<Options> {
    let method = match argument::<String>(given, "method")?.as_str() {
        "levenberg-marquardt" => Method::LevenbergMarquardt,
        "gauss-newton" => Method::GaussNewton,
        "dog-leg" => Method::DogLeg { radius: 1e4 },
        other => {
            let known = "levenberg-marquardt, gauss-newton, dog-leg";
            return Err(input(format!("method '{other}' is unknown; known are {known}")).into());
        }
    };
    let linear_solver = match argument::<String>(given, "linear_solver")?.as_str() {
        "auto" => LinearSolver::Auto,
        "dense" => LinearSolver::Dense,
        "sparse-cholesky" => LinearSolver::SparseCholesky,
        "dense-schur" => LinearSolver::DenseSchur,
        "sparse-schur" => LinearSolver::SparseSchur,
        "sparse-qr" => LinearSolver::SparseQr,
        other => {
            let known = "auto, dense, sparse-cholesky, dense-schur, sparse-schur, sparse-qr";
            return Err(input(format!("linear_solver '{other}' is unknown; known are {known}")).into());
        }
    };
    Ok(Options {
        max_iterations: argument(given, "max_iterations")?,
        gradient_tolerance: argument(given, "gradient_tolerance")?,
        cost_tolerance: argument(given, "cost_tolerance")?,
        parameter_tolerance: argument(given, "parameter_tolerance")?,
        method,
        linear_solver,
        ..Options::default()
    })
}

/// A variable by its family and its place.
type Reference = (usize, usize);

/// Minimises the residuals of `batches` over `families`. `fixed` are variables with the components that are held, all where none
/// are named; `bounds` are lower and upper limits of components.
#[pyfunction]
pub(crate) fn solve(
    py: Python<'_>,
    families: Vec<GivenFamily<'_>>,
    batches: Vec<Bound<'_, PyDict>>,
    fixed: Vec<(Reference, Option<Vec<bool>>)>,
    bounds: Vec<(Reference, usize, f64, f64)>,
    options: &Bound<'_, PyDict>,
) -> PyResult<Solved> {
    let (mut values, mut graph) = (Values::new(), Graph::new());
    let made: Vec<(Family, usize)> =
        families.iter().map(|family| family_of(&mut values, &mut graph, family)).collect::<Result<_, _>>()?;
    let id = |(family, place): Reference| made[family].0.variables[place];
    for (variable, components) in fixed {
        match components {
            None => graph.fix(id(variable)),
            Some(mask) => graph.fix_partly(id(variable), &mask),
        }
    }
    for (variable, component, low, high) in bounds {
        graph.bound(id(variable), component, low, high);
    }
    let options = options_of(options)?;
    let batches: Vec<ArrayBatch> =
        batches.iter().map(|batch| batch_of(batch, &made, &ProgressHandle::default())).collect::<PyResult<_>>()?;
    run(py, None, move |progress| {
        for batch in batches {
            graph.add_batch(ArrayBatch { progress: progress.clone(), ..batch });
        }
        let solution = minimize(&graph, values, &options).map_err(|error: SolveError| input(error))?;
        let families = made.into_iter().map(|(family, _)| family).collect();
        Ok(Solved { graph, values: solution.values, families, report: solution.report })
    })
}

#[pymethods]
impl Solved {
    /// The numbers of all variables of a family.
    fn values<'py>(&self, py: Python<'py>, family: usize) -> PyResult<Bound<'py, PyAny>> {
        self.families[family].array(py, &self.values)
    }

    /// The report as JSON, and in words.
    fn report(&self) -> PyResult<(String, String, String)> {
        Ok((json(&self.report)?, self.report.termination.to_string(), self.report.to_string()))
    }

    /// Joint covariance of some variables, in the tangent spaces at the solution.
    fn covariance<'py>(&self, py: Python<'py>, variables: Vec<Reference>) -> PyResult<Bound<'py, PyAny>> {
        let ids: Vec<VariableId> = variables.iter().map(|(f, place)| self.families[*f].variables[*place]).collect();
        let joint = run(py, None, |_| {
            let covariance = Covariance::selected(&self.graph, &self.values, &ids, &CovarianceOptions::default())?;
            Ok(covariance.joint(&ids))
        })?;
        // Symmetric, so that its order does not matter.
        let n = joint.nrows();
        Ok(joint.as_slice().to_vec().into_pyarray(py).reshape([n, n])?.into_any())
    }

    /// Standard deviations of all variables of a family, one row of tangent components for each.
    fn standard_deviations<'py>(&self, py: Python<'py>, family: usize) -> PyResult<Bound<'py, PyAny>> {
        let variables = &self.families[family].variables;
        let rows = run(py, None, |_| {
            let covariance = Covariance::marginals(&self.graph, &self.values, &CovarianceOptions::default())?;
            let of_variable = |id: &VariableId| covariance.standard_deviations(*id).as_slice().to_vec();
            Ok(variables.iter().flat_map(of_variable).collect::<Vec<f64>>())
        })?;
        let n = variables.len();
        let columns = rows.len() / n.max(1);
        Ok(rows.into_pyarray(py).reshape([n, columns])?.into_any())
    }
}
