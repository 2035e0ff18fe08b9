//! Choice of the linear solver by estimated cost.

use std::collections::HashSet;

use crate::error::StructureError;
use crate::graph::Graph;
use crate::layout::Layout;
use crate::options::{Estimate, LinearSolver, Preconditioner};
use crate::ordering::{BlockGraph, Ordering};
use crate::partition::{self, GroupsByVariable, dense_flops, groups_by_variable};
use crate::values::Values;

/// Size up to which a system is dense without further thought.
pub(crate) const DENSE_SIZE: usize = 400;

/// Cost of an operation relative to one of a dense factorisation: in the elimination of small blocks, in a sparse
/// factorisation, and in products with a vector, which memory limits.
const ELIMINATION: f64 = 2.0;
const SPARSE: f64 = 3.0;
const PRODUCT: f64 = 8.0;

/// Links between kept variables beyond which a Schur complement is not analysed as a sparse matrix.
const MAX_LINKS: f64 = 1e8;

/// Entries of a factor beyond which it is not formed: conjugate gradients need no more memory than the Jacobian.
const MAX_ENTRIES: f64 = 4e9;

/// How the linear systems are solved.
#[derive(Debug)]
pub(crate) struct Choice {
    /// Anything but [`LinearSolver::Auto`].
    pub solver: LinearSolver,
    /// Active variables to eliminate by a Schur complement, sorted.
    pub eliminated: Vec<u32>,
    /// The kept variables' order of elimination, where it was looked for.
    pub ordering: Option<Ordering>,
    pub estimates: Vec<Estimate>,
    /// The graph that was looked at.
    pub graph: Option<BlockGraph>,
    /// Whether an order was looked for.
    pub analysed: bool,
}

/// Chooses; none of the variables of `layout` is eliminated yet. A `previous` graph that has all links stands for its order.
pub(crate) fn choose(
    graph: &Graph,
    values: &Values,
    layout: &Layout,
    wanted: LinearSolver,
    previous: Option<(&BlockGraph, &[Estimate])>,
) -> Result<Choice, StructureError> {
    let forced = |solver, eliminated| Choice {
        solver,
        eliminated,
        ordering: None,
        estimates: Vec::new(),
        graph: None,
        analysed: false,
    };
    match wanted {
        LinearSolver::Auto => {}
        LinearSolver::Dense | LinearSolver::SparseCholesky | LinearSolver::SparseQr => {
            return Ok(forced(wanted, Vec::new()));
        }
        _ => {
            let groups_of = groups_by_variable(layout);
            let class = partition::choose(graph, values, layout, &groups_of)?;
            return Ok(forced(wanted, class.map_or_else(Vec::new, |c| c.members)));
        }
    }
    let n = layout.dim();
    let groups_of = groups_by_variable(layout);
    let class = partition::choose(graph, values, layout, &groups_of)?;
    let must_eliminate = !graph.forced_elimination().is_empty();
    let mut estimates = Vec::new();
    let mut estimate = |solver, cost| estimates.push(Estimate { solver, cost });
    let (mut looked_at, mut ordering) = (None, None);
    // The cost of a sparse factorisation.
    let mut analyse = |graph: BlockGraph, solver, elimination: f64| {
        if let Some((other, estimates)) = previous
            && let Some(estimate) = estimates.iter().find(|e| e.solver == solver)
            && other.covers(&graph)
        {
            looked_at = Some(other.clone());
            return Ok(estimate.cost);
        }
        let found = graph.analyse()?;
        let cost = elimination + SPARSE * found.flops;
        (looked_at, ordering) = (Some(graph), Some(found));
        Ok::<f64, StructureError>(cost)
    };
    if !must_eliminate {
        estimate(LinearSolver::Dense, dense_cost(n));
    }
    if let Some(class) = &class {
        let elimination = ELIMINATION * class.elimination_flops;
        let kept = class.kept_dim;
        estimate(LinearSolver::DenseSchur, elimination + dense_cost(kept));
        // What is left is small enough to be of no account, or else an order of its variables is looked for.
        if kept > DENSE_SIZE && dense_flops(kept) > 0.1 * elimination {
            if let Some(links) = reduced_graph(layout, &groups_of, &class.members) {
                estimate(LinearSolver::SparseSchur, analyse(links, LinearSolver::SparseSchur, elimination)?);
            }
            let preconditioner = Preconditioner::SchurJacobi;
            let products = iterations(layout.active.len() - class.members.len()) * class.product_flops;
            estimate(LinearSolver::ConjugateGradients(preconditioner), elimination + PRODUCT * products);
        }
    } else if n > DENSE_SIZE {
        estimate(LinearSolver::SparseCholesky, analyse(whole_graph(layout), LinearSolver::SparseCholesky, 0.0)?);
    }
    let best = estimates.iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
    let solver = best.map_or(LinearSolver::Dense, |e| e.solver);
    let eliminates = !matches!(solver, LinearSolver::Dense | LinearSolver::SparseCholesky);
    let eliminated = class.filter(|_| eliminates).map_or_else(Vec::new, |c| c.members);
    let sparse = matches!(solver, LinearSolver::SparseCholesky | LinearSolver::SparseSchur);
    let analysed = ordering.is_some();
    Ok(Choice { solver, eliminated, ordering: ordering.filter(|_| sparse), estimates, graph: looked_at, analysed })
}

fn dense_cost(n: usize) -> f64 {
    let entries = 0.5 * n as f64 * n as f64;
    if entries > MAX_ENTRIES { f64::INFINITY } else { dense_flops(n) }
}

/// Iterations of conjugate gradients that a reduced system may take: more where variables lie far apart.
fn iterations(kept: usize) -> f64 {
    20.0 + 10.0 * (kept as f64).sqrt()
}

/// The graph of all variables.
fn whole_graph(layout: &Layout) -> BlockGraph {
    let mut links = Vec::new();
    for group in &layout.groups {
        clique(layout.slots(group).iter().map(|s| s.active), &mut links);
    }
    BlockGraph::new(layout.active.iter().map(|a| a.free).collect(), links)
}

/// The graph of the variables that remain when these are eliminated; nothing if it has too many links.
fn reduced_graph(layout: &Layout, groups_of: &GroupsByVariable, eliminated: &[u32]) -> Option<BlockGraph> {
    let mut rank = vec![0_u32; layout.active.len()];
    eliminated.iter().for_each(|e| rank[*e as usize] = u32::MAX);
    let mut dims = Vec::new();
    for (a, rank) in rank.iter_mut().enumerate().filter(|(_, r)| **r == 0) {
        *rank = dims.len() as u32;
        dims.push(layout.active[a].free);
    }
    let mut links = Vec::new();
    for group in &layout.groups {
        let kept = layout.slots(group).iter().map(|s| rank[s.active as usize]).filter(|r| *r != u32::MAX);
        clique(kept, &mut links);
    }
    // Many eliminated variables have the same neighbours.
    let mut seen: HashSet<Vec<u32>> = HashSet::new();
    let mut count = 0.0;
    for e in eliminated {
        let mut neighbours: Vec<u32> = Vec::new();
        for g in groups_of.of(*e) {
            let slots = layout.slots(&layout.groups[*g as usize]).iter();
            neighbours.extend(slots.map(|s| rank[s.active as usize]).filter(|r| *r != u32::MAX));
        }
        neighbours.sort_unstable();
        neighbours.dedup();
        if seen.contains(&neighbours) {
            continue;
        }
        count += 0.5 * neighbours.len() as f64 * neighbours.len() as f64;
        if count > MAX_LINKS {
            return None;
        }
        clique(neighbours.iter().copied(), &mut links);
        seen.insert(neighbours);
    }
    Some(BlockGraph::new(dims, links))
}

fn clique(members: impl Iterator<Item = u32> + Clone, links: &mut Vec<(u32, u32)>) {
    for (i, a) in members.clone().enumerate() {
        links.extend(members.clone().take(i).filter(|b| *b != a).map(|b| (a.min(b), a.max(b))));
    }
}
