//! Partition of the variables into those that a Schur complement eliminates and those that it keeps.

use crate::plan::layout::Layout;
use crate::plan::ordering::eliminate_flops;
use crate::problem::error::StructureError;
use crate::problem::graph::Graph;
use crate::problem::values::Values;

/// Floating-point operations of a Cholesky factorisation of a dense n × n matrix.
pub(crate) fn dense_flops(n: usize) -> f64 {
    let n = n as f64;
    n * n * n / 3.0
}

/// A set of variables to eliminate, and the work of their elimination.
#[derive(Debug)]
pub(crate) struct EliminationSet {
    /// Indices of active variables, sorted.
    pub members: Vec<u32>,
    /// Floating-point operations of their elimination.
    pub elimination_flops: f64,
    /// Floating-point operations of a product of the Schur complement with a vector, without forming the complement.
    pub product_flops: f64,
    /// Number of components that are kept.
    pub kept_dim: usize,
}

/// The variables to eliminate: those that the graph prescribes, or else the variables of that type whose elimination
/// makes the linear system cheapest. `None` if no Schur complement is cheaper than a dense factorisation of the whole
/// system.
pub(crate) fn choose(
    graph: &Graph,
    values: &Values,
    layout: &Layout,
    groups_of: &GroupsByVariable,
) -> Result<Option<EliminationSet>, StructureError> {
    if !graph.forced_elimination().is_empty() {
        let members = forced(graph, layout)?;
        return Ok((!members.is_empty()).then(|| elimination_set(layout, groups_of, members)));
    }
    let mut by_type: Vec<(u32, Vec<u32>)> = Vec::new();
    for (a, active) in layout.active.iter().enumerate() {
        let type_index = values.type_index(active.id);
        match by_type.iter_mut().find(|(t, _)| *t == type_index) {
            Some((_, members)) => members.push(a as u32),
            None => by_type.push((type_index, vec![a as u32])),
        }
    }
    let mut best = None;
    let mut least = dense_flops(layout.dim());
    for (_, members) in by_type {
        let independent = independent(layout, groups_of, &members);
        // Of a chain of poses only every other one is independent: a sparse factorisation is better.
        if independent.len() * 10 < members.len() * 9 {
            continue;
        }
        let set = elimination_set(layout, groups_of, independent);
        let flops = set.elimination_flops + dense_flops(set.kept_dim);
        if flops < least {
            least = flops;
            best = Some(set);
        }
    }
    Ok(best)
}

/// The variables that the graph prescribes, if no two of them share a factor.
fn forced(graph: &Graph, layout: &Layout) -> Result<Vec<u32>, StructureError> {
    let mut chosen = vec![false; layout.active.len()];
    for (a, active) in layout.active.iter().enumerate() {
        chosen[a] = graph.forced_elimination().binary_search(&active.id).is_ok();
    }
    for group in &layout.groups {
        let mut members = layout.slots(group).iter().filter(|s| chosen[s.active as usize]);
        if let (Some(first), Some(second)) = (members.next(), members.next()) {
            let label = |a: u32| graph.label_of(layout.active[a as usize].id);
            let batch = layout.batches[group.batch as usize].as_ref().map_or("", |b| b.batch.name()).to_owned();
            return Err(StructureError::Elimination {
                batch,
                first: label(first.active),
                second: label(second.active),
            });
        }
    }
    Ok((0..chosen.len() as u32).filter(|a| chosen[*a as usize]).collect())
}

/// For every active variable the groups that depend on it, as compressed rows.
pub(crate) struct GroupsByVariable {
    start: Vec<u32>,
    groups: Vec<u32>,
}

impl GroupsByVariable {
    pub fn of(&self, active: u32) -> &[u32] {
        &self.groups[self.start[active as usize] as usize..self.start[active as usize + 1] as usize]
    }
}

pub(crate) fn groups_by_variable(layout: &Layout) -> GroupsByVariable {
    let mut start = vec![0_u32; layout.active.len() + 1];
    for group in &layout.groups {
        for slot in layout.slots(group) {
            start[slot.active as usize + 1] += 1;
        }
    }
    for a in 0..layout.active.len() {
        start[a + 1] += start[a];
    }
    let mut next = start.clone();
    let mut groups = vec![0; start[layout.active.len()] as usize];
    for (g, group) in layout.groups.iter().enumerate() {
        for slot in layout.slots(group) {
            groups[next[slot.active as usize] as usize] = g as u32;
            next[slot.active as usize] += 1;
        }
    }
    GroupsByVariable { start, groups }
}

/// A maximal subset of `members` of which no two share a group. Greedy, from the variables with the fewest groups on.
fn independent(layout: &Layout, groups_of: &GroupsByVariable, members: &[u32]) -> Vec<u32> {
    let mut order = members.to_vec();
    order.sort_by_key(|a| (groups_of.of(*a).len(), *a));
    let mut taken = vec![false; layout.groups.len()];
    let mut chosen: Vec<u32> = order
        .into_iter()
        .filter(|a| {
            let free = groups_of.of(*a).iter().all(|g| !taken[*g as usize]);
            if free {
                groups_of.of(*a).iter().for_each(|g| taken[*g as usize] = true);
            }
            free
        })
        .collect();
    chosen.sort_unstable();
    chosen
}

/// Counts the operations of eliminating these variables.
fn elimination_set(layout: &Layout, groups_of: &GroupsByVariable, members: Vec<u32>) -> EliminationSet {
    let mut seen = vec![u32::MAX; layout.active.len()];
    let (mut flops, mut products) = (0.0, 0.0);
    let mut removed = 0;
    for e in &members {
        let d = layout.active[*e as usize].free;
        removed += d as usize;
        seen[*e as usize] = *e;
        let mut width = 0;
        for g in groups_of.of(*e) {
            for slot in layout.slots(&layout.groups[*g as usize]) {
                if seen[slot.active as usize] != *e {
                    seen[slot.active as usize] = *e;
                    width += layout.active[slot.active as usize].free;
                }
            }
        }
        flops += eliminate_flops(d, width);
        products += 2.0 * f64::from(d) * f64::from(d + 2 * width);
    }
    let kept_dim = layout.dim() - removed;
    EliminationSet { members, elimination_flops: flops, product_flops: products, kept_dim }
}
