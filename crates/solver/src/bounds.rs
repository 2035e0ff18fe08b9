//! Bounds on components of variables, held by projected steps with an active set (Bertsekas 1982).

use crate::error::StructureError;
use crate::graph::Graph;
use crate::layout::Layout;
use crate::values::{Values, VariableId};

/// A component that has bounds and may move.
#[derive(Clone, Copy, Debug)]
struct Bounded {
    variable: VariableId,
    component: usize,
    lower: f64,
    upper: f64,
    /// In the step.
    index: usize,
}

impl Bounded {
    /// Where a step from `x` would cross a bound, the step that ends there, and a rounding error beyond: so the projection
    /// onto the bounds that follows puts it on the bound exactly.
    fn room(&self, x: f64, step: f64) -> Option<f64> {
        let bound = if step < 0.0 { self.lower } else { self.upper };
        let crosses = (x + step - bound) * step.signum() > 0.0;
        let beyond = 4.0 * f64::EPSILON * (x.abs() + bound.abs());
        (step != 0.0 && crosses).then(|| bound - x + beyond.copysign(step))
    }
}

/// All of them, in the order of the variables.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bounds(Vec<Bounded>);

impl Bounds {
    /// Looks up where bounded components are in the step.
    pub fn new(graph: &Graph, values: &Values, layout: &Layout) -> Result<Self, StructureError> {
        let mut bounds = Vec::new();
        for (&(variable, component), &(lower, upper)) in graph.bounds() {
            let error = |reason| StructureError::Bound { variable: graph.label_of(variable), component, reason };
            if !(lower <= upper) {
                return Err(error(format!("the lower bound {lower} is not below the upper bound {upper}")));
            }
            if !values.contains(variable) || component >= values.dim(variable) {
                return Err(error("there is no such component".to_owned()));
            }
            if values.coordinate(variable, component).is_none() {
                let type_name = values.type_name(variable);
                return Err(error(format!("it is no coordinate of {type_name}: see Variable::coordinate")));
            }
            let Some(active) = layout.find(variable) else { continue };
            let place = match &active.mask {
                None => Some(component),
                Some(mask) => mask.iter().position(|m| *m as usize == component),
            };
            if let Some(place) = place {
                bounds.push(Bounded { variable, component, lower, upper, index: active.offset + place });
            }
        }
        Ok(Self(bounds))
    }

    fn coordinate(values: &Values, b: &Bounded) -> f64 {
        values.coordinate(b.variable, b.component).unwrap_or(f64::NAN)
    }

    /// The components at a bound that a direction would lead across.
    fn outwards<'a>(
        &'a self,
        values: &'a Values,
        direction: impl Fn(usize) -> f64 + 'a,
    ) -> impl Iterator<Item = &'a Bounded> {
        self.0.iter().filter(move |b| {
            let (x, d) = (Self::coordinate(values, b), direction(b.index));
            x <= b.lower && d < 0.0 || x >= b.upper && d > 0.0
        })
    }

    /// Marks the places in the step of those components at a bound that a direction would lead across. Returns whether
    /// there are any.
    pub fn mark_outwards(&self, values: &Values, direction: impl Fn(usize) -> f64, held: &mut [bool]) -> bool {
        let mut any = false;
        for b in self.outwards(values, direction) {
            held[b.index] = true;
            any = true;
        }
        any
    }

    /// The variables and components at a bound that the negative gradient would lead across.
    pub fn active(&self, values: &Values, gradient: &[f64]) -> Vec<(VariableId, usize)> {
        self.outwards(values, |i| -gradient[i]).map(|b| (b.variable, b.component)).collect()
    }

    /// Shortens components of a step that would cross a bound. Returns whether there were any.
    pub fn clip(&self, values: &Values, step: &mut [f64]) -> bool {
        let mut any = false;
        for b in &self.0 {
            let (x, s) = (Self::coordinate(values, b), step[b.index]);
            if let Some(room) = b.room(x, s) {
                step[b.index] = room;
                any = true;
            }
        }
        any
    }

    /// Shortens a step as a whole so that it ends on the first bound that it would cross.
    pub fn shorten(&self, values: &Values, step: &mut [f64]) {
        let share = |b: &Bounded, room: f64| room / step[b.index];
        let crossed = self.0.iter().filter_map(|b| Some((b, b.room(Self::coordinate(values, b), step[b.index])?)));
        let first = crossed.min_by(|(b, x), (c, y)| share(b, *x).total_cmp(&share(c, *y)));
        if let Some((b, room)) = first {
            let share = share(b, room);
            step.iter_mut().for_each(|s| *s *= share);
            step[b.index] = room;
        }
    }

    /// Moves what lies outside of its bounds onto them.
    pub fn project(&self, values: &mut Values) {
        for b in &self.0 {
            let x = Self::coordinate(values, b);
            let projected = x.max(b.lower).min(b.upper);
            if projected != x {
                values.set_coordinate(b.variable, b.component, projected);
            }
        }
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
