//! The random-effects model of a fleet: units scatter about a shared mean, and every unit's estimate about the unit.
//!
//! With the estimate y_i of unit i, its covariance C_i from the unit's own calibration, and the unit's true parameters θ_i,
//!
//! ```text
//! y_i | θ_i ~ N(θ_i, C_i),   θ_i ~ N(μ, T),   so   y_i ~ N(μ, S_i)   with   S_i = C_i + T.
//! ```
//!
//! T is estimated by restricted maximum likelihood (Patterson, Thompson 1971; multivariate meta-analysis: Jackson, White,
//! Thompson 2010). With W_i = S_i⁻¹, A = Σ W_i, μ̂ = A⁻¹ Σ W_i y_i and r_i = y_i − μ̂, twice the restricted log-likelihood is, up
//! to a constant,
//!
//! ```text
//! 2 ℓ = −Σ ln |S_i| − ln |A| − Σ r_iᵀ W_i r_i.
//! ```
//!
//! A diagonal T is found by Fisher scoring with bounds, with a step of the EM algorithm where scoring does not raise ℓ; common
//! factors, T = D + L Lᵀ, by the EM algorithm of factor analysis (Rubin, Thayer 1982), as many as Schwarz' criterion asks for.

use nalgebra::{DMatrix, DVector};

use crate::scaled::Scaled;

/// Most iterations of the search for a diagonal T.
const MOST_STEPS: usize = 200;
/// Halvings of a step that does not raise the likelihood.
const MOST_HALVINGS: usize = 14;
/// Rise of ℓ below which the search ends: far below what a test can see.
const SETTLED: f64 = 1e-7;
/// Variance, as a share of the data's, from which a search starts at least: at zero the EM step stays where it is.
const LEAST_START: f64 = 0.02;
/// Iterations of the EM algorithm for each number of common factors.
const EM_ITERATIONS: usize = 400;
/// Most common factors.
const MOST_FACTORS: usize = 3;

/// Estimate of some parameters from one unit.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitEstimate {
    /// Estimate.
    pub value: DVector<f64>,
    /// Covariance of the estimate about the unit's true parameters.
    pub covariance: DMatrix<f64>,
}

/// A fitted random-effects model.
#[derive(Debug, Clone)]
pub struct RandomEffects {
    /// Shared mean μ.
    pub mean: DVector<f64>,
    /// Covariance of the mean.
    pub mean_covariance: DMatrix<f64>,
    /// Covariance T between units.
    pub between: DMatrix<f64>,
    /// Standard deviations of the diagonal's estimates, from the expected information.
    pub variance_std: DVector<f64>,
    /// Number of common factors in T besides its diagonal.
    pub factors: usize,
    /// Restricted log-likelihood ℓ, up to a constant that depends on the units alone.
    pub log_likelihood: f64,
    /// Number of units.
    pub units: usize,
}

/// The data in units in which all parameters have variances near 1.
struct Data {
    scale: DVector<f64>,
    values: Vec<DVector<f64>>,
    covariances: Vec<DMatrix<f64>>,
}

/// The model at one T.
struct Evaluation {
    /// W_i.
    precisions: Vec<DMatrix<f64>>,
    /// A⁻¹.
    mean_covariance: DMatrix<f64>,
    mean: DVector<f64>,
    /// r_i.
    residuals: Vec<DVector<f64>>,
    log_likelihood: f64,
}

impl Data {
    /// `None` without units, or with an estimate or a variance that is no number.
    fn new(units: &[UnitEstimate]) -> Option<Self> {
        let n = units.first()?.value.len();
        let count = units.len() as f64;
        let mean = units.iter().fold(DVector::zeros(n), |sum, u| sum + &u.value) / count;
        let scale = DVector::from_fn(n, |k, _| {
            let variance = |u: &UnitEstimate| u.covariance[(k, k)] + (u.value[k] - mean[k]).powi(2);
            (units.iter().map(variance).sum::<f64>() / count).sqrt()
        });
        if !scale.iter().all(|s| s.is_finite() && *s > 0.0) {
            return None;
        }
        let scaled = |u: &UnitEstimate| DMatrix::from_fn(n, n, |i, k| u.covariance[(i, k)] / (scale[i] * scale[k]));
        // About the plain mean: means of many standard deviations would cost digits.
        let values = units.iter().map(|u| (&u.value - &mean).component_div(&scale)).collect();
        Some(Self { values, covariances: units.iter().map(scaled).collect(), scale })
    }

    fn size(&self) -> usize {
        self.scale.len()
    }

    fn evaluate(&self, between: &DMatrix<f64>) -> Option<Evaluation> {
        let n = self.size();
        let mut twice = 0.0;
        let mut precisions = Vec::with_capacity(self.values.len());
        let (mut total, mut pull) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for (value, covariance) in self.values.iter().zip(&self.covariances) {
            let factor = Scaled::new(&(covariance + between))?;
            twice -= factor.log_determinant();
            let precision = factor.inverse();
            total += &precision;
            pull += &precision * value;
            precisions.push(precision);
        }
        let factor = Scaled::new(&total)?;
        twice -= factor.log_determinant();
        let mean_covariance = factor.inverse();
        let mean = &mean_covariance * pull;
        let residuals: Vec<DVector<f64>> = self.values.iter().map(|value| value - &mean).collect();
        for (residual, precision) in residuals.iter().zip(&precisions) {
            twice -= residual.dot(&(precision * residual));
        }
        Some(Evaluation { precisions, mean_covariance, mean, residuals, log_likelihood: 0.5 * twice })
    }

    /// Gradient of ℓ by the diagonal of T, and the information on it.
    fn slope(&self, evaluation: &Evaluation) -> (DVector<f64>, DMatrix<f64>) {
        let n = self.size();
        let (mut gradient, mut information) = (DVector::zeros(n), DMatrix::zeros(n, n));
        for (precision, residual) in evaluation.precisions.iter().zip(&evaluation.residuals) {
            let pulled = precision * residual;
            let of_mean = precision * &evaluation.mean_covariance * precision;
            for k in 0..n {
                gradient[k] += 0.5 * (pulled[k] * pulled[k] - precision[(k, k)] + of_mean[(k, k)]);
            }
            let restricted = precision - of_mean;
            information += restricted.component_mul(&restricted) * 0.5;
        }
        (gradient, information)
    }

    /// Diagonal T of the largest restricted likelihood; components in `zero` stay at zero.
    fn diagonal(&self, start: &DVector<f64>, zero: &[bool]) -> Option<(DVector<f64>, Evaluation)> {
        let n = self.size();
        let mut variances = DVector::from_fn(n, |k, _| if zero[k] { 0.0 } else { start[k].max(0.0) });
        let mut evaluation = self.evaluate(&DMatrix::from_diagonal(&variances))?;
        for _ in 0..MOST_STEPS {
            let (gradient, information) = self.slope(&evaluation);
            let free: Vec<usize> =
                (0..n).filter(|k| !zero[*k] && (variances[*k] > 0.0 || gradient[*k] > 0.0)).collect();
            let before = evaluation.log_likelihood;
            if let Some((better, improved)) = self
                .scoring_step(&variances, &free, &gradient, &information, before)
                .or_else(|| self.em_step(&variances, &gradient, before))
            {
                (variances, evaluation) = (better, improved);
            }
            if evaluation.log_likelihood - before < SETTLED {
                break;
            }
        }
        Some((variances, evaluation))
    }

    fn scoring_step(
        &self,
        variances: &DVector<f64>,
        free: &[usize],
        gradient: &DVector<f64>,
        information: &DMatrix<f64>,
        before: f64,
    ) -> Option<(DVector<f64>, Evaluation)> {
        let of_free = DMatrix::from_fn(free.len(), free.len(), |i, k| information[(free[i], free[k])]);
        let slope = DVector::from_fn(free.len(), |i, _| gradient[free[i]]);
        let step = Scaled::with_ridge(&of_free, 1e-9)?.inverse() * slope;
        let mut share = 1.0;
        for _ in 0..MOST_HALVINGS {
            let mut moved = variances.clone();
            free.iter().zip(step.iter()).for_each(|(k, s)| moved[*k] = (moved[*k] + share * s).max(0.0));
            if let Some(evaluation) = self.evaluate(&DMatrix::from_diagonal(&moved))
                && evaluation.log_likelihood > before
            {
                return Some((moved, evaluation));
            }
            share *= 0.5;
        }
        None
    }

    /// A step of the EM algorithm, which never lowers ℓ: τ² + 2 τ⁴ ∂ℓ/∂τ² / n.
    fn em_step(
        &self,
        variances: &DVector<f64>,
        gradient: &DVector<f64>,
        before: f64,
    ) -> Option<(DVector<f64>, Evaluation)> {
        let count = self.values.len() as f64;
        let moved = variances.zip_map(gradient, |v, g| (v + 2.0 * v * v * g / count).max(0.0));
        let evaluation = self.evaluate(&DMatrix::from_diagonal(&moved))?;
        (evaluation.log_likelihood > before).then_some((moved, evaluation))
    }

    /// Where a search for a diagonal T starts: what noise does not explain of the variance.
    fn start(&self) -> DVector<f64> {
        let n = self.size();
        let count = self.values.len() as f64;
        DVector::from_fn(n, |k, _| {
            let mean_of = |f: &dyn Fn(usize) -> f64| (0..self.values.len()).map(f).sum::<f64>() / count;
            let mean = mean_of(&|i| self.values[i][k]);
            let variance = mean_of(&|i| (self.values[i][k] - mean).powi(2)) * count / (count - 1.0).max(1.0);
            let noise = mean_of(&|i| self.covariances[i][(k, k)]);
            (variance - noise).max(LEAST_START)
        })
    }

    /// One step of the EM algorithm for T = D + L Lᵀ.
    fn factor_step(
        &self,
        evaluation: &Evaluation,
        specific: &DVector<f64>,
        loadings: &DMatrix<f64>,
    ) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let n = self.size();
        let between = DMatrix::from_diagonal(specific) + loadings * loadings.transpose();
        // Second moments of the units' deviations from the mean given the data, the mean being estimated.
        let mut moments = DMatrix::zeros(n, n);
        for (precision, residual) in evaluation.precisions.iter().zip(&evaluation.residuals) {
            let deviation = &between * (precision * residual);
            let restricted = precision - precision * &evaluation.mean_covariance * precision;
            moments += &deviation * deviation.transpose() + &between - &between * restricted * &between;
        }
        moments /= self.values.len() as f64;
        let ridge = DMatrix::from_diagonal(&specific.map(|v| v.max(1e-9))) + loadings * loadings.transpose();
        let beta = loadings.transpose() * Scaled::new(&ridge)?.inverse();
        let count = loadings.ncols();
        let of_factors = DMatrix::identity(count, count) - &beta * loadings + &beta * &moments * beta.transpose();
        let moved = &moments * beta.transpose() * Scaled::new(&of_factors)?.inverse();
        let residual_variances = (&moments - &moved * &beta * &moments).diagonal();
        Some((residual_variances.zip_map(specific, |v, before| if before > 0.0 { v.max(0.0) } else { 0.0 }), moved))
    }

    /// T with one more factor than `loadings` has, found from where the residuals covary most.
    fn with_factor(
        &self,
        specific: &DVector<f64>,
        loadings: &DMatrix<f64>,
    ) -> Option<(DVector<f64>, DMatrix<f64>, Evaluation)> {
        let n = self.size();
        let evaluation = self.evaluate(&(DMatrix::from_diagonal(specific) + loadings * loadings.transpose()))?;
        // The gradient of ℓ by T, in the scale of the scatter: its largest eigenvector is the steepest factor.
        let mut gradient = DMatrix::zeros(n, n);
        for (precision, residual) in evaluation.precisions.iter().zip(&evaluation.residuals) {
            let pulled = precision * residual;
            gradient += &pulled * pulled.transpose() - precision + precision * &evaluation.mean_covariance * precision;
        }
        let scale =
            DVector::from_fn(n, |k, _| (specific[k] + loadings.row(k).norm_squared()).max(LEAST_START * 0.1).sqrt());
        let scaled = DMatrix::from_fn(n, n, |i, k| scale[i] * gradient[(i, k)] * scale[k]);
        let eigen = scaled.symmetric_eigen();
        let steepest = eigen.eigenvalues.imax();
        let direction = eigen.eigenvectors.column(steepest).component_mul(&scale) * 0.5;
        let mut moved = loadings.clone().insert_column(loadings.ncols(), 0.0);
        moved.set_column(loadings.ncols(), &direction);
        let (mut specific, mut loadings) = (specific.map(|v| if v > 0.0 { 0.8 * v } else { 0.0 }), moved);
        let mut evaluation = self.evaluate(&(DMatrix::from_diagonal(&specific) + &loadings * loadings.transpose()))?;
        for _ in 0..EM_ITERATIONS {
            let before = evaluation.log_likelihood;
            (specific, loadings) = self.factor_step(&evaluation, &specific, &loadings)?;
            evaluation = self.evaluate(&(DMatrix::from_diagonal(&specific) + &loadings * loadings.transpose()))?;
            if (evaluation.log_likelihood - before).abs() < 1e-5 {
                break;
            }
        }
        Some((specific, loadings, evaluation))
    }

    fn result(
        &self,
        mean: &DVector<f64>,
        between: &DMatrix<f64>,
        factors: usize,
        evaluation: &Evaluation,
    ) -> RandomEffects {
        let n = self.size();
        let unscaled = |m: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, k| m[(i, k)] * self.scale[i] * self.scale[k]);
        let (_, information) = self.slope(evaluation);
        let variance_std = match Scaled::with_ridge(&information, 1e-9) {
            Some(factor) => factor.inverse().diagonal().map(f64::sqrt),
            None => DVector::from_element(n, f64::INFINITY),
        };
        RandomEffects {
            mean: mean + evaluation.mean.component_mul(&self.scale),
            mean_covariance: unscaled(&evaluation.mean_covariance),
            between: unscaled(between),
            variance_std: variance_std.component_mul(&self.scale).component_mul(&self.scale),
            factors,
            log_likelihood: evaluation.log_likelihood,
            units: self.values.len(),
        }
    }
}

/// The plain mean of the units' estimates, about which [`Data`] is centred.
fn plain_mean(units: &[UnitEstimate]) -> DVector<f64> {
    let n = units.first().map_or(0, |u| u.value.len());
    units.iter().fold(DVector::zeros(n), |sum, u| sum + &u.value) / units.len().max(1) as f64
}

impl RandomEffects {
    /// The model with a diagonal T; `None` where the estimates are no numbers or a covariance is not positive definite.
    pub fn diagonal(units: &[UnitEstimate]) -> Option<Self> {
        let data = Data::new(units)?;
        let (variances, evaluation) = data.diagonal(&data.start(), &vec![false; data.size()])?;
        Some(data.result(&plain_mean(units), &DMatrix::from_diagonal(&variances), 0, &evaluation))
    }

    /// The model without scatter between units: T = 0.
    pub fn without_scatter(units: &[UnitEstimate]) -> Option<Self> {
        let data = Data::new(units)?;
        let zero = DMatrix::zeros(data.size(), data.size());
        let evaluation = data.evaluate(&zero)?;
        Some(data.result(&plain_mean(units), &zero, 0, &evaluation))
    }

    /// Twice the fall of the restricted log-likelihood when each parameter's variance between units is zero, all others being
    /// free.
    pub fn variance_ratios(&self, units: &[UnitEstimate]) -> Vec<f64> {
        let Some(data) = Data::new(units) else { return Vec::new() };
        let n = data.size();
        let start = DVector::from_fn(n, |k, _| self.between[(k, k)] / data.scale[k].powi(2));
        let whole = data
            .diagonal(&start, &vec![false; n])
            .map_or(self.log_likelihood, |(_, evaluation)| evaluation.log_likelihood);
        let without = |k: usize| {
            if start[k] <= 0.0 {
                return 0.0;
            }
            let zero: Vec<bool> = (0..n).map(|i| i == k).collect();
            data.diagonal(&start.map(|v| v.max(1e-4)), &zero)
                .map_or(0.0, |(_, evaluation)| 2.0 * (whole - evaluation.log_likelihood).max(0.0))
        };
        use rayon::prelude::*;
        (0..n).into_par_iter().map(without).collect()
    }

    /// The model with as many common factors in T as Schwarz' criterion asks for.
    #[must_use]
    pub fn with_factors(self, units: &[UnitEstimate]) -> Self {
        let Some(data) = Data::new(units) else { return self };
        let n = data.size();
        let mut specific = DVector::from_fn(n, |k, _| self.between[(k, k)] / data.scale[k].powi(2));
        let mut loadings = DMatrix::zeros(n, 0);
        let mut best = self;
        while loadings.ncols() < MOST_FACTORS.min(n / 2) {
            let Some((next_own, next_loadings, evaluation)) = data.with_factor(&specific, &loadings) else { break };
            // A factor has a loading for every parameter that scatters, less the rotations among factors.
            let scattering = specific.iter().filter(|v| **v > 0.0).count().max(1);
            let parameters = scattering.saturating_sub(loadings.ncols()) as f64;
            if 2.0 * (evaluation.log_likelihood - best.log_likelihood) <= parameters * (units.len() as f64).ln() {
                break;
            }
            let between = DMatrix::from_diagonal(&next_own) + &next_loadings * next_loadings.transpose();
            best = data.result(&plain_mean(units), &between, next_loadings.ncols(), &evaluation);
            (specific, loadings) = (next_own, next_loadings);
        }
        best
    }

    /// Twice the rise of the log-likelihood of the units' observations over that of parameters that are zero in every unit;
    /// `units` are departures from nothing. Unlike statistics of the mean alone it can be compared between models with different
    /// parameters.
    pub fn gain_over_nothing(&self, units: &[UnitEstimate]) -> Option<f64> {
        let mut gain = 0.0;
        for unit in units {
            let (within, whole) = (Scaled::new(&unit.covariance)?, Scaled::new(&(&unit.covariance + &self.between))?);
            let residual = &unit.value - &self.mean;
            gain += unit.value.dot(&(within.inverse() * &unit.value)) + within.log_determinant();
            gain -= residual.dot(&(whole.inverse() * &residual)) + whole.log_determinant();
        }
        Some(gain)
    }

    /// The estimate of a unit with the others as prior: μ + T (C + T)⁻¹ (y − μ).
    pub fn shrunken(&self, unit: &UnitEstimate) -> DVector<f64> {
        match Scaled::new(&(&unit.covariance + &self.between)) {
            Some(factor) => &self.mean + &self.between * factor.inverse() * (&unit.value - &self.mean),
            None => unit.value.clone(),
        }
    }

    /// Covariance of a further unit's true parameters about the mean: T, enlarged by what is not known of it, and the covariance
    /// of the mean. A variance that was not seen is taken as one standard deviation of its estimate.
    pub fn of_next_unit(&self) -> DMatrix<f64> {
        let degrees = self.units as f64 - 1.0;
        // Variance of Student's t distribution, which an estimated variance leads to.
        let widened = if degrees > 3.0 { degrees / (degrees - 2.0) } else { 3.0 };
        let mut covariance = &self.between * widened + &self.mean_covariance;
        for k in 0..self.mean.len() {
            let unseen = self.variance_std[k] - self.between[(k, k)];
            if unseen.is_finite() {
                covariance[(k, k)] += unseen.max(0.0);
            }
        }
        covariance
    }
}
