//! A chunk's part of the normal equations: evaluation of its groups, accumulation, elimination.

use pulp::Arch;

use crate::normal::eliminate::{BackSubstitute, Eliminate, multiply_strip};
use crate::normal::lane_products::{LaneColumn, LaneProducts};
use crate::normal::scatter::{Add, EliminatedBlocks, PADDING, Rows};
use crate::plan::chunk_plan::{ChunkPlan, Elimination, Form, GroupPlan};
use crate::plan::layout::{BatchInfo, NONE};
use crate::problem::error::{EvaluationError, EvaluationFailure};
use crate::problem::lane::{LANES, Lane, used_lanes};
use crate::problem::loss::Loss;
use crate::problem::values::Values;

/// A chunk: its structure and the buffers that it fills.
#[derive(Debug, Default)]
pub(crate) struct Chunk {
    pub plan: ChunkPlan,
    /// ½ Σ ρ(‖r‖²) at the last evaluation.
    pub cost: f64,
    pub failure: Option<EvaluationFailure>,
    /// H_ee (lower triangles), strips of H_ec, and g_e of the eliminated variables.
    pub hee: Vec<f64>,
    pub hec: Vec<f64>,
    pub ge: Vec<f64>,
    /// Blocks of H_cc, and components of g_c in the chunk's order.
    pub hcc: Vec<f64>,
    pub gc: Vec<f64>,
    /// Cholesky factors of the damped H_ee.
    pub lee: Vec<f64>,
    /// Blocks of Σ H_ce H_ee⁻¹ H_ec, and components of Σ H_ce H_ee⁻¹ g_e in the chunk's order.
    pub scc: Vec<f64>,
    pub sc: Vec<f64>,
    /// Sums Wᵀ W of strips that many eliminated variables have in common.
    dense: Vec<f64>,
    /// Step of the eliminated variables.
    pub step: Vec<f64>,
    /// A product with the Schur complement over the chunk's kept variables, for conjugate gradients.
    pub product: Vec<f64>,
    /// Weighted residuals and free columns of the Jacobian, group after group, for [`Form::Rows`].
    rows: Vec<f64>,
    /// Whether all damped H_ee were positive definite in the last elimination.
    pub definite: bool,
    scratch: Scratch,
}

#[derive(Debug, Default)]
struct Scratch {
    lanes: Vec<Lane>,
    /// Columns of a row of residuals in lanes that are not zero.
    present: Vec<LaneColumn>,
    residuals: Vec<f64>,
    jacobian: Vec<f64>,
    gram: Vec<f64>,
    gradient: Vec<f64>,
    strip: Vec<f64>,
}

impl Chunk {
    pub fn new(plan: ChunkPlan) -> Self {
        let zeros = |n: usize| vec![0.0; n];
        Self {
            hee: zeros(plan.hee_len),
            hec: zeros(plan.hec_len),
            ge: zeros(plan.dim),
            hcc: zeros(plan.hcc_len),
            gc: zeros(plan.local_dim),
            lee: zeros(plan.hee_len),
            scc: zeros(plan.scc_len),
            sc: zeros(plan.local_dim),
            dense: zeros(plan.dense_len),
            step: zeros(plan.dim),
            product: zeros(if plan.form == Form::Implicit { plan.local_dim } else { 0 }),
            rows: zeros(plan.rows_len),
            scratch: Scratch {
                lanes: vec![[0.0; LANES]; plan.max_lanes],
                present: Vec::with_capacity(plan.max_columns + 1),
                residuals: zeros(plan.max_rows),
                jacobian: zeros(plan.max_jacobian + PADDING),
                gram: zeros(plan.max_columns * plan.max_columns + PADDING),
                gradient: zeros(plan.max_columns + PADDING),
                strip: zeros(plan.max_strip),
            },
            cost: 0.0,
            failure: None,
            definite: true,
            plan,
        }
    }

    /// Computes the cost alone.
    pub fn evaluate(&mut self, batches: &[Option<BatchInfo>], values: &Values) {
        self.cost = 0.0;
        self.failure = None;
        for group in &self.plan.groups {
            let Some(info) = &batches[group.batch as usize] else { continue };
            let (index, dim) = (group.group as usize, info.residual_dim);
            let cost = if let Some(lanes) = info.batch.lanes(index).filter(|_| self.plan.form != Form::Rows) {
                let count = group.rows as usize / dim;
                let blocks = &mut self.scratch.lanes[..count.div_ceil(LANES) * dim];
                lanes
                    .evaluate_lanes(index, values, blocks, false)
                    .map(|()| weigh_lanes(&info.loss, dim, blocks, dim, count))
            } else {
                let r = &mut self.scratch.residuals[..group.rows as usize];
                info.batch.evaluate(index, values, r, None).map(|()| weigh(&info.loss, dim, r, None))
            };
            let cost = match cost {
                Ok(cost) => cost,
                Err(source) => return self.failure = Some(failure(info, group, source)),
            };
            if !cost.is_finite() {
                return self.failure = Some(failure(info, group, EvaluationError::new("a residual is not finite")));
            }
            self.cost += cost;
        }
    }

    /// Computes the cost and accumulates H and g.
    pub fn linearize(&mut self, batches: &[Option<BatchInfo>], values: &Values) {
        self.cost = 0.0;
        self.failure = None;
        self.hcc.fill(0.0);
        self.gc.fill(0.0);
        let mut last = NONE;
        for index in 0..self.plan.groups.len() {
            let group = self.plan.groups[index];
            if group.elimination != last && group.elimination != NONE {
                // Groups of an eliminated variable are consecutive. Clearing its blocks here, when they are needed, saves a
                // separate pass through memory.
                self.clear_blocks(group.elimination as usize);
                last = group.elimination;
            }
            let Some(info) = &batches[group.batch as usize] else { continue };
            if let Err(source) = self.add_group(info, &group, values) {
                return self.failure = Some(failure(info, &group, source));
            }
        }
    }

    fn clear_blocks(&mut self, elimination: usize) {
        let e = &self.plan.eliminations[elimination];
        let (d, stride) = (e.d as usize, self.plan.strips[e.strip as usize].stride as usize);
        self.hee[e.ee..][..d * d].fill(0.0);
        self.hec[e.ec..][..d * stride].fill(0.0);
        self.ge[e.e..][..d].fill(0.0);
    }

    fn add_group(&mut self, info: &BatchInfo, group: &GroupPlan, values: &Values) -> Result<(), EvaluationError> {
        let scatter = &self.plan.scatters[group.scatter as usize];
        let (rows, columns, m) = (group.rows as usize, scatter.columns as usize, scatter.m as usize);
        let (index, dim) = (group.group as usize, info.residual_dim);
        let (gram, gradient) = (&mut self.scratch.gram, &mut self.scratch.gradient);
        let lanes = info.batch.lanes(index).filter(|_| self.plan.form != Form::Rows);
        let mut plain = false;
        let cost = if let (Some(lanes), Some(size)) = (lanes, scatter.block) {
            let (count, size) = (rows / dim, size as usize);
            let blocks = &mut self.scratch.lanes[..count.div_ceil(LANES) * size];
            lanes.evaluate_lanes(index, values, blocks, true)?;
            let cost = weigh_lanes(&info.loss, dim, blocks, size, count);
            let (gram, gradient) = (&mut gram[..m * m], &mut gradient[..m]);
            let (keep, present) = (scatter.keep.as_deref(), &mut self.scratch.present);
            Arch::new().dispatch(LaneProducts { blocks, count, dim, columns, keep, m, present, gram, gradient });
            cost
        } else {
            let r = &mut self.scratch.residuals[..rows];
            let jacobian = &mut self.scratch.jacobian[..rows * columns];
            let wanted = if m > 0 { Some(&mut *jacobian) } else { None };
            info.batch.evaluate(index, values, r, wanted)?;
            let cost = weigh(&info.loss, dim, r, (m > 0).then_some((&mut *jacobian, columns)));
            if let Some(keep) = scatter.keep.as_ref().filter(|_| m > 0) {
                compact(jacobian, rows, columns, keep);
            }
            plain = true;
            if self.plan.form == Form::Rows {
                let (kept_r, kept_j) = self.rows[group.kept_rows..][..rows * (m + 1)].split_at_mut(rows);
                kept_r.copy_from_slice(r);
                kept_j.copy_from_slice(&self.scratch.jacobian[..rows * m]);
            }
            cost
        };
        if !cost.is_finite() {
            return Err(EvaluationError::new("a residual is not finite"));
        }
        self.cost += cost;
        if m == 0 {
            return Ok(());
        }
        let eliminated = (group.elimination != NONE).then(|| {
            let e = self.plan.eliminations[group.elimination as usize];
            let stride = self.plan.strips[e.strip as usize].stride as usize;
            let d = e.d as usize;
            EliminatedBlocks {
                strip_columns: &self.plan.strip_columns[group.strip_columns as usize..][..scatter.kept.len()],
                hee: &mut self.hee[e.ee..][..d * d],
                hec: &mut self.hec[e.ec..][..d * stride],
                ge: &mut self.ge[e.e..][..d],
            }
        });
        let rows = plain.then(|| Rows { j: &self.scratch.jacobian, r: &self.scratch.residuals[..rows] });
        let (hcc, gc) = (&mut self.hcc, &mut self.gc);
        let finite = Arch::new().dispatch(Add { scatter, rows, gram, gradient, eliminated, hcc, gc });
        if finite { Ok(()) } else { Err(EvaluationError::new("a Jacobian is not finite")) }
    }

    /// The weighted residuals of each group, for [`Form::Rows`].
    pub fn residual_rows(&self) -> impl Iterator<Item = &[f64]> {
        self.plan.groups.iter().map(|g| &self.rows[g.kept_rows..][..g.rows as usize])
    }

    /// The weighted Jacobian of each group over its free columns, row-major rows × m, for [`Form::Rows`].
    pub fn jacobian_rows(&self) -> impl Iterator<Item = &[f64]> {
        self.plan.groups.iter().map(|g| {
            let (rows, m) = (g.rows as usize, self.plan.scatters[g.scatter as usize].m as usize);
            &self.rows[g.kept_rows + rows..][..rows * m]
        })
    }

    /// Factorises every H_ee + μ D² and accumulates the chunk's part of the Schur complement. `d2` is the diagonal of D²
    /// for the eliminated variables of all chunks.
    pub fn eliminate(&mut self, mu: f64, d2: &[f64]) {
        self.definite = Arch::new().dispatch(Eliminate {
            plan: &self.plan,
            hee: &self.hee,
            hec: &self.hec,
            ge: &self.ge,
            mu,
            d2: &d2[self.plan.offset..][..self.plan.dim],
            lee: &mut self.lee,
            scc: &mut self.scc,
            sc: &mut self.sc,
            dense: &mut self.dense,
            w: &mut self.scratch.strip,
        });
    }

    /// Computes the step of the eliminated variables from that of all kept ones.
    pub fn back_substitute(&mut self, kept_step: &[f64]) {
        let Self { plan, hec, ge, lee, step, .. } = self;
        Arch::new().dispatch(BackSubstitute { plan, hec, ge, lee, kept_step, step });
    }

    /// x_eᵀ H_ee x_e + 2 x_eᵀ H_ec x_c, where `x` is x_e of the chunk's eliminated variables and `kept` is x_c of all
    /// kept ones.
    pub fn quadratic_form(&self, x: &[f64], x_kept: &[f64]) -> f64 {
        let mut sum = 0.0;
        for e in &self.plan.eliminations {
            let d = e.d as usize;
            let x = &x[e.e..][..d];
            let strip = &self.plan.strips[e.strip as usize];
            for i in 0..d {
                let mut product = [0.0];
                let row = &self.hec[e.ec + i * strip.stride as usize..];
                // Rarely called, hence without vector instructions.
                multiply_strip(pulp::Scalar, strip, row, 1, x_kept, &mut product);
                let row = &self.hee[e.ee + i * d..][..=i];
                let lower: f64 = row[..i].iter().zip(x).map(|(h, x)| h * x).sum();
                sum += x[i] * (2.0 * (lower + product[0]) + row[i] * x[i]);
            }
        }
        sum
    }

    /// Writes the diagonal of H for the eliminated variables of this chunk.
    pub fn diagonal(&self, target: &mut [f64]) {
        for Elimination { d, ee, e, .. } in &self.plan.eliminations {
            let d = *d as usize;
            for i in 0..d {
                target[e + i] = self.hee[ee + i * d + i];
            }
        }
    }
}

/// Multiplies rows by √ρ′ and returns the cost of the group. `residuals` has `dim` rows per residual; the Jacobian, given
/// with its number of columns, is row-major with as many rows as `residuals`.
fn weigh(loss: &Loss, dim: usize, residuals: &mut [f64], mut jacobian: Option<(&mut [f64], usize)>) -> f64 {
    if loss.is_trivial() {
        return 0.5 * residuals.iter().map(|r| r * r).sum::<f64>();
    }
    let mut cost = 0.0;
    for (i, r) in residuals.chunks_exact_mut(dim).enumerate() {
        let s: f64 = r.iter().map(|x| x * x).sum();
        if !s.is_finite() {
            return f64::NAN;
        }
        let [value, first, _] = loss.evaluate(s);
        cost += 0.5 * value;
        if let Some((jacobian, columns)) = &mut jacobian
            && first != 1.0
        {
            let weight = first.sqrt();
            r.iter_mut().for_each(|x| *x *= weight);
            jacobian[i * dim * *columns..(i + 1) * dim * *columns].iter_mut().for_each(|x| *x *= weight);
        }
    }
    cost
}

/// Multiplies blocks by √ρ′ and returns the cost of a group of `count` residuals in lanes. A block has `size` lanes, of which the
/// first `dim` are the rows of the residual.
fn weigh_lanes(loss: &Loss, dim: usize, blocks: &mut [Lane], size: usize, count: usize) -> f64 {
    let mut cost = 0.0;
    for (block, first) in blocks.chunks_exact_mut(size).zip((0..count).step_by(LANES)) {
        let used = used_lanes(count, first);
        let mut squares = [0.0; LANES];
        for lane in &block[..dim] {
            squares[..used].iter_mut().zip(lane).for_each(|(s, r)| *s += r * r);
        }
        if loss.is_trivial() {
            cost += 0.5 * squares[..used].iter().sum::<f64>();
            continue;
        }
        let mut weights = [1.0; LANES];
        for (s, w) in squares.iter().zip(&mut weights).take(used) {
            if !s.is_finite() {
                return f64::NAN;
            }
            let [value, first, _] = loss.evaluate(*s);
            cost += 0.5 * value;
            *w = first.sqrt();
        }
        for lane in block {
            lane[..used].iter_mut().zip(&weights).for_each(|(x, w)| *x *= w);
        }
    }
    cost
}

/// Compresses a row-major matrix rows × `columns` in place to the columns listed in `keep`.
fn compact(jacobian: &mut [f64], rows: usize, columns: usize, keep: &[u32]) {
    let mut target = 0;
    for row in 0..rows {
        for k in keep {
            // The target index never exceeds the source index.
            jacobian[target] = jacobian[row * columns + *k as usize];
            target += 1;
        }
    }
}

fn failure(info: &BatchInfo, group: &GroupPlan, source: EvaluationError) -> EvaluationFailure {
    EvaluationFailure { batch: info.batch.name().to_owned(), group: group.group as usize, source }
}
