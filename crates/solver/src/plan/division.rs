//! Division of the groups of residuals into chunks of similar work.
//!
//! The division depends on the problem alone. Sums over chunks, taken in the order of the chunks, are therefore bitwise
//! identical for any number of threads.

use crate::plan::layout::{Layout, NONE};

/// Minimum work of a chunk, in floating-point operations, and maximum number of chunks.
const CHUNK_WORK: f64 = 5e5;
const MAX_CHUNKS: f64 = 32.0;

/// The members of one chunk: eliminated variables with their groups, and groups without an eliminated variable.
#[derive(Clone, Debug, Default)]
pub(crate) struct ChunkMembers {
    /// Index among the active variables, and groups, of each eliminated variable.
    pub eliminated: Vec<(u32, Vec<u32>)>,
    /// Groups without an eliminated variable.
    pub others: Vec<u32>,
}

/// Divides the groups into chunks by estimated work.
pub(crate) fn divide(layout: &Layout) -> Vec<ChunkMembers> {
    let mut eliminated: Vec<(u32, Vec<u32>)> = layout.eliminated.iter().map(|e| (*e, Vec::new())).collect();
    let mut others = Vec::new();
    let mut work_of = vec![0.0; eliminated.len()];
    let mut total = 0.0;
    let work = |g: usize| {
        let (rows, columns) = (f64::from(layout.groups[g].rows), f64::from(layout.groups[g].columns));
        100.0 + rows * (10.0 + 5.0 * columns + 0.5 * columns * columns)
    };
    for (g, group) in layout.groups.iter().enumerate() {
        total += work(g);
        let e = layout.slots(group).iter().map(|s| &layout.active[s.active as usize]).find(|a| a.eliminated);
        match e.map_or(NONE, |a| a.rank) {
            NONE => others.push(g as u32),
            rank => {
                eliminated[rank as usize].1.push(g as u32);
                work_of[rank as usize] += work(g);
            }
        }
    }
    let target = total / (total / CHUNK_WORK).ceil().clamp(1.0, MAX_CHUNKS);
    let mut chunks = vec![ChunkMembers::default()];
    let mut filled = 0.0;
    let mut next = |chunks: &mut Vec<ChunkMembers>, work: f64| {
        if filled > 0.0 && filled + 0.5 * work > target {
            chunks.push(ChunkMembers::default());
            filled = 0.0;
        }
        filled += work;
        chunks.len() - 1
    };
    for (e, work) in eliminated.into_iter().zip(work_of) {
        let chunk = next(&mut chunks, work);
        chunks[chunk].eliminated.push(e);
    }
    for g in others {
        let chunk = next(&mut chunks, work(g as usize));
        chunks[chunk].others.push(g);
    }
    chunks
}
