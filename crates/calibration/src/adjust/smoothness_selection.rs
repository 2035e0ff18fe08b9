//! Choice of the strength of the smoothness prior: the roughness of every field at which held-out frames are predicted best.
//!
//! Cross-validation on the linearised adjustment: the normal equations of each frame, its own pose eliminated, are summed over
//! any set of frames and added to the prior, which gives the estimate from that set without another adjustment. Held-out
//! frames are scored on depth, with poses from the image alone. Marginal likelihood is no alternative: it assumes independent
//! noise, but depth errors within a frame are correlated, and it would take a frame's own error for signal.

use depthcal_model::Camera;
use nalgebra::{DMatrix, DVector};

use super::field_thresholds::FieldThresholds;
use super::smoothness_prior::{Smoothness, differences, ridge, rows_of_smooth_functions};

/// Normal equations of one frame in the camera's free parameters, for fitting and for prediction.
#[derive(Debug, Clone)]
pub struct FrameInformation {
    /// N and g of the cost c + gᵀδ + ½ δᵀNδ where the frame is fitted: image and depth, the pose eliminated.
    pub fitted: (DMatrix<f64>, DVector<f64>),
    /// N and g where the frame is held out: the cost of its depth alone, with the pose from its image.
    pub held_out: (DMatrix<f64>, DVector<f64>),
}

impl FrameInformation {
    /// Adds what `frames` say where they are fitted to a normal matrix and a gradient, in their order.
    pub fn added<'a>(
        (mut normal, mut gradient): (DMatrix<f64>, DVector<f64>),
        frames: impl Iterator<Item = &'a Self>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        for frame in frames {
            normal += &frame.fitted.0;
            gradient += &frame.fitted.1;
        }
        (normal, gradient)
    }

    /// From normal matrix and gradient of image and of depth. The columns of both are the pose, `pose` components, and then the
    /// camera's free parameters. Where the frame is fitted, depth counts `depth_weight` times.
    pub fn new(
        image: &(DMatrix<f64>, DVector<f64>),
        depth: &(DMatrix<f64>, DVector<f64>),
        pose: usize,
        depth_weight: f64,
    ) -> Self {
        let both = (&image.0 + depth_weight * &depth.0, &image.1 + depth_weight * &depth.1);
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
            held_out: reduced(image, depth).unwrap_or_else(nothing),
        }
    }

    /// The frame's cost when it is held out, up to a constant, at the estimate δ; infinite without an estimate.
    pub(super) fn cost(&self, estimate: Option<&DVector<f64>>) -> f64 {
        let (normal, gradient) = &self.held_out;
        estimate.map_or(f64::INFINITY, |step| gradient.dot(step) + 0.5 * step.dot(&(normal * step)))
    }
}

/// Factors by which the search changes a roughness, coarse to fine.
const SEARCH_FACTORS: [f64; 3] = [8.0, 3.0, 1.5];
/// Factor by which the simplest of equally good values is searched.
const SIMPLIFYING_FACTOR: f64 = 1.5;

/// Precision matrix of the prior of a camera's fields, and its pull on the free parameters (the gradient of its cost) at their
/// present values. `frames` gives the number of free parameters.
pub(super) fn prior(
    camera: &Camera,
    smoothness: &Smoothness,
    frames: &[FrameInformation],
) -> (DMatrix<f64>, DVector<f64>) {
    let problem = CrossValidation::new(camera, smoothness, frames);
    let roughness: Vec<f64> = smoothness.fields.iter().map(|f| f.roughness).chain([smoothness.ridge]).collect();
    let precision = problem.precision(&roughness);
    let pull = &precision * &problem.deviation;
    (precision, pull)
}

/// The cross-validation problem over the camera's free parameters.
struct CrossValidation<'a> {
    frames: &'a [FrameInformation],
    /// Normal matrix of smoothness at roughness 1, one per field.
    penalties: Vec<DMatrix<f64>>,
    /// Normal matrix of the smooth functions that pieces have themselves.
    given: DMatrix<f64>,
    /// Normal matrix of the ridge at standard deviation 1.
    ridge: DMatrix<f64>,
    /// The ridge's standard deviation where it is not chosen.
    fixed_ridge: Option<f64>,
    /// Present deviation of the free parameters from their nominal values.
    deviation: DVector<f64>,
    /// Sums over the frames of every fold.
    folds: Vec<FrameInformation>,
    /// N and g of all frames fitted.
    total: (DMatrix<f64>, DVector<f64>),
    thresholds: FieldThresholds,
}

/// Every parameter's place among the free parameters of a camera, and the deviations of these from their nominal values.
struct FreeParameters {
    places: Vec<Option<usize>>,
    deviation: DVector<f64>,
}

impl FreeParameters {
    fn of(camera: &Camera) -> Self {
        let (mut places, mut deviation) = (Vec::new(), Vec::new());
        for block in camera.blocks() {
            for (i, parameter) in block.parameters().iter().enumerate() {
                places.push(block.free[i].then_some(deviation.len()));
                if block.free[i] {
                    deviation.push(block.theta[i] - parameter.nominal);
                }
            }
        }
        Self { places, deviation: DVector::from_vec(deviation) }
    }
}

/// Precision matrix of the smooth functions that pieces of a camera have themselves, over its free parameters, and their pull at
/// the parameters' present values (the gradient of their cost).
pub(crate) fn prior_of_smooth_functions(camera: &Camera) -> (DMatrix<f64>, DVector<f64>) {
    let free = FreeParameters::of(camera);
    let precision = precision_of_all_smooth_functions(camera, &free);
    let pull = &precision * free.deviation;
    (precision, pull)
}

fn precision_of_all_smooth_functions(camera: &Camera, free: &FreeParameters) -> DMatrix<f64> {
    let count = free.deviation.len();
    let mut precision = DMatrix::zeros(count, count);
    for (block, range) in camera.blocks_with_ranges() {
        let rows = rows_of_smooth_functions(block);
        rows.iter().for_each(|row| row.add_to(&mut precision, &free.places[range.clone()], |_| 1.0));
    }
    precision
}

impl<'a> CrossValidation<'a> {
    fn new(camera: &Camera, smoothness: &Smoothness, frames: &'a [FrameInformation]) -> Self {
        let n = frames.first().map_or(0, |f| f.fitted.1.len());
        let free = FreeParameters::of(camera);
        let mut penalties = vec![DMatrix::zeros(n, n); smoothness.fields.len()];
        let mut ridge_matrix = DMatrix::zeros(n, n);
        for (block, range) in camera.blocks_with_ranges() {
            let Some(layout) = block.piece().and_then(|p| p.field()) else { continue };
            let scale = |i: usize| block.parameters()[i].scale;
            for row in differences(&layout, &block.free, |_| 1.0) {
                let field = (row.entries[0].0 % layout.per_node()) / layout.grid.bins;
                let place = smoothness.fields.iter().position(|f| f.piece == block.name() && f.index == field);
                if let Some(place) = place {
                    row.add_to(&mut penalties[place], &free.places[range.clone()], scale);
                }
            }
            for row in ridge(&layout, &block.free, 1.0) {
                row.add_to(&mut ridge_matrix, &free.places[range.clone()], scale);
            }
        }
        let count = frames.len().clamp(1, smoothness.thresholds.most_folds);
        let zero = || (DMatrix::zeros(n, n), DVector::zeros(n));
        let mut folds = vec![FrameInformation { fitted: zero(), held_out: zero() }; count];
        let mut total = zero();
        let add = |to: &mut (DMatrix<f64>, DVector<f64>), what: &(DMatrix<f64>, DVector<f64>)| {
            to.0 += &what.0;
            to.1 += &what.1;
        };
        for (i, frame) in frames.iter().enumerate() {
            add(&mut folds[i % count].fitted, &frame.fitted);
            add(&mut folds[i % count].held_out, &frame.held_out);
            add(&mut total, &frame.fitted);
        }
        let given = precision_of_all_smooth_functions(camera, &free);
        let FreeParameters { deviation, .. } = free;
        let fixed_ridge = (!smoothness.with_projective).then_some(smoothness.ridge);
        let thresholds = smoothness.thresholds;
        Self { frames, penalties, given, ridge: ridge_matrix, fixed_ridge, deviation, folds, total, thresholds }
    }

    /// Precision matrix of the prior; `roughness` has one value per field and then, where it is chosen, the ridge's standard
    /// deviation.
    fn precision(&self, roughness: &[f64]) -> DMatrix<f64> {
        let ridge = self.fixed_ridge.unwrap_or(roughness[roughness.len() - 1]);
        let mut precision = &self.ridge / (ridge * ridge) + &self.given;
        for (penalty, r) in self.penalties.iter().zip(roughness) {
            precision += penalty / (r * r);
        }
        precision
    }

    /// Estimates without each fold's frames; `None` where the others do not determine the parameters.
    fn estimates(&self, roughness: &[f64]) -> Vec<Option<DVector<f64>>> {
        let prior = self.precision(roughness);
        let pull = &prior * &self.deviation;
        let estimate = |FrameInformation { fitted, .. }: &FrameInformation| {
            let normal = &self.total.0 - &fitted.0 + &prior;
            solve_scaled(normal, &-(&self.total.1 - &fitted.1 + &pull))
        };
        self.folds.iter().map(estimate).collect()
    }

    /// Cost of the held-out frames of every fold, up to a constant.
    fn held_out_costs(&self, roughness: &[f64]) -> Vec<f64> {
        self.folds.iter().zip(self.estimates(roughness)).map(|(fold, by)| fold.cost(by.as_ref())).collect()
    }

    /// Cost of every frame when it is held out, up to a constant.
    fn held_out_costs_by_frame(&self, roughness: &[f64]) -> Vec<f64> {
        let estimates = self.estimates(roughness);
        self.frames.iter().zip(estimates.iter().cycle()).map(|(frame, by)| frame.cost(by.as_ref())).collect()
    }

    /// Effective number of parameters of every field: tr(Σ N) over its parameters, Σ the posterior covariance; `fields` lists
    /// the places of each field's parameters among the free ones.
    fn effective(&self, roughness: &[f64], fields: &[Vec<usize>]) -> Option<Vec<f64>> {
        let prior = self.precision(roughness);
        let posterior = inverse_scaled(&self.total.0 + &prior)?;
        let share = DMatrix::identity(prior.nrows(), prior.ncols()) - posterior * prior;
        Some(fields.iter().map(|own| own.iter().map(|i| share[(*i, *i)]).sum()).collect())
    }
}

/// Solution of a symmetric positive definite system whose unknowns differ in size by many orders of magnitude; `None` where it
/// is not positive definite.
pub(crate) fn solve_scaled(mut matrix: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let scale = scale(&mut matrix);
    Some(matrix.cholesky()?.solve(&right.component_mul(&scale)).component_mul(&scale))
}

/// Inverse of such a matrix.
fn inverse_scaled(mut matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = scale(&mut matrix);
    let inverse = matrix.cholesky()?.inverse();
    Some(DMatrix::from_fn(inverse.nrows(), inverse.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

/// Scales rows and columns so that the diagonal is 1; returns the factors.
fn scale(matrix: &mut DMatrix<f64>) -> DVector<f64> {
    let scale = DVector::from_fn(matrix.nrows(), |i, _| 1.0 / matrix[(i, i)].max(f64::MIN_POSITIVE).sqrt());
    for j in 0..matrix.ncols() {
        for i in 0..matrix.nrows() {
            matrix[(i, j)] *= scale[i] * scale[j];
        }
    }
    scale
}

/// The smoothness at which held-out frames are predicted best, with the effective number of parameters of every field; the
/// smoothness as it is where there are fewer than two frames.
pub fn choose(camera: &Camera, smoothness: &Smoothness, frames: &[FrameInformation]) -> Smoothness {
    let problem = CrossValidation::new(camera, smoothness, frames);
    let mut best: Vec<f64> = smoothness.fields.iter().map(|f| f.roughness).collect();
    best.extend(smoothness.with_projective.then_some(smoothness.ridge));
    if problem.frames.len() < 2 {
        return smoothness.clone();
    }
    let range = smoothness.thresholds.roughness_range;
    let mut costs = problem.held_out_costs(&best);
    for factor in SEARCH_FACTORS {
        loop {
            let mut moved = false;
            for i in 0..best.len() {
                for direction in [1.0 / factor, factor] {
                    let mut tried = best.clone();
                    tried[i] = (tried[i] * direction).clamp(range[0], range[1]);
                    if tried[i] == best[i] {
                        continue;
                    }
                    let next = problem.held_out_costs(&tried);
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
    simplest(&problem, &mut best, costs);
    let mut chosen = smoothness.clone();
    let members: Vec<Vec<usize>> = field_members(camera, smoothness);
    let effective = problem.effective(&best, &members);
    if smoothness.with_projective {
        chosen.ridge = best[smoothness.fields.len()];
    }
    for (i, field) in chosen.fields.iter_mut().enumerate() {
        field.roughness = best[i];
        field.effective = effective.as_ref().map(|e| e[i]);
    }
    chosen
}

/// Replaces `best`, whose held-out costs by fold are `costs`, by the simplest prior that predicts as well.
///
/// Fields are flat unless most held-out frames prefer the rough ones: a signed-rank test, in which a few frames with errors of
/// their own do not decide, as they would over sums of squares. Then the one-standard-error rule (Breiman, Friedman, Olshen,
/// Stone 1984, section 3.4.3): of all priors whose held-out cost is worse by no more than the standard error of the difference
/// the simplest is taken, that is the one with the smoothest fields and, jointly with D, the smallest ridge.
fn simplest(problem: &CrossValidation<'_>, best: &mut [f64], mut costs: Vec<f64>) {
    let FieldThresholds { roughness_range: [smoothest, _], equal_standard_errors, .. } = problem.thresholds;
    let mut flat = best.to_vec();
    flat[..problem.penalties.len()].fill(smoothest);
    let [by_frame, flat_by_frame] = [&*best, &flat].map(|r| problem.held_out_costs_by_frame(r));
    if signed_ranks(&by_frame, &flat_by_frame) <= problem.thresholds.least_signed_rank {
        best.copy_from_slice(&flat);
        costs = problem.held_out_costs(&flat);
        let none = vec![smoothest; best.len()];
        if errors_worse(&costs, &problem.held_out_costs(&none)) <= equal_standard_errors {
            best.copy_from_slice(&none);
        }
    }
    for i in 0..best.len() {
        loop {
            let mut tried = best.to_vec();
            tried[i] /= SIMPLIFYING_FACTOR;
            if tried[i] < smoothest || !(errors_worse(&costs, &problem.held_out_costs(&tried)) <= equal_standard_errors)
            {
                break;
            }
            best[i] = tried[i];
        }
    }
}

/// Mean of `tried` − `best`, costs fold by fold, in standard errors.
pub(crate) fn errors_worse(best: &[f64], tried: &[f64]) -> f64 {
    let n = best.len() as f64;
    let worse: Vec<f64> = tried.iter().zip(best).map(|(tried, best)| tried - best).collect();
    let mean = worse.iter().sum::<f64>() / n;
    let variance = worse.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / (n - 1.0);
    if mean == 0.0 { 0.0 } else { mean / (variance / n).sqrt() }
}

/// Wilcoxon's signed-rank statistic (1945) of `tried` − `best`, costs frame by frame, in standard deviations: positive where
/// most are worse.
fn signed_ranks(best: &[f64], tried: &[f64]) -> f64 {
    let mut worse: Vec<f64> = tried.iter().zip(best).map(|(tried, best)| tried - best).filter(|w| *w != 0.0).collect();
    worse.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let ranked = || (1..).map(f64::from).zip(&worse);
    let sum: f64 = ranked().map(|(rank, w)| rank * w.signum()).sum();
    let variance: f64 = ranked().map(|(rank, _)| rank * rank).sum();
    if variance > 0.0 { sum / variance.sqrt() } else { 0.0 }
}

/// Places of every field's free parameters among the camera's free parameters.
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
                if let Some(field_index) =
                    smoothness.fields.iter().position(|f| f.piece == block.name() && f.index == field)
                {
                    members[field_index].push(next);
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

    /// Over all 32 patterns of signs of five differences the statistic has mean 0 and variance 1.
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
        // One frame with a large difference counts as one frame.
        assert!(signed_ranks(&best, &[100.0, -1.0, -2.0, -3.0, -4.0]) < 0.0);
    }
}
