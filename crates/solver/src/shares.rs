//! Division of the work into chunks.
//!
//! It depends on the problem alone, so that sums over chunks in their order give the same bits for any number of threads.

use crate::chunk::Share;
use crate::layout::{Layout, NONE};

/// Work that a chunk should hold at least, in floating-point operations, and the largest number of chunks.
const CHUNK_WORK: f64 = 5e5;
const MAX_CHUNKS: f64 = 32.0;

/// Divides the groups by estimated work.
pub(crate) fn shares(layout: &Layout) -> Vec<Share> {
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
    let mut shares = vec![Share::default()];
    let mut filled = 0.0;
    let mut next = |shares: &mut Vec<Share>, work: f64| {
        if filled > 0.0 && filled + 0.5 * work > target {
            shares.push(Share::default());
            filled = 0.0;
        }
        filled += work;
        shares.len() - 1
    };
    for (e, work) in eliminated.into_iter().zip(work_of) {
        let share = next(&mut shares, work);
        shares[share].eliminated.push(e);
    }
    for g in others {
        let share = next(&mut shares, work(g as usize));
        shares[share].others.push(g);
    }
    shares
}
