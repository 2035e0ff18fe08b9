//! The factor graph: batches of factors, fixed and bounded variables.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use rayon::prelude::*;

use crate::problem::batch::Batch;
use crate::problem::error::EvaluationFailure;
use crate::problem::factor::{Factor, VariableTuple};
use crate::problem::factor_batch::FactorBatch;
use crate::problem::group_subset::GroupSubset;
use crate::problem::key::VariableId;
use crate::problem::labels::{Labels, label};
use crate::problem::values::Values;

/// Scalar residuals from which on a thread of its own pays.
const ROWS_OF_A_TASK: usize = 512;

/// Identifies a batch of a [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BatchId(usize);

/// A nonlinear least-squares problem: minimise ½ Σ ρ(‖r(x)‖²) over the variables x.
///
/// Clones share the batches.
#[derive(Clone, Default)]
pub struct Graph {
    batches: Vec<Option<Arc<dyn FactorBatch>>>,
    fixed: BTreeMap<VariableId, Fixed>,
    labels: Labels,
    eliminated: Vec<VariableId>,
    bounds: BTreeMap<(VariableId, usize), (f64, f64)>,
}

/// The fixed components of a variable.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Fixed {
    All,
    Mask(Vec<bool>),
}

impl fmt::Debug for Graph {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = self.batches().map(|(_, b)| b.name()).collect();
        f.debug_struct("Graph").field("batches", &names).field("fixed", &self.fixed).finish_non_exhaustive()
    }
}

impl Graph {
    /// No factors.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a batch of factors.
    pub fn add_batch(&mut self, batch: impl FactorBatch + 'static) -> BatchId {
        self.add_shared_batch(Arc::new(batch))
    }

    /// Adds a batch that other graphs share.
    pub fn add_shared_batch(&mut self, batch: Arc<dyn FactorBatch>) -> BatchId {
        self.batches.push(Some(batch));
        BatchId(self.batches.len() - 1)
    }

    /// Adds a single factor with unit noise and trivial loss. For many of one kind, fill a [`Batch`].
    pub fn add<F: Factor<M>, const M: usize>(
        &mut self,
        factor: F,
        keys: <F::Variables as VariableTuple>::Keys,
    ) -> BatchId {
        let mut batch = Batch::new(short_name::<F>());
        batch.push(factor, keys);
        self.add_batch(batch)
    }

    /// Removes a batch. Returns whether the graph had it.
    pub fn remove_batch(&mut self, batch: BatchId) -> bool {
        self.batches.get_mut(batch.0).is_some_and(|slot| slot.take().is_some())
    }

    /// Removes those groups of a batch for which `keep` returns false; the remaining ones are renumbered. Returns the
    /// number of groups removed.
    pub fn retain_groups(&mut self, batch: BatchId, mut keep: impl FnMut(usize, &dyn FactorBatch) -> bool) -> usize {
        let Some(Some(slot)) = self.batches.get_mut(batch.0) else { return 0 };
        let before = slot.group_count();
        let whole = Arc::clone(slot);
        if let Some(subset) = GroupSubset::new(&whole, |group| keep(group, whole.as_ref())) {
            *slot = Arc::new(subset);
        }
        before - slot.group_count()
    }

    /// Removes a variable from the problem, together with its bounds and with all groups that depend on it. Its entry in
    /// [`Values`] remains, without effect. Returns the number of groups removed.
    pub fn remove_variable(&mut self, variable: impl Into<VariableId>) -> usize {
        let id = variable.into();
        self.fixed.remove(&id);
        self.bounds.retain(|(bounded, _), _| *bounded != id);
        self.eliminated.retain(|e| *e != id);
        let batches: Vec<BatchId> = self.batches().map(|(batch, _)| batch).collect();
        batches.into_iter().map(|b| self.retain_groups(b, |g, batch| !batch.variables(g).contains(&id))).sum()
    }

    /// The batch, unless it has been removed.
    pub fn batch(&self, batch: BatchId) -> Option<&dyn FactorBatch> {
        self.batches.get(batch.0)?.as_deref()
    }

    /// All batches in the order in which they were added.
    pub fn batches(&self) -> impl Iterator<Item = (BatchId, &dyn FactorBatch)> {
        self.batches.iter().enumerate().filter_map(|(i, b)| Some((BatchId(i), b.as_deref()?)))
    }

    /// Fixes all components of a variable: it keeps its value.
    pub fn fix(&mut self, variable: impl Into<VariableId>) {
        self.fixed.insert(variable.into(), Fixed::All);
    }

    /// Fixes the tangent components of a variable for which `mask` is true. It has one entry per component and replaces what
    /// was fixed before.
    pub fn fix_partly(&mut self, variable: impl Into<VariableId>, mask: &[bool]) {
        self.fixed.insert(variable.into(), Fixed::Mask(mask.to_vec()));
    }

    /// Frees all components of a variable.
    pub fn unfix(&mut self, variable: impl Into<VariableId>) {
        self.fixed.remove(&variable.into());
    }

    /// Whether all components of a variable are fixed.
    pub fn is_fixed(&self, variable: impl Into<VariableId>) -> bool {
        match self.fixed.get(&variable.into()) {
            Some(Fixed::All) => true,
            Some(Fixed::Mask(mask)) => mask.iter().all(|m| *m),
            None => false,
        }
    }

    /// Bounds a component of a variable, `lower` ≤ x ≤ `upper`, and replaces its former bounds. Either may be infinite.
    ///
    /// The component must have a [coordinate](crate::Variable::coordinate): an element of a vector, or of a pose's
    /// translation. A start value outside is moved onto the bound. Steps are projected onto the bounds. A component that is
    /// on a bound at the start of an iteration, with the cost falling outwards, is *active*: it does not move in this
    /// iteration (Bertsekas 1982). In a [`Covariance`](crate::Covariance) active components count as fixed. Bounds on a
    /// fixed component have no effect.
    pub fn bound(&mut self, variable: impl Into<VariableId>, component: usize, lower: f64, upper: f64) {
        self.bounds.insert((variable.into(), component), (lower, upper));
    }

    /// Removes the bounds of a component. Returns whether it had any.
    pub fn unbound(&mut self, variable: impl Into<VariableId>, component: usize) -> bool {
        self.bounds.remove(&(variable.into(), component)).is_some()
    }

    /// Labels a variable, for reports and errors.
    pub fn label(&mut self, variable: impl Into<VariableId>, label: impl Into<String>) {
        Arc::make_mut(&mut self.labels).insert(variable.into(), label.into());
    }

    /// The variable's label, by default its number.
    pub fn label_of(&self, variable: impl Into<VariableId>) -> String {
        label(&self.labels, variable.into())
    }

    pub(crate) fn labels(&self) -> Labels {
        Arc::clone(&self.labels)
    }

    /// Prescribes the variables that a Schur complement eliminates; no two of them may share a factor. By default, and
    /// after a call with no variables, the solver chooses them by estimated cost.
    pub fn eliminate(&mut self, variables: impl IntoIterator<Item = impl Into<VariableId>>) {
        self.eliminated = variables.into_iter().map(Into::into).collect();
        self.eliminated.sort_unstable();
        self.eliminated.dedup();
    }

    /// The whitened residuals of a batch, group after group, without the weights of its loss.
    ///
    /// # Errors
    /// If the batch cannot be evaluated at these values. A batch that is not in the graph has no residuals.
    pub fn residuals(&self, batch: BatchId, values: &Values) -> Result<Vec<f64>, EvaluationFailure> {
        let Some(batch) = self.batch(batch) else { return Ok(Vec::new()) };
        let rows: usize = (0..batch.group_count()).map(|g| batch.row_count(g)).sum();
        let mut residuals = vec![0.0; rows];
        let mut unassigned = residuals.as_mut_slice();
        let mut groups = Vec::with_capacity(batch.group_count());
        for group in 0..batch.group_count() {
            let (rows, tail) = unassigned.split_at_mut(batch.row_count(group));
            groups.push(rows);
            unassigned = tail;
        }
        let evaluate = |(group, rows): (usize, &mut [f64])| {
            let failed = |source| EvaluationFailure { batch: batch.name().to_owned(), group, source };
            batch.evaluate(group, values, rows, None).map_err(failed)
        };
        let groups_of_a_task = (ROWS_OF_A_TASK * groups.len()).div_ceil(rows.max(1)).max(1);
        groups.into_par_iter().enumerate().with_min_len(groups_of_a_task).try_for_each(evaluate)?;
        Ok(residuals)
    }

    /// The cost ½ Σ ρ(‖r‖²) of one batch.
    ///
    /// # Errors
    /// If the batch cannot be evaluated at these values.
    pub fn batch_cost(&self, batch: BatchId, values: &Values) -> Result<f64, EvaluationFailure> {
        let residuals = self.residuals(batch, values)?;
        let Some(batch) = self.batch(batch) else { return Ok(0.0) };
        let loss = batch.loss();
        let squares = residuals.chunks(batch.residual_dim().max(1)).map(|r| r.iter().map(|x| x * x).sum());
        Ok(squares.map(|s: f64| 0.5 * loss.evaluate(s)[0]).sum())
    }

    /// The cost ½ Σ ρ(‖r‖²) of the whole problem.
    ///
    /// # Errors
    /// If a batch cannot be evaluated at these values.
    pub fn cost(&self, values: &Values) -> Result<f64, EvaluationFailure> {
        (0..self.batches.len()).map(|i| self.batch_cost(BatchId(i), values)).sum()
    }

    pub(crate) fn bounds(&self) -> &BTreeMap<(VariableId, usize), (f64, f64)> {
        &self.bounds
    }

    /// Fixes one more component of a variable of dimension `dim`.
    pub(crate) fn fix_component(&mut self, variable: VariableId, component: usize, dim: usize) {
        let fixed = self.fixed.entry(variable).or_insert_with(|| Fixed::Mask(vec![false; dim]));
        if let Fixed::Mask(mask) = fixed
            && let Some(entry) = mask.get_mut(component)
        {
            *entry = true;
        }
    }

    pub(crate) fn fixed(&self, id: VariableId) -> Option<&Fixed> {
        self.fixed.get(&id)
    }

    pub(crate) fn forced_elimination(&self) -> &[VariableId] {
        &self.eliminated
    }

    pub(crate) fn slots(&self) -> &[Option<Arc<dyn FactorBatch>>] {
        &self.batches
    }
}

/// The last segment of a type's path, without generic parameters.
fn short_name<F>() -> &'static str {
    let path = std::any::type_name::<F>();
    let path = path.split('<').next().unwrap_or(path);
    path.rsplit("::").next().unwrap_or(path)
}
