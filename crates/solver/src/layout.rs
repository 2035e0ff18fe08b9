//! Which variables are estimated, and where their components lie in the step.

use std::ops::Range;
use std::sync::Arc;

use crate::error::StructureError;
use crate::graph::{FactorBatch, Fixed, Graph};
use crate::loss::Loss;
use crate::values::{Values, VariableId};

/// No index.
pub(crate) const NONE: u32 = u32::MAX;

/// A variable with at least one component that a factor depends on and that may move.
#[derive(Clone, Debug)]
pub(crate) struct Active {
    pub id: VariableId,
    /// All tangent components.
    pub dim: u32,
    /// Components that may move.
    pub free: u32,
    /// Which these are, if not all.
    pub mask: Option<Box<[u32]>>,
    /// Position among the eliminated or among the kept variables.
    pub rank: u32,
    pub eliminated: bool,
    /// First component in the step: eliminated variables first, then kept ones.
    pub offset: usize,
}

/// A group of residuals and its active variables.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    pub batch: u32,
    pub group: u32,
    pub rows: u32,
    /// Columns of the Jacobian that the batch writes.
    pub columns: u32,
    variables: Range<u32>,
}

/// An active variable of a group, with its first column in the Jacobian that the batch writes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub active: u32,
    pub column: u32,
}

/// A batch as the solver sees it.
#[derive(Clone)]
pub(crate) struct BatchInfo {
    pub batch: Arc<dyn FactorBatch>,
    pub loss: Loss,
    pub residual_dim: usize,
}

/// Everything about a problem that stays the same from iteration to iteration.
#[derive(Clone)]
pub(crate) struct Layout {
    pub batches: Vec<Option<BatchInfo>>,
    pub active: Vec<Active>,
    index: Vec<u32>,
    pub groups: Vec<Group>,
    slots: Vec<Slot>,
    /// Active indices of eliminated and of kept variables by rank.
    pub eliminated: Vec<u32>,
    pub kept: Vec<u32>,
    pub eliminated_dim: usize,
    pub kept_dim: usize,
    /// Scalar residuals.
    pub rows: usize,
}

impl Layout {
    /// Collects groups and active variables; none is eliminated yet.
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

    /// Divides the active variables: those listed (sorted active indices) are eliminated.
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

    /// The active variable behind an id.
    pub fn find(&self, id: VariableId) -> Option<&Active> {
        let index = *self.index.get(id.index())?;
        self.active.get(index as usize)
    }

    /// The variable and its tangent component that a component of the step belongs to.
    pub fn component(&self, index: usize) -> Option<(VariableId, usize)> {
        let active = self.active.iter().find(|a| (a.offset..a.offset + a.free as usize).contains(&index))?;
        let place = index - active.offset;
        Some((active.id, active.mask.as_ref().map_or(place, |mask| mask[place] as usize)))
    }

    /// Moves all active variables by the step.
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
        if let Some(lanes) = info.batch.lanes() {
            let columns = variables.iter().map(|id| values.dim(*id)).sum();
            let fits = lanes.pattern().iter().flat_map(|c| c.last()).all(|c| (*c as usize) < columns);
            if !fits || lanes.pattern().len() != residual_dim {
                return Err(StructureError::Pattern { batch: name(), group, columns });
            }
        }
    }
    Ok(())
}
