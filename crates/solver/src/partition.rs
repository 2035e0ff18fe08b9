//! Choice of the variables that a Schur complement eliminates.

use crate::error::StructureError;
use crate::graph::Graph;
use crate::layout::Layout;
use crate::ordering::eliminate_flops;
use crate::values::Values;

/// Floating-point operations of a Cholesky factorisation of a dense matrix.
pub(crate) fn dense_flops(n: usize) -> f64 {
    let n = n as f64;
    n * n * n / 3.0
}

/// Variables to eliminate.
#[derive(Debug)]
pub(crate) struct Class {
    /// Active indices, sorted.
    pub members: Vec<u32>,
    /// Operations of their elimination.
    pub elimination_flops: f64,
    /// Operations of a product of the Schur complement, left as it is, with a vector.
    pub product_flops: f64,
    /// Components that remain.
    pub kept_dim: usize,
}

/// The variables to eliminate: those that the graph names, or else the class of variables whose elimination makes the linear
/// system cheapest. Nothing where a Schur complement does not pay.
pub(crate) fn choose(
    graph: &Graph,
    values: &Values,
    layout: &Layout,
    groups_of: &GroupsByVariable,
) -> Result<Option<Class>, StructureError> {
    if !graph.forced_elimination().is_empty() {
        let members = forced(graph, layout)?;
        return Ok((!members.is_empty()).then(|| class(layout, groups_of, members)));
    }
    let mut classes: Vec<(u32, Vec<u32>)> = Vec::new();
    for (a, active) in layout.active.iter().enumerate() {
        let class = values.class(active.id);
        match classes.iter_mut().find(|(c, _)| *c == class) {
            Some((_, members)) => members.push(a as u32),
            None => classes.push((class, vec![a as u32])),
        }
    }
    let mut best = None;
    let mut least = dense_flops(layout.dim());
    for (_, members) in classes {
        let independent = independent(layout, groups_of, &members);
        // A chain of poses, of which every other one is independent, is better left to a sparse factorisation.
        if independent.len() * 10 < members.len() * 9 {
            continue;
        }
        let class = class(layout, groups_of, independent);
        let flops = class.elimination_flops + dense_flops(class.kept_dim);
        if flops < least {
            least = flops;
            best = Some(class);
        }
    }
    Ok(best)
}

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

/// For every active variable its groups, as a compressed list.
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

/// A maximal subset of `members` of which no two share a group, those with few groups first.
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
fn class(layout: &Layout, groups_of: &GroupsByVariable, members: Vec<u32>) -> Class {
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
    Class { members, elimination_flops: flops, product_flops: products, kept_dim }
}
