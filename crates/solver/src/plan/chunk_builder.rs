//! Construction of a chunk's structure.

use std::collections::HashMap;

use crate::plan::chunk_plan::{
    ChunkPlan, Elimination, Form, GroupPlan, LocalBlock, LocalVariable, QUAD, Scatter, ScatterPair, ScatterVariable,
    Strip, StripVariable,
};
use crate::plan::division::ChunkMembers;
use crate::plan::layout::{Layout, NONE};
use crate::problem::lane::LANES;

/// If at least this many eliminated variables have the same strip, and it is not wider than `DENSE_WIDTH`, their products
/// Wᵀ W are summed as one matrix: blocks of few columns do not fill vector registers.
const DENSE_COUNT: u32 = 4;
const DENSE_WIDTH: u32 = 64;

/// Builds one [`ChunkPlan`].
pub(crate) struct ChunkBuilder<'a> {
    layout: &'a Layout,
    plan: ChunkPlan,
    local_of: HashMap<u32, u32>,
    hcc: HashMap<(u32, u32), u32>,
    scc: HashMap<(u32, u32), u32>,
    strips: HashMap<Box<[u32]>, u32>,
    scatters: HashMap<Box<[u32]>, u32>,
    key: Vec<u32>,
}

impl<'a> ChunkBuilder<'a> {
    pub fn build(layout: &'a Layout, members: &ChunkMembers, form: Form) -> ChunkPlan {
        let mut builder = Self {
            layout,
            plan: ChunkPlan { form, ..ChunkPlan::default() },
            local_of: HashMap::new(),
            hcc: HashMap::new(),
            scc: HashMap::new(),
            strips: HashMap::new(),
            scatters: HashMap::new(),
            key: Vec::new(),
        };
        if let Some((first, _)) = members.eliminated.first() {
            builder.plan.offset = layout.active[*first as usize].offset;
        }
        let count = members.others.len() + members.eliminated.iter().map(|(_, g)| g.len()).sum::<usize>();
        builder.plan.groups.reserve_exact(count);
        builder.plan.eliminations.reserve_exact(members.eliminated.len());
        for (e, groups) in &members.eliminated {
            builder.add_eliminated(*e, groups);
        }
        for group in &members.others {
            builder.add_group(*group, NONE);
        }
        let plan = &mut builder.plan;
        for strip in &mut plan.strips {
            if form == Form::Explicit && strip.count >= DENSE_COUNT && (1..=DENSE_WIDTH).contains(&strip.width) {
                strip.dense = Some(plan.dense_len as u32);
                plan.dense_len += (strip.stride * strip.stride) as usize;
            }
        }
        builder.plan
    }

    fn add_eliminated(&mut self, e: u32, groups: &[u32]) {
        let d = self.layout.active[e as usize].free;
        let strip = self.strip(groups);
        let common = &mut self.plan.strips[strip as usize];
        common.count += 1;
        let stride = common.stride as usize;
        self.plan.eliminations.push(Elimination {
            d,
            ee: self.plan.hee_len,
            ec: self.plan.hec_len,
            e: self.plan.dim,
            strip,
        });
        self.plan.hee_len += (d * d) as usize;
        self.plan.hec_len += d as usize * stride;
        self.plan.dim += d as usize;
        self.plan.max_strip = self.plan.max_strip.max(d as usize * stride);
        let index = self.plan.eliminations.len() as u32 - 1;
        for group in groups {
            self.add_group(*group, index);
        }
    }

    /// The strip with all kept variables of these groups.
    fn strip(&mut self, groups: &[u32]) -> u32 {
        let mut key = std::mem::take(&mut self.key);
        key.clear();
        for g in groups {
            for slot in self.layout.slots(&self.layout.groups[*g as usize]) {
                let active = &self.layout.active[slot.active as usize];
                if !active.eliminated {
                    key.push(active.rank);
                }
            }
        }
        key.sort_unstable();
        key.dedup();
        let known = self.strips.get(key.as_slice()).copied();
        let index = known.unwrap_or_else(|| self.new_strip(&key));
        self.key = key;
        index
    }

    fn new_strip(&mut self, ranks: &[u32]) -> u32 {
        let mut variables = Vec::with_capacity(ranks.len());
        let mut pairs = Vec::with_capacity(ranks.len() * (ranks.len() + 1) / 2);
        let mut width = 0;
        for (k, rank) in ranks.iter().enumerate() {
            let active = &self.layout.active[self.layout.kept[*rank as usize] as usize];
            let offset = (active.offset - self.layout.eliminated_dim) as u32;
            let d = active.free;
            variables.push(StripVariable { column: width, d, local: self.local(*rank), kept: offset });
            width += d;
            let formed = if self.plan.form == Form::Implicit { &[] } else { &ranks[..=k] };
            for other in formed {
                pairs.push(self.schur_block(*rank, *other));
            }
        }
        let stride = if width == 0 { 0 } else { (width + 1).next_multiple_of(QUAD as u32) };
        let ranks_of = ranks.to_vec();
        self.plan.strips.push(Strip { variables, width, stride, count: 0, dense: None, pairs, ranks: ranks_of });
        let index = self.plan.strips.len() as u32 - 1;
        self.strips.insert(ranks.into(), index);
        index
    }

    fn free_of(&self, rank: u32) -> u32 {
        self.layout.active[self.layout.kept[rank as usize] as usize].free
    }

    /// Offset of a kept variable in the chunk's vector.
    fn local(&mut self, rank: u32) -> u32 {
        if let Some(local) = self.local_of.get(&rank) {
            return *local;
        }
        let active = &self.layout.active[self.layout.kept[rank as usize] as usize];
        let local = self.plan.local_dim as u32;
        let offset = (active.offset - self.layout.eliminated_dim) as u32;
        self.plan.locals.push(LocalVariable { kept: offset, local, d: active.free });
        self.plan.local_dim += active.free as usize;
        self.local_of.insert(rank, local);
        local
    }

    fn schur_block(&mut self, row: u32, column: u32) -> u32 {
        let size = (self.free_of(row) * self.free_of(column)) as usize;
        let plan = &mut self.plan;
        *self.scc.entry((row, column)).or_insert_with(|| {
            let offset = plan.scc_len as u32;
            plan.scc_blocks.push(LocalBlock { row, column, offset });
            plan.scc_len += size;
            offset
        })
    }

    fn hessian_block(&mut self, row: u32, column: u32) -> u32 {
        let size = (self.free_of(row) * self.free_of(column)) as usize;
        let plan = &mut self.plan;
        *self.hcc.entry((row, column)).or_insert_with(|| {
            let offset = plan.hcc_len as u32;
            plan.hcc_blocks.push(LocalBlock { row, column, offset });
            plan.hcc_len += size;
            offset
        })
    }

    fn add_group(&mut self, group: u32, elimination: u32) {
        let info = &self.layout.groups[group as usize];
        let mut key = std::mem::take(&mut self.key);
        key.clear();
        key.push(info.columns);
        let batch = self.layout.batches[info.batch as usize].as_ref();
        let in_lanes = batch.is_some_and(|b| b.batch.lanes(info.group as usize).is_some());
        key.push(if in_lanes { info.batch } else { NONE });
        for slot in self.layout.slots(info) {
            let active = &self.layout.active[slot.active as usize];
            key.push(slot.column);
            if active.eliminated {
                key.extend([NONE, active.free]);
                key.extend(active.mask.iter().flatten());
            } else {
                key.push(active.rank);
            }
        }
        let scatter = match self.scatters.get(key.as_slice()) {
            Some(scatter) => *scatter,
            None => {
                let scatter = self.new_scatter(group);
                self.plan.scatters.push(scatter);
                let index = self.plan.scatters.len() as u32 - 1;
                self.scatters.insert(key.as_slice().into(), index);
                index
            }
        };
        self.key = key;
        let strip_columns = self.plan.strip_columns.len() as u32;
        if elimination != NONE {
            let strip = &self.plan.strips[self.plan.eliminations[elimination as usize].strip as usize];
            for slot in self.layout.slots(info) {
                let active = &self.layout.active[slot.active as usize];
                if !active.eliminated
                    && let Ok(k) = strip.ranks.binary_search(&active.rank)
                {
                    self.plan.strip_columns.push(strip.variables[k].column);
                }
            }
        }
        let (rows, columns) = (info.rows as usize, info.columns as usize);
        let scattered = &self.plan.scatters[scatter as usize];
        let m = scattered.m as usize;
        if let Some(block) = scattered.block.filter(|_| self.plan.form != Form::Rows) {
            let count = rows * (columns + 1) / block as usize;
            self.plan.max_lanes = self.plan.max_lanes.max(count.div_ceil(LANES) * block as usize);
        } else {
            self.plan.max_rows = self.plan.max_rows.max(rows);
            self.plan.max_jacobian = self.plan.max_jacobian.max(rows * columns);
        }
        self.plan.max_columns = self.plan.max_columns.max(columns);
        self.plan.groups.push(GroupPlan {
            batch: info.batch,
            group: info.group,
            rows: info.rows,
            scatter,
            elimination,
            strip_columns,
            kept_rows: self.plan.rows_len,
        });
        if self.plan.form == Form::Rows {
            self.plan.rows_len += rows * (m + 1);
        }
    }

    fn new_scatter(&mut self, group: u32) -> Scatter {
        let info = &self.layout.groups[group as usize];
        let mut keep = Vec::new();
        let mut eliminated = None;
        let mut variables = Vec::new();
        let mut ranks = Vec::new();
        for slot in self.layout.slots(info) {
            let active = &self.layout.active[slot.active as usize];
            let column = keep.len() as u32;
            match &active.mask {
                None => keep.extend(slot.column..slot.column + active.dim),
                Some(mask) => keep.extend(mask.iter().map(|i| slot.column + i)),
            }
            if active.eliminated {
                eliminated = Some((column, active.free));
            } else {
                variables.push(ScatterVariable { column, d: active.free, local: self.local(active.rank) });
                ranks.push(active.rank);
            }
        }
        let mut pairs = Vec::with_capacity(variables.len() * (variables.len() + 1) / 2);
        for k in 0..variables.len() {
            for l in 0..=k {
                let (r, c) = if ranks[k] >= ranks[l] { (k, l) } else { (l, k) };
                pairs.push(ScatterPair {
                    row: variables[r].column,
                    row_d: variables[r].d,
                    column: variables[c].column,
                    column_d: variables[c].d,
                    block: self.hessian_block(ranks[r], ranks[c]),
                });
            }
        }
        let m = keep.len() as u32;
        let batch = self.layout.batches[info.batch as usize].as_ref();
        let in_lanes = batch.filter(|b| b.batch.lanes(info.group as usize).is_some());
        let block = in_lanes.map(|b| b.residual_dim as u32 * (info.columns + 1));
        let keep = (m < info.columns).then(|| keep.into_boxed_slice());
        Scatter { columns: info.columns, keep, m, eliminated, kept: variables, pairs, block }
    }
}
