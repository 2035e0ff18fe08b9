//! Undetermined combinations of variables, as they are reported.

use std::fmt;

use nalgebra::DVector;
use serde::Serialize;

use crate::normal::normal_equations::NormalEquations;
use crate::problem::graph::Graph;
use crate::problem::key::VariableId;

/// A component of a [`NullDirection`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NullComponent {
    /// The variable.
    #[serde(skip)]
    pub variable: VariableId,
    /// The variable's label.
    pub label: String,
    /// Tangent component.
    pub component: usize,
    /// The component's value in the unit vector.
    pub value: f64,
}

/// A combination of variables that the residuals do not determine: a unit vector of the tangent space along which the cost
/// does not change, to second order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NullDirection {
    /// The relevant components, in the order of their influence on the residuals.
    pub components: Vec<NullComponent>,
}

impl fmt::Display for NullDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 6;
        for (i, c) in self.components.iter().take(SHOWN).enumerate() {
            let sign = if c.value < 0.0 { "-" } else { "+" };
            let separator = if i > 0 { " " } else { "" };
            write!(f, "{separator}{sign}{:.3e} {}[{}]", c.value.abs(), c.label, c.component)?;
        }
        match self.components.len().checked_sub(SHOWN) {
            None | Some(0) => Ok(()),
            Some(more) => write!(f, " and {more} more"),
        }
    }
}

/// A null vector in terms of variables; negligible components are left out.
pub(crate) fn name_direction(graph: &Graph, system: &NormalEquations, vector: &DVector<f64>) -> NullDirection {
    // The influence of each component alone on the residuals. If none has any, their size counts.
    let weight = |i: usize| vector[i].abs() * system.diagonal()[i].sqrt();
    let largest = (0..vector.len()).map(weight).fold(0.0, f64::max);
    let size = vector.amax();
    let mut components = Vec::new();
    for active in &system.layout.active {
        for k in 0..active.free as usize {
            let i = active.offset + k;
            let relevant = if largest > 0.0 { weight(i) > 1e-4 * largest } else { vector[i].abs() > 1e-4 * size };
            if relevant {
                let component = active.mask.as_ref().map_or(k, |m| m[k] as usize);
                let label = graph.label_of(active.id);
                components.push((weight(i), NullComponent { variable: active.id, label, component, value: vector[i] }));
            }
        }
    }
    components.sort_by(|a, b| b.0.total_cmp(&a.0));
    NullDirection { components: components.into_iter().map(|c| c.1).collect() }
}
