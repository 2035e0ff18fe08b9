//! Bounded components and their place in the step; projection of steps onto the bounds with an active set (Bertsekas 1982).

use crate::plan::layout::Layout;
use crate::problem::error::StructureError;
use crate::problem::graph::Graph;
use crate::problem::key::VariableId;
use crate::problem::values::Values;

/// A free component with bounds.
#[derive(Clone, Copy, Debug)]
struct Bounded {
    variable: VariableId,
    component: usize,
    lower: f64,
    upper: f64,
    /// Index in the step.
    index: usize,
}

impl Bounded {
    /// The step from `x` to the bound, if `step` would cross it. It overshoots by a rounding error, so that the
    /// projection onto the bounds that follows ends on the bound exactly.
    fn step_to_bound(&self, x: f64, step: f64) -> Option<f64> {
        let bound = if step < 0.0 { self.lower } else { self.upper };
        let crosses = (x + step - bound) * step.signum() > 0.0;
        let beyond = 4.0 * f64::EPSILON * (x.abs() + bound.abs());
        (step != 0.0 && crosses).then(|| bound - x + beyond.copysign(step))
    }
}

/// All bounded free components, in the order of the variables.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bounds(Vec<Bounded>);

impl Bounds {
    /// Checks the bounds of the graph and looks up where their components lie in the step.
    pub fn new(graph: &Graph, values: &Values, layout: &Layout) -> Result<Self, StructureError> {
        let mut bounds = Vec::new();
        for (&(variable, component), &(lower, upper)) in graph.bounds() {
            let error = |reason| StructureError::Bound { variable: graph.label_of(variable), component, reason };
            if !(lower <= upper) {
                return Err(error(format!("the lower bound {lower} exceeds the upper bound {upper}")));
            }
            if !values.contains(variable) || component >= values.dim(variable) {
                return Err(error("there is no such component".to_owned()));
            }
            if values.coordinate(variable, component).is_none() {
                let type_name = values.type_name(variable);
                return Err(error(format!(
                    "{type_name} has no coordinate for this component: see Variable::coordinate"
                )));
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

    /// The components on a bound that a direction leads across.
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

    /// Marks in `active`, indexed like the step, the components on a bound that a direction leads across. Returns whether
    /// there are any.
    pub fn mark_outwards(&self, values: &Values, direction: impl Fn(usize) -> f64, active: &mut [bool]) -> bool {
        let mut any = false;
        for b in self.outwards(values, direction) {
            active[b.index] = true;
            any = true;
        }
        any
    }

    /// The active set: variables and components on a bound that the negative gradient leads across.
    pub fn active(&self, values: &Values, gradient: &[f64]) -> Vec<(VariableId, usize)> {
        self.outwards(values, |i| -gradient[i]).map(|b| (b.variable, b.component)).collect()
    }

    /// Shortens each component of a step that would cross a bound. Returns whether there were any.
    pub fn clip(&self, values: &Values, step: &mut [f64]) -> bool {
        let mut any = false;
        for b in &self.0 {
            let (x, s) = (Self::coordinate(values, b), step[b.index]);
            if let Some(shortened) = b.step_to_bound(x, s) {
                step[b.index] = shortened;
                any = true;
            }
        }
        any
    }

    /// Scales a whole step so that it ends on the first bound that it would cross.
    pub fn shorten(&self, values: &Values, step: &mut [f64]) {
        let fraction = |b: &Bounded, shortened: f64| shortened / step[b.index];
        let to_bound = |b: &Bounded| b.step_to_bound(Self::coordinate(values, b), step[b.index]);
        let crossed = self.0.iter().filter_map(|b| Some((b, to_bound(b)?)));
        let first = crossed.min_by(|(b, x), (c, y)| fraction(b, *x).total_cmp(&fraction(c, *y)));
        if let Some((b, shortened)) = first {
            let fraction = fraction(b, shortened);
            step.iter_mut().for_each(|s| *s *= fraction);
            step[b.index] = shortened;
        }
    }

    /// Moves components outside of their bounds onto them.
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
