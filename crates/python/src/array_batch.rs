//! Residuals that a function of Python computes for all of a batch at once, on arrays, as a batch of the solver.
//!
//! The solver asks for the groups one by one, from several threads; the function is called once for all of them, and again when
//! a variable of the group that is asked for has another value. So it is called once per evaluation, however many groups there
//! are.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use depthcal_calibration::progress::ProgressHandle;
use depthcal_solver::{EvaluationError, FactorBatch, Loss, Values, VariableId};
use numpy::{PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::arrays::numbers;
use crate::failure::{Failure, input};
use crate::unwound::raise;

/// Manifold of the variables of a family.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Manifold {
    Vector,
    /// A unit quaternion (w, x, y, z).
    Rotation,
    /// A unit quaternion and a translation.
    Pose,
    /// A unit vector.
    Direction,
}

impl Manifold {
    /// The state of a variable in Python's order: quaternions begin with w there.
    pub fn to_python(self, state: &mut [f64]) {
        if matches!(self, Self::Rotation | Self::Pose) {
            state[..4].rotate_right(1);
        }
    }
}

/// Variables of one kind.
#[derive(Debug, Clone)]
pub(crate) struct Family {
    pub manifold: Manifold,
    pub variables: Vec<VariableId>,
    /// Numbers of a variable.
    pub size: usize,
}

impl Family {
    /// The numbers of all variables, row by row, in the solver's order.
    fn states(&self, values: &Values) -> Vec<f64> {
        self.variables.iter().flat_map(|id| values.state(*id).unwrap_or_default()).collect()
    }

    /// The numbers of all variables in Python's order.
    pub fn array<'py>(&self, py: Python<'py>, values: &Values) -> PyResult<Bound<'py, PyAny>> {
        self.array_of(py, self.states(values))
    }

    fn array_of<'py>(&self, py: Python<'py>, mut states: Vec<f64>) -> PyResult<Bound<'py, PyAny>> {
        states.chunks_exact_mut(self.size.max(1)).for_each(|state| self.manifold.to_python(state));
        Ok(states.to_pyarray(py).reshape([self.variables.len(), self.size])?.into_any())
    }
}

/// Residuals about the same variables.
#[derive(Debug)]
pub(crate) struct Group {
    /// The place of each variable in its family.
    pub places: Vec<usize>,
    pub variables: Vec<VariableId>,
    /// Rows of the function's result.
    pub residuals: Vec<usize>,
}

/// The function's results at some values.
#[derive(Debug)]
pub(crate) struct Known {
    /// The numbers of the variables of each family.
    states: Vec<Vec<f64>>,
    residuals: Vec<f64>,
    jacobian: Option<Vec<f64>>,
}

/// A batch of residuals of `rows` numbers each.
#[derive(Debug)]
pub(crate) struct ArrayBatch {
    pub name: String,
    pub rows: usize,
    /// Tangent dimensions of a residual's variables together.
    pub columns: usize,
    /// Number of residuals.
    pub count: usize,
    pub loss: Loss,
    /// Families of a residual's variables, in order.
    pub families: Vec<Family>,
    pub groups: Vec<Group>,
    /// Called with arrays of all variables by family, and whether derivatives are wanted; returns whitened residuals (count,
    /// rows) and derivatives (count, rows, columns) or None.
    pub function: Py<PyAny>,
    /// Notes Ctrl-C.
    pub progress: ProgressHandle,
    pub known: Mutex<Option<Known>>,
}

/// Parts of an [`ArrayBatch`] besides its function.
pub(crate) struct Layout {
    pub name: String,
    pub rows: usize,
    pub columns: usize,
    pub count: usize,
    pub loss: Loss,
    pub families: Vec<Family>,
    pub groups: Vec<Group>,
}

impl ArrayBatch {
    pub fn new(layout: Layout, function: Py<PyAny>, progress: ProgressHandle) -> Self {
        let Layout { name, rows, columns, count, loss, families, groups } = layout;
        Self { name, rows, columns, count, loss, families, groups, function, progress, known: Mutex::new(None) }
    }

    /// Whether results are those of a group at these values.
    fn holds(&self, known: &Known, group: &Group, values: &Values) -> bool {
        group.variables.iter().enumerate().all(|(i, id)| {
            let size = self.families[i].size;
            let range = group.places[i] * size..(group.places[i] + 1) * size;
            values.state(*id).is_some_and(|state| known.states[i][range] == state[..])
        })
    }

    fn call(&self, values: &Values, with_jacobian: bool) -> PyResult<Known> {
        let states: Vec<Vec<f64>> = self.families.iter().map(|family| family.states(values)).collect();
        Python::attach(|py| {
            let arrays = self.families.iter().zip(&states).map(|(family, states)| family.array_of(py, states.clone()));
            let arrays = PyList::new(py, arrays.collect::<PyResult<Vec<_>>>()?)?;
            let (residuals, jacobian): (Bound<'_, PyAny>, Option<Bound<'_, PyAny>>) =
                self.function.bind(py).call1((arrays, with_jacobian))?.extract()?;
            let numbers_of = |what: &str, given: &Bound<'_, PyAny>, shape: &[usize]| {
                let values = numbers(&format!("residuals '{}': {what}", self.name), given)?;
                if values.shape() != shape {
                    let given = values.shape();
                    return Err(input(format!(
                        "residuals '{}': {what} has the shape {given:?}, not {shape:?}",
                        self.name
                    )));
                }
                Ok::<_, Failure>(values.slice()?.to_vec())
            };
            let residuals = numbers_of("the result", &residuals, &[self.count, self.rows])?;
            let shape = [self.count, self.rows, self.columns];
            let jacobian = jacobian.filter(|_| with_jacobian);
            let jacobian = jacobian.map(|array| numbers_of("the derivative", &array, &shape)).transpose()?;
            Ok(Known { states, residuals, jacobian })
        })
    }

    /// Numbers of one residual in an array with `size` numbers for each.
    fn range(residual: usize, size: usize) -> Range<usize> {
        residual * size..(residual + 1) * size
    }
}

impl FactorBatch for ArrayBatch {
    fn name(&self) -> &str {
        &self.name
    }

    fn group_count(&self) -> usize {
        self.groups.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        &self.groups[group].variables
    }

    fn row_count(&self, group: usize) -> usize {
        self.groups[group].residuals.len() * self.rows
    }

    fn residual_dim(&self) -> usize {
        self.rows
    }

    fn loss(&self) -> Loss {
        self.loss.clone()
    }

    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let group = &self.groups[group];
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let serves =
            |known: &Known| (jacobian.is_none() || known.jacobian.is_some()) && self.holds(known, group, values);
        if !known.as_ref().is_some_and(serves) {
            drop(self.progress.stage("residual functions"));
            // Nothing is known where the function raises an exception.
            *known = None;
            match self.call(values, jacobian.is_some()) {
                Ok(results) => *known = Some(results),
                Err(error) => raise(error),
            }
        }
        let Some(known) = known.as_ref() else { return Err(EvaluationError::new("the function was interrupted")) };
        for (residual, out) in group.residuals.iter().zip(residuals.chunks_exact_mut(self.rows)) {
            out.copy_from_slice(&known.residuals[Self::range(*residual, self.rows)]);
        }
        let mut is_finite = residuals.iter().all(|r| r.is_finite());
        if let (Some(jacobian), Some(derivatives)) = (jacobian, &known.jacobian) {
            let size = self.rows * self.columns;
            for (residual, out) in group.residuals.iter().zip(jacobian.chunks_exact_mut(size)) {
                out.copy_from_slice(&derivatives[Self::range(*residual, size)]);
            }
            is_finite = is_finite && jacobian.iter().all(|d| d.is_finite());
        }
        if is_finite { Ok(()) } else { Err(EvaluationError::new("the function gives numbers that are not finite")) }
    }
}
