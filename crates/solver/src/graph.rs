//! The factor graph: residuals and which variables they are about.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use crate::batch::Batch;
use crate::error::{EvaluationError, EvaluationFailure};
use crate::factor::{Factor, VariableTuple};
use crate::lanes::LaneAccess;
use crate::loss::Loss;
use crate::part::Part;
use crate::values::{Values, VariableId};

/// Residuals that are computed alike.
///
/// A batch is divided into groups. All residuals of a group depend on the same tuple of variables, for instance all points
/// of a frame on its pose and the camera; the solver evaluates and accumulates a group at once and calls a batch from
/// several threads. [`Batch`] makes one from factors with automatic derivatives.
pub trait FactorBatch: Send + Sync {
    /// Name for reports and errors.
    fn name(&self) -> &str;

    /// Number of groups.
    fn group_count(&self) -> usize;

    /// The variables of a group, each at most once. They may not change while the batch is in a graph.
    fn variables(&self, group: usize) -> &[VariableId];

    /// Number of scalar residuals of a group, a multiple of [`residual_dim`](Self::residual_dim).
    fn row_count(&self, group: usize) -> usize;

    /// Rows per residual; the loss acts on s = ‖r‖² of each.
    fn residual_dim(&self) -> usize {
        1
    }

    /// The loss of every residual.
    fn loss(&self) -> Loss {
        Loss::Trivial
    }

    /// Writes the whitened residuals of a group and, where asked for, their Jacobian: row-major, `row_count` rows, Σ
    /// dim(variables) columns in the order of [`variables`](Self::variables), with respect to tangent vectors at δ = 0.
    /// Both are to be written completely; their former content is undefined.
    ///
    /// # Errors
    /// If the residuals do not exist at these values. The solver then rejects the step that led there.
    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError>;

    /// Access to residuals in lanes, if the batch has them: see [`Lanes`](crate::Lanes).
    fn lanes(&self) -> Option<&dyn LaneAccess> {
        None
    }
}

/// Names a batch of a [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BatchId(usize);

/// A nonlinear least-squares problem: minimise ½ Σ ρ(‖r(x)‖²) over the variables x.
///
/// A clone shares the batches.
#[derive(Clone, Default)]
pub struct Graph {
    batches: Vec<Option<Arc<dyn FactorBatch>>>,
    fixed: BTreeMap<VariableId, Fixed>,
    labels: Labels,
    eliminated: Vec<VariableId>,
    bounds: BTreeMap<(VariableId, usize), (f64, f64)>,
}

/// Names of variables.
pub(crate) type Labels = Arc<BTreeMap<VariableId, String>>;

/// The variable's name, by default its number.
pub(crate) fn label(labels: &Labels, id: VariableId) -> String {
    labels.get(&id).cloned().unwrap_or_else(|| format!("variable {}", id.0))
}

/// Which components of a variable stay as they are.
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

    /// Adds a batch that is shared with others.
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

    /// Takes a batch out of the problem. Returns whether it was there.
    pub fn remove_batch(&mut self, batch: BatchId) -> bool {
        self.batches.get_mut(batch.0).is_some_and(|slot| slot.take().is_some())
    }

    /// Takes groups of a batch out of the problem: those for which `keep` is false. The others are numbered anew. Returns
    /// how many are gone.
    pub fn retain_groups(&mut self, batch: BatchId, mut keep: impl FnMut(usize, &dyn FactorBatch) -> bool) -> usize {
        let Some(Some(slot)) = self.batches.get_mut(batch.0) else { return 0 };
        let before = slot.group_count();
        let whole = Arc::clone(slot);
        if let Some(part) = Part::new(&whole, |group| keep(group, whole.as_ref())) {
            *slot = Arc::new(part);
        }
        before - slot.group_count()
    }

    /// Takes a variable out of the problem with all groups of residuals about it, and with its bounds. Its value stays where
    /// it is, without any effect. Returns how many groups are gone.
    pub fn remove_variable(&mut self, variable: impl Into<VariableId>) -> usize {
        let id = variable.into();
        self.fixed.remove(&id);
        self.bounds.retain(|(bounded, _), _| *bounded != id);
        self.eliminated.retain(|e| *e != id);
        let batches: Vec<BatchId> = self.batches().map(|(batch, _)| batch).collect();
        batches.into_iter().map(|b| self.retain_groups(b, |g, batch| !batch.variables(g).contains(&id))).sum()
    }

    /// The batch, if it has not been removed.
    pub fn batch(&self, batch: BatchId) -> Option<&dyn FactorBatch> {
        self.batches.get(batch.0)?.as_deref()
    }

    /// All batches, in the order in which they were added.
    pub fn batches(&self) -> impl Iterator<Item = (BatchId, &dyn FactorBatch)> {
        self.batches.iter().enumerate().filter_map(|(i, b)| Some((BatchId(i), b.as_deref()?)))
    }

    /// Keeps a variable at its value.
    pub fn fix(&mut self, variable: impl Into<VariableId>) {
        self.fixed.insert(variable.into(), Fixed::All);
    }

    /// Keeps those tangent components of a variable at zero where the mask is true; it has one entry per component.
    pub fn fix_partly(&mut self, variable: impl Into<VariableId>, mask: &[bool]) {
        self.fixed.insert(variable.into(), Fixed::Mask(mask.to_vec()));
    }

    /// Lets a variable move in all its components.
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

    /// Keeps a component of a variable within `lower` ≤ x ≤ `upper`, which may be infinite; it replaces former bounds.
    ///
    /// The component has to be a [coordinate](crate::Variable::coordinate): of a vector, or of a pose's translation. Steps
    /// are projected: what would cross a bound stops on it, and in an iteration that starts on a bound with the cost
    /// falling outwards the component is held. A start outside is moved onto the bound. To a
    /// [`Covariance`](crate::Covariance) such an active bound is a fixed component. A fixed component stays as it is.
    pub fn bound(&mut self, variable: impl Into<VariableId>, component: usize, lower: f64, upper: f64) {
        self.bounds.insert((variable.into(), component), (lower, upper));
    }

    /// Takes the bounds off a component. Returns whether it had some.
    pub fn unbound(&mut self, variable: impl Into<VariableId>, component: usize) -> bool {
        self.bounds.remove(&(variable.into(), component)).is_some()
    }

    /// Gives a variable a name for reports and errors.
    pub fn label(&mut self, variable: impl Into<VariableId>, label: impl Into<String>) {
        Arc::make_mut(&mut self.labels).insert(variable.into(), label.into());
    }

    /// The variable's name, by default its number.
    pub fn label_of(&self, variable: impl Into<VariableId>) -> String {
        label(&self.labels, variable.into())
    }

    pub(crate) fn labels(&self) -> Labels {
        Arc::clone(&self.labels)
    }

    /// Forces the group of variables that a Schur complement eliminates; no two of them may share a factor. By default
    /// the solver chooses by estimated cost. An empty group restores that.
    pub fn eliminate(&mut self, variables: impl IntoIterator<Item = impl Into<VariableId>>) {
        self.eliminated = variables.into_iter().map(Into::into).collect();
        self.eliminated.sort_unstable();
        self.eliminated.dedup();
    }

    /// The whitened residuals of a batch, group after group, not weighted by the loss.
    ///
    /// # Errors
    /// If the batch cannot be evaluated at these values. An unknown batch has no residuals.
    pub fn residuals(&self, batch: BatchId, values: &Values) -> Result<Vec<f64>, EvaluationFailure> {
        let Some(batch) = self.batch(batch) else { return Ok(Vec::new()) };
        let rows = (0..batch.group_count()).map(|g| batch.row_count(g)).sum();
        let mut residuals = vec![0.0; rows];
        let mut rest = residuals.as_mut_slice();
        for group in 0..batch.group_count() {
            let (head, tail) = rest.split_at_mut(batch.row_count(group));
            batch.evaluate(group, values, head, None).map_err(|source| EvaluationFailure {
                batch: batch.name().to_owned(),
                group,
                source,
            })?;
            rest = tail;
        }
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

/// The last part of a type's path, without generic parameters.
fn short_name<F>() -> &'static str {
    let path = std::any::type_name::<F>();
    let path = path.split('<').next().unwrap_or(path);
    path.rsplit("::").next().unwrap_or(path)
}
