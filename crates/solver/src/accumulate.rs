//! Evaluation of a chunk's groups and accumulation of its part of the normal equations.

use crate::chunk::{ChunkPlan, Elimination, GroupPlan, Scatter};
use crate::error::{EvaluationError, EvaluationFailure};
use crate::kernels;
use crate::layout::{BatchInfo, NONE};
use crate::loss::Loss;
use crate::values::Values;

/// A chunk with its numbers.
#[derive(Debug, Default)]
pub(crate) struct Chunk {
    pub plan: ChunkPlan,
    /// Cost of the last evaluation.
    pub cost: f64,
    pub failure: Option<EvaluationFailure>,
    /// H_ee (lower triangles), H_ec and g_e of the eliminated variables.
    pub hee: Vec<f64>,
    pub hec: Vec<f64>,
    pub ge: Vec<f64>,
    /// Blocks of H_cc and components of g_c.
    pub hcc: Vec<f64>,
    pub gc: Vec<f64>,
    /// Cholesky factors of the damped H_ee.
    pub lee: Vec<f64>,
    /// Blocks of Σ H_ce H_ee⁻¹ H_ec and components of Σ H_ce H_ee⁻¹ g_e.
    pub scc: Vec<f64>,
    pub sc: Vec<f64>,
    /// Step of the eliminated variables.
    pub step: Vec<f64>,
    /// Whether all damped H_ee were positive definite.
    pub definite: bool,
    scratch: Scratch,
}

#[derive(Debug, Default)]
struct Scratch {
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
            step: zeros(plan.dim),
            scratch: Scratch {
                residuals: zeros(plan.max_rows),
                jacobian: zeros(plan.max_jacobian),
                gram: zeros(plan.max_columns * plan.max_columns),
                gradient: zeros(plan.max_columns),
                strip: zeros(plan.max_strip),
            },
            cost: 0.0,
            failure: None,
            definite: true,
            plan,
        }
    }

    /// The cost alone.
    pub fn evaluate(&mut self, batches: &[Option<BatchInfo>], values: &Values) {
        self.cost = 0.0;
        self.failure = None;
        for group in &self.plan.groups {
            let Some(info) = &batches[group.batch as usize] else { continue };
            let r = &mut self.scratch.residuals[..group.rows as usize];
            let cost = match info.batch.evaluate(group.group as usize, values, r, None) {
                Ok(()) => weigh(&info.loss, info.residual_dim, r, None),
                Err(source) => return self.failure = Some(failure(info, group, source)),
            };
            if !cost.is_finite() {
                return self.failure = Some(failure(info, group, EvaluationError::new("a residual is not finite")));
            }
            self.cost += cost;
        }
    }

    /// The cost, H and g.
    pub fn linearize(&mut self, batches: &[Option<BatchInfo>], values: &Values) {
        self.cost = 0.0;
        self.failure = None;
        for array in [&mut self.hee, &mut self.hec, &mut self.ge, &mut self.hcc, &mut self.gc] {
            array.fill(0.0);
        }
        for index in 0..self.plan.groups.len() {
            let group = self.plan.groups[index];
            let Some(info) = &batches[group.batch as usize] else { continue };
            if let Err(source) = self.add_group(info, &group, values) {
                return self.failure = Some(failure(info, &group, source));
            }
        }
    }

    fn add_group(&mut self, info: &BatchInfo, group: &GroupPlan, values: &Values) -> Result<(), EvaluationError> {
        let scatter = &self.plan.scatters[group.scatter as usize];
        let (rows, columns, m) = (group.rows as usize, scatter.columns as usize, scatter.m as usize);
        let r = &mut self.scratch.residuals[..rows];
        let jacobian = &mut self.scratch.jacobian[..rows * columns];
        let wanted = if m > 0 { Some(&mut *jacobian) } else { None };
        info.batch.evaluate(group.group as usize, values, r, wanted)?;
        let cost = weigh(&info.loss, info.residual_dim, r, (m > 0).then_some((&mut *jacobian, columns)));
        if !cost.is_finite() {
            return Err(EvaluationError::new("a residual is not finite"));
        }
        self.cost += cost;
        if m == 0 {
            return Ok(());
        }
        if let Some(keep) = &scatter.keep {
            compact(jacobian, rows, columns, keep);
        }
        let gram = &mut self.scratch.gram[..m * m];
        let gradient = &mut self.scratch.gradient[..m];
        kernels::gram_lower(jacobian, rows, m, gram);
        kernels::gram_vector(&jacobian[..rows * m], r, m, gradient);
        let trace: f64 = (0..m).map(|i| gram[i * m + i]).sum();
        if !trace.is_finite() {
            return Err(EvaluationError::new("a Jacobian is not finite"));
        }
        if group.elimination != NONE {
            let elimination = self.plan.eliminations[group.elimination as usize];
            let width = self.plan.strips[elimination.strip as usize].width as usize;
            let columns = &self.plan.strip_columns[group.strip_columns as usize..][..scatter.kept.len()];
            let d = elimination.d as usize;
            scatter_eliminated(
                scatter,
                gram,
                gradient,
                columns,
                &mut self.hee[elimination.ee..][..d * d],
                &mut self.hec[elimination.ec..][..d * width],
                &mut self.ge[elimination.e..][..d],
            );
        }
        for variable in &scatter.kept {
            let (column, d) = (variable.column as usize, variable.d as usize);
            let target = &mut self.gc[variable.local as usize..][..d];
            target.iter_mut().zip(&gradient[column..column + d]).for_each(|(t, g)| *t += g);
        }
        for pair in &scatter.pairs {
            let (row, dr) = (pair.row as usize, pair.row_d as usize);
            let (column, dc) = (pair.column as usize, pair.column_d as usize);
            let block = &mut self.hcc[pair.block as usize..][..dr * dc];
            if row > column {
                for (a, target) in block.chunks_exact_mut(dc).enumerate() {
                    let source = &gram[(row + a) * m + column..][..dc];
                    target.iter_mut().zip(source).for_each(|(t, s)| *t += s);
                }
            } else if row == column {
                for (a, target) in block.chunks_exact_mut(dc).enumerate() {
                    let source = &gram[(row + a) * m + column..][..=a];
                    target.iter_mut().zip(source).for_each(|(t, s)| *t += s);
                }
            } else {
                for (a, target) in block.chunks_exact_mut(dc).enumerate() {
                    for (b, t) in target.iter_mut().enumerate() {
                        *t += gram[(column + b) * m + row + a];
                    }
                }
            }
        }
        Ok(())
    }

    /// Factorises every H_ee + μ D² and accumulates its share of the Schur complement. `d2` is D² of the eliminated
    /// variables of all chunks.
    pub fn eliminate(&mut self, mu: f64, d2: &[f64]) {
        self.scc.fill(0.0);
        self.sc.fill(0.0);
        self.definite = true;
        let d2 = &d2[self.plan.offset..][..self.plan.dim];
        for e in &self.plan.eliminations {
            let d = e.d as usize;
            let strip = &self.plan.strips[e.strip as usize];
            let width = strip.width as usize;
            let l = &mut self.lee[e.ee..][..d * d];
            l.copy_from_slice(&self.hee[e.ee..][..d * d]);
            for i in 0..d {
                l[i * d + i] += mu * d2[e.e + i];
            }
            if !kernels::cholesky(l, d) {
                self.definite = false;
                return;
            }
            if width == 0 {
                continue;
            }
            let (w, y) = self.scratch.strip[..d * (width + 1)].split_at_mut(d * width);
            w.copy_from_slice(&self.hec[e.ec..][..d * width]);
            y.copy_from_slice(&self.ge[e.e..][..d]);
            kernels::solve_lower(l, d, w, width);
            kernels::solve_lower(l, d, y, 1);
            let mut pairs = strip.pairs.iter();
            for (k, row) in strip.variables.iter().enumerate() {
                let (i, di) = (row.column as usize, row.d as usize);
                for column in &strip.variables[..=k] {
                    let (j, dj) = (column.column as usize, column.d as usize);
                    let Some(offset) = pairs.next() else { continue };
                    let block = &mut self.scc[*offset as usize..][..di * dj];
                    kernels::accumulate_product(w, width, (i, di), (j, dj), block);
                }
                let target = &mut self.sc[row.local as usize..][..di];
                for (w, y) in w.chunks_exact(width).zip(y.iter()) {
                    target.iter_mut().zip(&w[i..i + di]).for_each(|(t, w)| *t += w * y);
                }
            }
        }
    }

    /// The step of the eliminated variables, −H_ee⁻¹ (g_e + H_ec δ_c), from that of the kept ones.
    pub fn back_substitute(&mut self, kept_step: &[f64]) {
        for e in &self.plan.eliminations {
            let d = e.d as usize;
            let step = &mut self.step[e.e..][..d];
            step.copy_from_slice(&self.ge[e.e..][..d]);
            let strip = &self.plan.strips[e.strip as usize];
            multiply_strip(strip, &self.hec[e.ec..], d, kept_step, step);
            let l = &self.lee[e.ee..][..d * d];
            kernels::solve_lower(l, d, step, 1);
            kernels::solve_lower_transposed(l, d, step);
            step.iter_mut().for_each(|s| *s = -*s);
        }
    }

    /// The diagonal of H for the eliminated variables of this chunk.
    pub fn diagonal(&self, target: &mut [f64]) {
        for Elimination { d, ee, e, .. } in &self.plan.eliminations {
            let d = *d as usize;
            for i in 0..d {
                target[e + i] = self.hee[ee + i * d + i];
            }
        }
    }
}

/// target += H_ec x for x over all kept variables.
pub(crate) fn multiply_strip(strip: &crate::chunk::Strip, hec: &[f64], d: usize, x: &[f64], target: &mut [f64]) {
    let width = strip.width as usize;
    if width == 0 {
        return;
    }
    for (row, t) in hec[..d * width].chunks_exact(width).zip(target) {
        let mut sum = 0.0;
        for v in &strip.variables {
            let (column, dv, kept) = (v.column as usize, v.d as usize, v.kept as usize);
            sum += row[column..column + dv].iter().zip(&x[kept..kept + dv]).map(|(h, x)| h * x).sum::<f64>();
        }
        *t += sum;
    }
}

fn scatter_eliminated(
    scatter: &Scatter,
    gram: &[f64],
    gradient: &[f64],
    strip_columns: &[u32],
    hee: &mut [f64],
    hec: &mut [f64],
    ge: &mut [f64],
) {
    let Some((first, d)) = scatter.eliminated else { return };
    let (first, d, m) = (first as usize, d as usize, scatter.m as usize);
    let width = hec.len() / d;
    for i in 0..d {
        let source = &gram[(first + i) * m + first..][..=i];
        hee[i * d..=i * d + i].iter_mut().zip(source).for_each(|(t, s)| *t += s);
        ge[i] += gradient[first + i];
    }
    for (variable, column) in scatter.kept.iter().zip(strip_columns) {
        let (own, dv, column) = (variable.column as usize, variable.d as usize, *column as usize);
        for i in 0..d {
            let target = &mut hec[i * width + column..][..dv];
            if own < first {
                let source = &gram[(first + i) * m + own..][..dv];
                target.iter_mut().zip(source).for_each(|(t, s)| *t += s);
            } else {
                for (a, t) in target.iter_mut().enumerate() {
                    *t += gram[(own + a) * m + first + i];
                }
            }
        }
    }
}

/// The cost of a group; multiplies rows by √ρ′.
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

/// Moves the kept columns of a row-major matrix together.
fn compact(jacobian: &mut [f64], rows: usize, columns: usize, keep: &[u32]) {
    let mut target = 0;
    for row in 0..rows {
        for k in keep {
            // The target never overtakes the source.
            jacobian[target] = jacobian[row * columns + *k as usize];
            target += 1;
        }
    }
}

fn failure(info: &BatchInfo, group: &GroupPlan, source: EvaluationError) -> EvaluationFailure {
    EvaluationFailure { batch: info.batch.name().to_owned(), group: group.group as usize, source }
}
