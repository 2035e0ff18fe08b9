//! Choice of the linear solver by estimated work.

use std::collections::HashSet;

use crate::plan::layout::Layout;
use crate::plan::linear_solver::{LinearSolver, Preconditioner, WorkEstimate};
use crate::plan::ordering::{BlockGraph, Ordering};
use crate::plan::partition::{self, GroupsByVariable, dense_flops, groups_by_variable};
use crate::problem::error::StructureError;
use crate::problem::graph::Graph;
use crate::problem::values::Values;

/// Number of unknowns up to which a system is treated as dense without an analysis of its sparsity.
pub(crate) const DENSE_SIZE: usize = 400;

/// Time of a floating-point operation relative to one in a dense factorisation: in the elimination of small blocks, in a
/// sparse factorisation, and in products with a vector, which are limited by memory bandwidth.
const ELIMINATION: f64 = 2.0;
const SPARSE: f64 = 3.0;
const PRODUCT: f64 = 8.0;

/// Number of links between kept variables beyond which a Schur complement is not analysed as a sparse matrix.
const MAX_LINKS: f64 = 1e8;

/// Number of entries beyond which a dense factor is not formed. Conjugate gradients need no more memory than the Jacobian.
const MAX_ENTRIES: f64 = 4e9;

/// The linear solver that was chosen.
#[derive(Debug)]
pub(crate) struct Choice {
    /// Anything but [`LinearSolver::Auto`].
    pub solver: LinearSolver,
    /// Indices of the active variables to eliminate by a Schur complement, sorted.
    pub eliminated: Vec<u32>,
    /// The fill-reducing order of the kept variables, if one was computed for this solver.
    pub ordering: Option<Ordering>,
    pub estimates: Vec<WorkEstimate>,
    /// The block sparsity pattern that was analysed, now or by an earlier choice.
    pub graph: Option<BlockGraph>,
    /// Whether an order was computed.
    pub analysed: bool,
}

/// Chooses the linear solver; none of the variables of `layout` is eliminated yet. If the graph of a `previous` choice
/// [covers](BlockGraph::covers) the present one, its estimates are used instead of a new analysis.
pub(crate) fn choose(
    graph: &Graph,
    values: &Values,
    layout: &Layout,
    wanted: LinearSolver,
    previous: Option<(&BlockGraph, &[WorkEstimate])>,
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
            let set = partition::choose(graph, values, layout, &groups_of)?;
            return Ok(forced(wanted, set.map_or_else(Vec::new, |s| s.members)));
        }
    }
    let n = layout.dim();
    let groups_of = groups_by_variable(layout);
    let set = partition::choose(graph, values, layout, &groups_of)?;
    let must_eliminate = !graph.forced_elimination().is_empty();
    let mut estimates = Vec::new();
    let mut estimate = |solver, cost| estimates.push(WorkEstimate { solver, cost });
    let (mut looked_at, mut ordering) = (None, None);
    // The work of a solver with a sparse factorisation.
    let mut analyse = |graph: BlockGraph, solver, elimination: f64| {
        if let Some((other, estimates)) = previous
            && let Some(estimate) = estimates.iter().find(|e| e.solver == solver)
            && other.covers(&graph)
        {
            looked_at = Some(other.clone());
            return Ok(estimate.cost);
        }
        let analysis = graph.analyse()?;
        let cost = elimination + SPARSE * analysis.flops;
        (looked_at, ordering) = (Some(graph), Some(analysis));
        Ok::<f64, StructureError>(cost)
    };
    if !must_eliminate {
        estimate(LinearSolver::Dense, dense_cost(n));
    }
    if let Some(set) = &set {
        let elimination = ELIMINATION * set.elimination_flops;
        let reduced_dim = set.kept_dim;
        estimate(LinearSolver::DenseSchur, elimination + dense_cost(reduced_dim));
        // A reduced system of little work compared to the elimination needs no analysis of its sparsity.
        if reduced_dim > DENSE_SIZE && dense_flops(reduced_dim) > 0.1 * elimination {
            if let Some(links) = reduced_graph(layout, &groups_of, &set.members) {
                estimate(LinearSolver::SparseSchur, analyse(links, LinearSolver::SparseSchur, elimination)?);
            }
            let preconditioner = Preconditioner::SchurJacobi;
            let products = iterations(layout.active.len() - set.members.len()) * set.product_flops;
            estimate(LinearSolver::ConjugateGradients(preconditioner), elimination + PRODUCT * products);
        }
    } else if n > DENSE_SIZE {
        estimate(LinearSolver::SparseCholesky, analyse(whole_graph(layout), LinearSolver::SparseCholesky, 0.0)?);
    }
    let best = estimates.iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
    let solver = best.map_or(LinearSolver::Dense, |e| e.solver);
    let eliminates = !matches!(solver, LinearSolver::Dense | LinearSolver::SparseCholesky);
    let eliminated = set.filter(|_| eliminates).map_or_else(Vec::new, |s| s.members);
    let sparse = matches!(solver, LinearSolver::SparseCholesky | LinearSolver::SparseSchur);
    let analysed = ordering.is_some();
    Ok(Choice { solver, eliminated, ordering: ordering.filter(|_| sparse), estimates, graph: looked_at, analysed })
}

/// Work of a dense factorisation, infinite if the factor would not fit into memory.
fn dense_cost(n: usize) -> f64 {
    let entries = 0.5 * n as f64 * n as f64;
    if entries > MAX_ENTRIES { f64::INFINITY } else { dense_flops(n) }
}

/// Expected number of conjugate-gradient iterations for a reduced system of `kept` variables: it grows with the diameter of
/// their graph.
fn iterations(n: usize) -> f64 {
    20.0 + 10.0 * (n as f64).sqrt()
}

/// The block sparsity pattern of the whole H.
fn whole_graph(layout: &Layout) -> BlockGraph {
    let mut links = Vec::new();
    for group in &layout.groups {
        clique(layout.slots(group).iter().map(|s| s.active), &mut links);
    }
    BlockGraph::new(layout.active.iter().map(|a| a.free).collect(), links)
}

/// The block sparsity pattern of the Schur complement on `eliminated`; `None` if it has too many links.
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
        let ranks = layout.slots(group).iter().map(|s| rank[s.active as usize]).filter(|r| *r != u32::MAX);
        clique(ranks, &mut links);
    }
    // Many eliminated variables have the same neighbours: their links are added once.
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

/// Links each of the members to every other one.
fn clique(members: impl Iterator<Item = u32> + Clone, links: &mut Vec<(u32, u32)>) {
    for (i, a) in members.clone().enumerate() {
        links.extend(members.clone().take(i).filter(|b| *b != a).map(|b| (a.min(b), a.max(b))));
    }
}
