//! How rough fields may be: chosen so that frames that are left out are predicted best.
//!
//! Everything is done on the linearised adjustment. Each frame contributes its information about the camera's parameters,
//! its own pose eliminated; sums of these with a prior give the estimate from any set of frames without another adjustment.
//! The frames left out are judged as an evaluation judges them: by their depth, with the pose that their image gives. Marginal likelihood would
//! need independent noise, which depth within a frame does not have: it takes errors that a frame has for itself for signal.

use depthcal_model::Camera;
use nalgebra::{DMatrix, DVector};

use crate::adjust::smoothness_prior::{Smoothness, differences, ridge};

/// What one frame says of the camera's free parameters.
#[derive(Debug, Clone)]
pub struct FrameInformation {
    /// Where the frame is fitted, its pose eliminated: the cost is c + gᵀδ + ½ δᵀNδ with this N and g.
    pub fitted: (DMatrix<f64>, DVector<f64>),
    /// Where the frame is judged, by the cost of its depth alone, with the pose that its image gives: N and g again.
    pub judged: (DMatrix<f64>, DVector<f64>),
}

impl FrameInformation {
    /// From normal matrix and gradient of image and depth, each over the pose, `pose` components, and the parameters.
    pub fn new(image: &(DMatrix<f64>, DVector<f64>), depth: &(DMatrix<f64>, DVector<f64>), pose: usize) -> Self {
        let both = (&image.0 + &depth.0, &image.1 + &depth.1);
        let n = image.1.len() - pose;
        let nothing = || (DMatrix::zeros(n, n), DVector::zeros(n));
        // With the pose p = −A δ − b that minimises the cost of `by`, the cost of `of` in δ.
        let reduced = |by: &(DMatrix<f64>, DVector<f64>), of: &(DMatrix<f64>, DVector<f64>)| {
            let factor = by.0.view((0, 0), (pose, pose)).into_owned().cholesky()?;
            let mut follow = DMatrix::zeros(pose + n, n);
            follow.view_mut((0, 0), (pose, n)).copy_from(&-factor.solve(&by.0.view((0, pose), (pose, n)).into_owned()));
            follow.view_mut((pose, 0), (n, n)).fill_with_identity();
            let mut start = DVector::zeros(pose + n);
            start.rows_mut(0, pose).copy_from(&-factor.solve(&by.1.rows(0, pose).into_owned()));
            let gradient = follow.tr_mul(&(&of.1 + &of.0 * start));
            Some((follow.tr_mul(&(&of.0 * &follow)), gradient))
        };
        Self {
            fitted: reduced(&both, &both).unwrap_or_else(nothing),
            judged: reduced(image, depth).unwrap_or_else(nothing),
        }
    }

    /// What it costs where it is judged, up to a constant, at an estimate; infinite where there is none.
    fn cost(&self, estimate: Option<&DVector<f64>>) -> f64 {
        let (normal, gradient) = &self.judged;
        estimate.map_or(f64::INFINITY, |step| gradient.dot(step) + 0.5 * step.dot(&(normal * step)))
    }
}

/// Roughness is looked for in this range, in units of a parameter's typical deviation.
const RANGE: [f64; 2] = [1e-4, 10.0];
/// Factors by which it is changed, coarse to fine.
const FACTORS: [f64; 3] = [8.0, 3.0, 1.5];
/// Most parts into which frames are divided; fewer frames are left out one by one.
const FOLDS: usize = 10;

/// The problem of choosing: free parameters of fields and their priors.
struct Choice<'a> {
    frames: &'a [FrameInformation],
    /// Normal matrices of smoothness at roughness 1, one per field; and of the ridge. Over all free parameters.
    penalties: Vec<DMatrix<f64>>,
    ridge: DMatrix<f64>,
    /// Its standard deviation where it is not chosen.
    fixed_ridge: Option<f64>,
    /// Present deviation of the free parameters from neutral.
    deviation: DVector<f64>,
    /// Of the frames of every part: fitted, judged.
    folds: Vec<FrameInformation>,
    total: (DMatrix<f64>, DVector<f64>),
}

impl<'a> Choice<'a> {
    fn new(camera: &Camera, smoothness: &Smoothness, frames: &'a [FrameInformation]) -> Self {
        let n = frames.first().map_or(0, |f| f.fitted.1.len());
        let mut place = Vec::new();
        let mut deviation = Vec::new();
        let mut next = 0;
        for block in camera.blocks() {
            for i in 0..block.theta.len() {
                place.push(block.free[i].then_some(next));
                if block.free[i] {
                    next += 1;
                    deviation.push(block.theta[i] - block.parameters()[i].nominal);
                }
            }
        }
        let mut penalties = vec![DMatrix::zeros(n, n); smoothness.fields.len()];
        let mut ridge_matrix = DMatrix::zeros(n, n);
        let mut offset = 0;
        for block in camera.blocks() {
            let own = &place[offset..offset + block.theta.len()];
            offset += block.theta.len();
            let Some(layout) = block.piece().and_then(|p| p.field()) else { continue };
            let add = |to: &mut DMatrix<f64>, entries: &[(usize, f64)]| {
                for (i, a) in entries {
                    for (j, b) in entries {
                        if let (Some(p), Some(q)) = (own[*i], own[*j]) {
                            let scales = block.parameters()[*i].scale * block.parameters()[*j].scale;
                            to[(p, q)] += a * b / scales;
                        }
                    }
                }
            };
            for row in differences(&layout, &block.free, |_| 1.0) {
                let field = (row.entries[0].0 % layout.per_node()) / layout.grid.bins;
                let at = smoothness.fields.iter().position(|f| f.piece == block.name() && f.index == field);
                if let Some(at) = at {
                    add(&mut penalties[at], &row.entries);
                }
            }
            for row in ridge(&layout, &block.free, 1.0) {
                add(&mut ridge_matrix, &row.entries);
            }
        }
        let count = frames.len().clamp(1, FOLDS);
        let zero = || (DMatrix::zeros(n, n), DVector::zeros(n));
        let mut folds = vec![FrameInformation { fitted: zero(), judged: zero() }; count];
        let mut total = zero();
        let add = |to: &mut (DMatrix<f64>, DVector<f64>), what: &(DMatrix<f64>, DVector<f64>)| {
            to.0 += &what.0;
            to.1 += &what.1;
        };
        for (i, frame) in frames.iter().enumerate() {
            add(&mut folds[i % count].fitted, &frame.fitted);
            add(&mut folds[i % count].judged, &frame.judged);
            add(&mut total, &frame.fitted);
        }
        let deviation = DVector::from_vec(deviation);
        let fixed_ridge = (!smoothness.beside_d).then_some(smoothness.ridge);
        Self { frames, penalties, ridge: ridge_matrix, fixed_ridge, deviation, folds, total }
    }

    /// Precision of the prior; the last of `roughness` is the ridge's standard deviation where that is chosen.
    fn precision(&self, roughness: &[f64]) -> DMatrix<f64> {
        let ridge = self.fixed_ridge.unwrap_or(roughness[roughness.len() - 1]);
        let mut precision = &self.ridge / (ridge * ridge);
        for (penalty, r) in self.penalties.iter().zip(roughness) {
            precision += penalty / (r * r);
        }
        precision
    }

    /// Estimates from the frames of all other parts, one per part; `None` where they determine nothing.
    fn estimates(&self, roughness: &[f64]) -> Vec<Option<DVector<f64>>> {
        let prior = self.precision(roughness);
        let pull = &prior * &self.deviation;
        let estimate = |FrameInformation { fitted, .. }: &FrameInformation| {
            let rest = &self.total.0 - &fitted.0 + &prior;
            solve_scaled(rest, &-(&self.total.1 - &fitted.1 + &pull))
        };
        self.folds.iter().map(estimate).collect()
    }

    /// Cost of the frames left out, up to a constant, for every part.
    fn left_out_costs(&self, roughness: &[f64]) -> Vec<f64> {
        self.folds.iter().zip(self.estimates(roughness)).map(|(part, by)| part.cost(by.as_ref())).collect()
    }

    /// The same for every frame.
    fn left_out_costs_by_frame(&self, roughness: &[f64]) -> Vec<f64> {
        let estimates = self.estimates(roughness);
        self.frames.iter().zip(estimates.iter().cycle()).map(|(frame, by)| frame.cost(by.as_ref())).collect()
    }

    /// Effective number of parameters of every field: tr(Σ N) over its nodes, Σ the posterior covariance.
    fn effective(&self, roughness: &[f64], fields: &[Vec<usize>]) -> Option<Vec<f64>> {
        let prior = self.precision(roughness);
        let posterior = inverse_scaled(&self.total.0 + &prior)?;
        let share = DMatrix::identity(prior.nrows(), prior.ncols()) - posterior * prior;
        Some(fields.iter().map(|own| own.iter().map(|i| share[(*i, *i)]).sum()).collect())
    }
}

/// Solution of a symmetric positive definite system whose unknowns differ in size by many orders.
fn solve_scaled(mut matrix: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let scale = scale(&mut matrix);
    Some(matrix.cholesky()?.solve(&right.component_mul(&scale)).component_mul(&scale))
}

fn inverse_scaled(mut matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = scale(&mut matrix);
    let inverse = matrix.cholesky()?.inverse();
    Some(DMatrix::from_fn(inverse.nrows(), inverse.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

/// Brings the diagonal to 1; returns the factors.
fn scale(matrix: &mut DMatrix<f64>) -> DVector<f64> {
    let scale = DVector::from_fn(matrix.nrows(), |i, _| 1.0 / matrix[(i, i)].max(f64::MIN_POSITIVE).sqrt());
    for j in 0..matrix.ncols() {
        for i in 0..matrix.nrows() {
            matrix[(i, j)] *= scale[i] * scale[j];
        }
    }
    scale
}

/// The roughness of every field with which frames that are left out are predicted best, with the effective number of
/// parameters that follows.
pub fn choose(camera: &Camera, smoothness: &Smoothness, frames: &[FrameInformation]) -> Smoothness {
    let choice = Choice::new(camera, smoothness, frames);
    let mut best: Vec<f64> = smoothness.fields.iter().map(|f| f.roughness).collect();
    best.extend(smoothness.beside_d.then_some(smoothness.ridge));
    if choice.frames.len() < 2 {
        return smoothness.clone();
    }
    let mut costs = choice.left_out_costs(&best);
    for factor in FACTORS {
        loop {
            let mut moved = false;
            for i in 0..best.len() {
                for direction in [1.0 / factor, factor] {
                    let mut tried = best.clone();
                    tried[i] = (tried[i] * direction).clamp(RANGE[0], RANGE[1]);
                    if tried[i] == best[i] {
                        continue;
                    }
                    let next = choice.left_out_costs(&tried);
                    if next.iter().sum::<f64>() < costs.iter().sum::<f64>() {
                        (costs, best, moved) = (next, tried, true);
                        break;
                    }
                }
            }
            if !moved {
                break;
            }
        }
    }
    simplest(&choice, &mut best, costs);
    let mut chosen = smoothness.clone();
    let members: Vec<Vec<usize>> = field_members(camera, smoothness);
    let effective = choice.effective(&best, &members);
    if smoothness.beside_d {
        chosen.ridge = best[smoothness.fields.len()];
    }
    for (i, field) in chosen.fields.iter_mut().enumerate() {
        field.roughness = best[i];
        field.effective = effective.as_ref().map(|e| e[i]);
    }
    chosen
}

/// Standard deviations of the signed-rank statistic by which frames must speak for rough fields. Fewer than eight cannot.
const CLEAR: f64 = 2.5;
/// Standard errors of the difference within which the simpler predicts as well.
const AS_GOOD: f64 = 1.0;

/// Roughness that the frames do not support is not fitted. Fields stay flat unless most frames that were left out speak for
/// rough ones: a few with errors of their own decide nothing then, as they would over sums of squares. And of all that
/// predict no worse by more than the standard error of the difference the simplest is taken (Breiman, Friedman, Olshen,
/// Stone 1984, section 3.4.3): beside D none, or a smaller ridge, and smoother fields.
fn simplest(choice: &Choice<'_>, best: &mut [f64], mut costs: Vec<f64>) {
    const STEP: f64 = 1.5;
    let mut flat = best.to_vec();
    flat[..choice.penalties.len()].fill(RANGE[0]);
    let [by_frame, flat_by_frame] = [&*best, &flat].map(|r| choice.left_out_costs_by_frame(r));
    if signed_ranks(&by_frame, &flat_by_frame) <= CLEAR {
        best.copy_from_slice(&flat);
        costs = choice.left_out_costs(&flat);
        let none = vec![RANGE[0]; best.len()];
        if errors_worse(&costs, &choice.left_out_costs(&none)) <= AS_GOOD {
            best.copy_from_slice(&none);
        }
    }
    for i in 0..best.len() {
        loop {
            let mut tried = best.to_vec();
            tried[i] /= STEP;
            if tried[i] < RANGE[0] || !(errors_worse(&costs, &choice.left_out_costs(&tried)) <= AS_GOOD) {
                break;
            }
            best[i] = tried[i];
        }
    }
}

/// By how many standard errors of the difference `tried` is worse than `best`, from their costs part by part.
fn errors_worse(best: &[f64], tried: &[f64]) -> f64 {
    let n = best.len() as f64;
    let worse: Vec<f64> = tried.iter().zip(best).map(|(tried, best)| tried - best).collect();
    let mean = worse.iter().sum::<f64>() / n;
    let variance = worse.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / (n - 1.0);
    if mean == 0.0 { 0.0 } else { mean / (variance / n).sqrt() }
}

/// Wilcoxon's signed ranks (1945) of `tried` over `best`, in standard deviations: positive where most are worse.
fn signed_ranks(best: &[f64], tried: &[f64]) -> f64 {
    let mut worse: Vec<f64> = tried.iter().zip(best).map(|(tried, best)| tried - best).filter(|w| *w != 0.0).collect();
    worse.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let ranked = || (1..).map(f64::from).zip(&worse);
    let sum: f64 = ranked().map(|(rank, w)| rank * w.signum()).sum();
    let variance: f64 = ranked().map(|(rank, _)| rank * rank).sum();
    if variance > 0.0 { sum / variance.sqrt() } else { 0.0 }
}

/// Places of every field's free parameters among all free ones.
fn field_members(camera: &Camera, smoothness: &Smoothness) -> Vec<Vec<usize>> {
    let mut members = vec![Vec::new(); smoothness.fields.len()];
    let mut next = 0;
    for block in camera.blocks() {
        let layout = block.piece().and_then(|p| p.field());
        for i in 0..block.theta.len() {
            if !block.free[i] {
                continue;
            }
            if let Some(layout) = layout.filter(|l| i < l.parameter_count() - l.shared) {
                let field = (i % layout.per_node()) / layout.grid.bins;
                if let Some(at) = smoothness.fields.iter().position(|f| f.piece == block.name() && f.index == field) {
                    members[at].push(next);
                }
            }
            next += 1;
        }
    }
    members
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the sums of ranks over all signs, counted: for n = 5 the chance that all five are worse is 1/32.
    #[test]
    fn signed_ranks_have_their_deviation() {
        let best = [0.0; 5];
        assert_eq!(signed_ranks(&best, &best), 0.0);
        let mut values = Vec::new();
        for signs in 0..32_u32 {
            let tried: Vec<f64> =
                (0..5).map(|i| if signs >> i & 1 == 1 { 1.0 } else { -1.0 } * (1.0 + f64::from(i))).collect();
            values.push(signed_ranks(&best, &tried));
        }
        let mean = values.iter().sum::<f64>() / 32.0;
        let variance = values.iter().map(|v| v * v).sum::<f64>() / 32.0;
        assert!(mean.abs() < 1e-12 && (variance - 1.0).abs() < 1e-12, "{mean} {variance}");
        // One frame with a large loss is one frame.
        assert!(signed_ranks(&best, &[100.0, -1.0, -2.0, -3.0, -4.0]) < 0.0);
    }
}
