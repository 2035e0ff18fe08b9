//! The components that move, and where they lie in the step.

use std::ops::Range;
use std::sync::Arc;

use crate::problem::error::StructureError;
use crate::problem::factor_batch::FactorBatch;
use crate::problem::graph::{Fixed, Graph};
use crate::problem::key::VariableId;
use crate::problem::loss::Loss;
use crate::problem::values::Values;

/// No index.
pub(crate) const NONE: u32 = u32::MAX;

/// A variable that is estimated: a factor depends on it, and at least one of its components is free.
#[derive(Clone, Debug)]
pub(crate) struct Active {
    pub id: VariableId,
    /// Number of tangent components.
    pub dim: u32,
    /// Number of free components.
    pub free: u32,
    /// The free components, unless all are.
    pub mask: Option<Box<[u32]>>,
    /// Position among the eliminated or among the kept variables, whichever it belongs to.
    pub rank: u32,
    pub eliminated: bool,
    /// Index of the first free component in the step, where eliminated variables come before kept ones.
    pub offset: usize,
}

/// A group of residuals and its active variables.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    pub batch: u32,
    pub group: u32,
    pub rows: u32,
    /// Columns of the Jacobian that the batch writes, fixed components included.
    pub columns: u32,
    variables: Range<u32>,
}

/// An active variable of a group, with its first column in the Jacobian that the batch writes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub active: u32,
    pub column: u32,
}

/// A batch, with its properties that the solver reads only once.
#[derive(Clone)]
pub(crate) struct BatchInfo {
    pub batch: Arc<dyn FactorBatch>,
    pub loss: Loss,
    pub residual_dim: usize,
}

/// The groups of residuals, the active variables, and their partition into eliminated and kept ones.
#[derive(Clone)]
pub(crate) struct Layout {
    pub batches: Vec<Option<BatchInfo>>,
    pub active: Vec<Active>,
    index: Vec<u32>,
    pub groups: Vec<Group>,
    slots: Vec<Slot>,
    /// Indices in `active` of the eliminated and of the kept variables, by rank.
    pub eliminated: Vec<u32>,
    pub kept: Vec<u32>,
    pub eliminated_dim: usize,
    pub kept_dim: usize,
    /// Number of scalar residuals.
    pub rows: usize,
}

impl Layout {
    /// Collects groups and active variables. All are kept until [`partition`](Self::partition) is called.
    pub fn new(graph: &Graph, values: &Values) -> Result<Self, StructureError> {
        let mut layout = Layout {
            batches: Vec::with_capacity(graph.slots().len()),
            active: Vec::new(),
            index: vec![NONE; values.len()],
            groups: Vec::new(),
            slots: Vec::new(),
            eliminated: Vec::new(),
            kept: Vec::new(),
            eliminated_dim: 0,
            kept_dim: 0,
            rows: 0,
        };
        let mut used = vec![false; values.len()];
        for slot in graph.slots() {
            let info = slot.as_ref().map(|batch| BatchInfo {
                batch: Arc::clone(batch),
                loss: batch.loss(),
                residual_dim: batch.residual_dim().max(1),
            });
            if let Some(info) = &info {
                check_batch(graph, values, info, &mut used)?;
            }
            layout.batches.push(info);
        }
        for id in values.ids().filter(|id| used[id.index()]) {
            let dim = values.dim(id);
            let mask: Option<Box<[u32]>> = match graph.fixed(id) {
                None => None,
                Some(Fixed::All) => continue,
                Some(Fixed::Mask(mask)) if mask.len() != dim => {
                    let variable = graph.label_of(id);
                    return Err(StructureError::MaskLength { variable, dim, mask: mask.len() });
                }
                Some(Fixed::Mask(mask)) if !mask.contains(&true) => None,
                Some(Fixed::Mask(mask)) => Some((0..dim as u32).filter(|i| !mask[*i as usize]).collect()),
            };
            let free = mask.as_ref().map_or(dim, |m| m.len()) as u32;
            if free > 0 {
                layout.index[id.index()] = layout.active.len() as u32;
                layout.active.push(Active { id, dim: dim as u32, free, mask, rank: 0, eliminated: false, offset: 0 });
            }
        }
        layout.collect_groups(values);
        layout.partition(&[]);
        Ok(layout)
    }

    fn collect_groups(&mut self, values: &Values) {
        let count = self.batches.iter().flatten().map(|b| b.batch.group_count()).sum();
        self.groups.reserve(count);
        for (b, info) in self.batches.iter().enumerate() {
            let Some(info) = info else { continue };
            for group in 0..info.batch.group_count() {
                let rows = info.batch.row_count(group);
                if rows == 0 {
                    continue;
                }
                let start = self.slots.len() as u32;
                let mut column = 0;
                for id in info.batch.variables(group) {
                    let active = self.index[id.index()];
                    if active != NONE {
                        self.slots.push(Slot { active, column });
                    }
                    column += values.dim(*id) as u32;
                }
                self.rows += rows;
                self.groups.push(Group {
                    batch: b as u32,
                    group: group as u32,
                    rows: rows as u32,
                    columns: column,
                    variables: start..self.slots.len() as u32,
                });
            }
        }
    }

    /// Partitions the active variables: those listed, as sorted indices in `active`, are eliminated.
    pub fn partition(&mut self, eliminated: &[u32]) {
        self.eliminated = eliminated.to_vec();
        for a in &mut self.active {
            a.eliminated = false;
        }
        for a in eliminated {
            self.active[*a as usize].eliminated = true;
        }
        self.kept = (0..self.active.len() as u32).filter(|a| !self.active[*a as usize].eliminated).collect();
        let mut offset = 0;
        for list in [&self.eliminated, &self.kept] {
            for (rank, a) in list.iter().enumerate() {
                let active = &mut self.active[*a as usize];
                active.rank = rank as u32;
                active.offset = offset;
                offset += active.free as usize;
            }
        }
        self.eliminated_dim = self.eliminated.iter().map(|a| self.active[*a as usize].free as usize).sum();
        self.kept_dim = offset - self.eliminated_dim;
    }

    /// Length of the step.
    pub fn dim(&self) -> usize {
        self.eliminated_dim + self.kept_dim
    }

    /// The active variables of a group.
    pub fn slots(&self, group: &Group) -> &[Slot] {
        &self.slots[group.variables.start as usize..group.variables.end as usize]
    }

    /// The active variable with this id.
    pub fn find(&self, id: VariableId) -> Option<&Active> {
        let index = *self.index.get(id.index())?;
        self.active.get(index as usize)
    }

    /// The variable and the tangent component to which a component of the step belongs.
    pub fn component(&self, index: usize) -> Option<(VariableId, usize)> {
        let active = self.active.iter().find(|a| (a.offset..a.offset + a.free as usize).contains(&index))?;
        let place = index - active.offset;
        Some((active.id, active.mask.as_ref().map_or(place, |mask| mask[place] as usize)))
    }

    /// Retracts all active variables by the step.
    pub fn retract(&self, values: &mut Values, step: &[f64], scratch: &mut Vec<f64>) {
        for a in &self.active {
            let free = &step[a.offset..a.offset + a.free as usize];
            match &a.mask {
                None => values.retract(a.id, free),
                Some(mask) => {
                    scratch.clear();
                    scratch.resize(a.dim as usize, 0.0);
                    for (i, d) in mask.iter().zip(free) {
                        scratch[*i as usize] = *d;
                    }
                    values.retract(a.id, scratch);
                }
            }
        }
    }
}

/// Checks that a batch fits the values, and marks the variables it uses.
fn check_batch(graph: &Graph, values: &Values, info: &BatchInfo, used: &mut [bool]) -> Result<(), StructureError> {
    let name = || info.batch.name().to_owned();
    if let Some(reason) = info.loss.invalid() {
        return Err(StructureError::Loss { batch: name(), reason });
    }
    for group in 0..info.batch.group_count() {
        let (rows, residual_dim) = (info.batch.row_count(group), info.residual_dim);
        if rows % residual_dim != 0 {
            return Err(StructureError::RowCount { batch: name(), group, rows, residual_dim });
        }
        let variables = info.batch.variables(group);
        for (i, id) in variables.iter().enumerate() {
            if !values.contains(*id) {
                return Err(StructureError::UnknownVariable { batch: name(), group, variable: *id });
            }
            if variables[..i].contains(id) {
                let variable = graph.label_of(*id);
                return Err(StructureError::DuplicateVariable { batch: name(), group, variable });
            }
            used[id.index()] = true;
        }
    }
    Ok(())
}
