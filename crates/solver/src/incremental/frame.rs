//! A frame: its factors, linearised and reduced onto the shared variables.

use nalgebra::{DMatrix, DVector};

use crate::incremental::error::IncrementalError;
use crate::normal::normal_equations::NormalEquations;
use crate::plan::linear_solver::LinearSolver;
use crate::problem::error::EvaluationFailure;
use crate::problem::graph::Graph;
use crate::problem::key::VariableId;
use crate::problem::values::Values;

/// Pivot, relative to the diagonal of H, up to which a component is undetermined.
const SMALLEST_PIVOT: f64 = 1e-13;

/// A shared variable of a frame.
#[derive(Clone, Copy, Debug)]
struct Shared {
    id: VariableId,
    /// First component among all shared ones.
    first: usize,
}

/// The factors of a frame as a quadratic function of the shared variables, minimised over the frame's own ones.
///
/// With e the own and c the shared components, both relative to the point of linearisation, the cost is
/// ½ [e c 1] A [e c 1]ᵀ, A = [H_ee H_ec g_e; · H_cc g_c; · · 2 F]. The first steps of its Cholesky factorisation, one for each
/// own component, leave the function of c in the lower right corner.
pub(super) struct Frame {
    pub id: u64,
    /// The point of linearisation: shared variables, then own ones.
    values: Values,
    /// Memory for trials.
    trial: Values,
    system: NormalEquations,
    /// Component of the step of each own component, then of each shared one; and the inverse of this permutation.
    order: Vec<usize>,
    rows: Vec<usize>,
    own: usize,
    shared: Vec<Shared>,
    /// For each shared component of `order` its place among all shared ones.
    places: Vec<usize>,
    /// A; the lower triangle is valid.
    quadratic: DMatrix<f64>,
    /// A after elimination: L and L⁻¹ [H_ec g_e] in the first columns, the reduced A in the corner.
    reduced: DMatrix<f64>,
    /// Damping at the last elimination.
    mu: f64,
    /// How far the shared components have moved since the linearisation, in the order of `places`; and in the present trial.
    moved: DVector<f64>,
    trial_moved: DVector<f64>,
    /// The own step that belongs to a move, and the tangent vector of one shared variable.
    step: Vec<f64>,
    delta: Vec<f64>,
    /// Cost at the present values, and at the trial.
    pub cost: f64,
    pub trial_cost: f64,
    /// Whether the present trial is to be evaluated and linearised.
    pub flagged: bool,
}

impl Frame {
    /// A frame whose variables from `own_from` on are its own. `firsts` has the first component of each shared variable.
    pub fn new(
        id: u64,
        graph: &Graph,
        values: Values,
        own_from: usize,
        firsts: &[usize],
    ) -> Result<Self, IncrementalError> {
        if !graph.bounds().is_empty() {
            return Err(IncrementalError::Bounds);
        }
        let system = NormalEquations::new(graph, &values, LinearSolver::Dense, false)?;
        let (mut order, mut of_shared, mut places, mut shared) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for active in &system.layout.active {
            let components = active.offset..active.offset + active.free as usize;
            if active.id.index() >= own_from {
                order.extend(components);
                continue;
            }
            let first = firsts[active.id.index()];
            let component = |i: usize| active.mask.as_ref().map_or(i, |mask| mask[i] as usize);
            places.extend((0..active.free as usize).map(|i| first + component(i)));
            of_shared.extend(components);
            shared.push(Shared { id: active.id, first });
        }
        let (n, count) = (order.len() + of_shared.len() + 1, places.len());
        let own_count = order.len();
        order.extend(of_shared);
        let mut rows = vec![0; order.len()];
        order.iter().enumerate().for_each(|(row, component)| rows[*component] = row);
        let longest = shared.iter().map(|s| values.dim(s.id)).max().unwrap_or(0);
        let mut frame = Self {
            id,
            trial: values.clone(),
            values,
            step: vec![0.0; system.dim()],
            delta: vec![0.0; longest],
            rows,
            system,
            order,
            own: own_count,
            shared,
            places,
            quadratic: DMatrix::zeros(n, n),
            reduced: DMatrix::zeros(n, n),
            mu: 0.0,
            moved: DVector::zeros(count),
            trial_moved: DVector::zeros(count),
            cost: 0.0,
            trial_cost: 0.0,
            flagged: false,
        };
        frame.linearize()?;
        if frame.eliminate(0.0) { Ok(frame) } else { Err(IncrementalError::Undetermined) }
    }

    /// Linearises at the frame's values, and forgets that the shared variables have moved.
    pub fn linearize(&mut self) -> Result<(), EvaluationFailure> {
        self.cost = self.system.linearize(&self.values)?;
        let n = self.order.len();
        self.system.blocks.write_dense(&self.rows, &mut self.quadratic);
        for (row, component) in self.order.iter().enumerate() {
            self.quadratic[(n, row)] = self.system.gradient()[*component];
        }
        self.quadratic[(n, n)] = 2.0 * self.cost;
        self.moved.fill(0.0);
        // No elimination is valid.
        self.mu = f64::NAN;
        Ok(())
    }

    /// Reduces onto the shared variables, with H_ee + μ diag H_ee; false if that is not positive definite.
    pub fn eliminate(&mut self, mu: f64) -> bool {
        if self.mu == mu {
            return true;
        }
        self.reduced.copy_from(&self.quadratic);
        let (a, n) = (&mut self.reduced, self.order.len() + 1);
        for k in 0..self.own {
            let diagonal = self.quadratic[(k, k)];
            let pivot = a[(k, k)] + mu * diagonal;
            if !(pivot > SMALLEST_PIVOT * diagonal && pivot.is_finite()) {
                return false;
            }
            let root = pivot.sqrt();
            a[(k, k)] = root;
            (k + 1..n).for_each(|i| a[(i, k)] /= root);
            for j in k + 1..n {
                let factor = a[(j, k)];
                (j..n).for_each(|i| a[(i, j)] -= a[(i, k)] * factor);
            }
        }
        self.mu = mu;
        true
    }

    /// Adds the reduced Hessian and gradient at the present move to those of all shared components, and the diagonal of H_cc to
    /// `scale`.
    pub fn add_to(&self, hessian: &mut DMatrix<f64>, gradient: &mut DVector<f64>, scale: &mut DVector<f64>) {
        let last = self.order.len();
        for (i, place) in self.places.iter().enumerate() {
            scale[*place] += self.quadratic[(self.own + i, self.own + i)];
            let mut g = self.reduced[(last, self.own + i)];
            for (j, other) in self.places.iter().enumerate() {
                let h = self.reduced[(self.own + i.max(j), self.own + i.min(j))];
                hessian[(*place, *other)] += h;
                g += h * self.moved[j];
            }
            gradient[*place] += g;
        }
    }

    /// The cost that the linearised frame has after the shared components have moved, minimised over its own variables.
    pub fn predicted(&self, trial: bool) -> f64 {
        let moved = if trial { &self.trial_moved } else { &self.moved };
        let (last, split) = (self.order.len(), self.own);
        let mut sum = 0.5 * self.reduced[(last, last)];
        for i in 0..moved.len() {
            let row: f64 = (0..i).map(|j| self.reduced[(split + i, split + j)] * moved[j]).sum();
            sum += moved[i]
                * (self.reduced[(last, split + i)] + row + 0.5 * self.reduced[(split + i, split + i)] * moved[i]);
        }
        sum
    }

    /// Notes where a trial moves the shared variables. Returns cᵀ Σ c for that move c and the Hessian `information` of all shared
    /// components, and the mean square by which it would change the frame's residuals if its own variables did not follow.
    pub fn plan(&mut self, shared: &Values, information: &DMatrix<f64>) -> (f64, f64) {
        let mut row = 0;
        for variable in &self.shared {
            let delta = &mut self.delta[..shared.dim(variable.id)];
            self.values.local(variable.id, shared, delta);
            let components = variable.first..variable.first + delta.len();
            while self.places.get(row).is_some_and(|place| components.contains(place)) {
                self.trial_moved[row] = delta[self.places[row] - variable.first];
                row += 1;
            }
        }
        let c = &self.trial_moved;
        let (mut together, mut alone) = (0.0, 0.0);
        for i in 0..c.len() {
            for j in 0..c.len() {
                together += c[i] * information[(self.places[i], self.places[j])] * c[j];
                alone += c[i] * self.quadratic[(self.own + i.max(j), self.own + i.min(j))] * c[j];
            }
        }
        (together, alone / self.system.layout.rows.max(1) as f64)
    }

    /// Writes the frame's variables after a move into `trial`: shared ones from `shared`, own ones as the linearised frame has
    /// them follow.
    fn follow(&mut self, shared: &Values, trial: bool) {
        let moved = if trial { &self.trial_moved } else { &self.moved };
        if !self.trial.overwrite(&self.values) {
            self.trial = self.values.clone();
        }
        let (last, split) = (self.order.len(), self.own);
        self.step.fill(0.0);
        for k in (0..split).rev() {
            let a = &self.reduced;
            let mut x = -a[(last, k)];
            x -= (0..moved.len()).map(|j| a[(split + j, k)] * moved[j]).sum::<f64>();
            x -= (k + 1..split).map(|i| a[(i, k)] * self.step[self.order[i]]).sum::<f64>();
            self.step[self.order[k]] = x / a[(k, k)];
        }
        self.system.retract(&mut self.trial, &self.step);
        for variable in &self.shared {
            self.trial.copy_variable(variable.id, shared);
        }
    }

    /// Evaluates the cost of the planned trial; infinite if that cannot be done.
    pub fn try_move(&mut self, shared: &Values) {
        self.follow(shared, true);
        self.trial_cost = self.system.cost(&self.trial).ok().filter(|c| c.is_finite()).unwrap_or(f64::INFINITY);
    }

    /// Takes the planned trial: linearises there if the frame is flagged, and else only notes the move.
    pub fn accept(&mut self) -> Result<(), EvaluationFailure> {
        if !self.flagged {
            self.moved.copy_from(&self.trial_moved);
            return Ok(());
        }
        std::mem::swap(&mut self.values, &mut self.trial);
        self.linearize()
    }

    /// Linearises at the present values, where the shared ones are `shared`, unless the frame is linearised there.
    pub fn relinearize(&mut self, shared: &Values) -> Result<(), EvaluationFailure> {
        if self.moved.iter().all(|m| *m == 0.0) {
            return Ok(());
        }
        // The factor has to be the undamped one.
        if self.eliminate(0.0) {
            self.follow(shared, false);
            std::mem::swap(&mut self.values, &mut self.trial);
        }
        self.linearize()
    }

    /// The present values of the frame, where the shared ones are `shared`.
    pub fn values(&mut self, shared: &Values) -> Values {
        if self.eliminate(0.0) && self.moved.iter().any(|m| *m != 0.0) {
            self.follow(shared, false);
            return self.trial.clone();
        }
        self.values.clone()
    }
}
