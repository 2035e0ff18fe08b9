//! Robust Levenberg–Marquardt for fits with a handful of parameters.

use nalgebra::{SMatrix, SVector};

/// A model of grey values with P parameters.
pub(super) trait Model<const P: usize> {
    /// Number of pixels.
    fn len(&self) -> usize;
    /// Measured minus modelled grey value of pixel `i`, and the derivatives of the modelled value.
    fn residual(&self, parameters: &SVector<f64, P>, i: usize) -> (f64, SVector<f64, P>);
    /// Whether parameters are within the model's domain; steps that leave it are shortened.
    fn is_valid(&self, parameters: &SVector<f64, P>) -> bool;
}

/// A Gaussian prior on one parameter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Prior {
    pub(super) index: usize,
    pub(super) mean: f64,
    pub(super) sigma: f64,
}

/// A finished fit.
pub(super) struct Fit<const P: usize> {
    pub(super) parameters: SVector<f64, P>,
    pub(super) covariance: SMatrix<f64, P, P>,
    /// Standard deviation of a pixel's grey value about the model.
    pub(super) noise: f64,
}

/// Threshold of Huber's loss, standard deviations.
const HUBER: f64 = 2.5;
/// Relative change of the cost at which the fit has converged.
const TOLERANCE: f64 = 1e-7;

/// Fits the model from `start`. `grain` is the least standard deviation of the grey values to assume (quantisation).
/// `None` when the pixels do not determine the parameters.
pub(super) fn fit<const P: usize>(
    model: &impl Model<P>,
    start: SVector<f64, P>,
    priors: &[Prior],
    grain: f64,
    iterations: usize,
) -> Option<Fit<P>> {
    if model.len() < P + 2 {
        return None;
    }
    let mut parameters = start;
    let mut damping = 1e-3;
    let mut noise = spread(model, &parameters, grain);
    for _ in 0..iterations {
        let system = System::new(model, &parameters, priors, noise);
        let mut moved = false;
        for _ in 0..8 {
            let mut damped = system.normal;
            for i in 0..P {
                damped[(i, i)] += damping * system.normal[(i, i)].max(1e-12);
            }
            let step = damped.cholesky()?.solve(&system.gradient);
            let next = parameters + step;
            if next.iter().all(|v| v.is_finite())
                && model.is_valid(&next)
                && cost(model, &next, priors, noise) <= system.cost
            {
                parameters = next;
                damping = (damping * 0.1).max(1e-9);
                moved = true;
                break;
            }
            damping *= 10.0;
        }
        let after = cost(model, &parameters, priors, noise);
        noise = spread(model, &parameters, grain);
        if !moved || system.cost - after < TOLERANCE * system.cost {
            break;
        }
    }
    let system = System::new(model, &parameters, priors, noise);
    let freedom = (system.weight - P as f64).max(1.0);
    let noise = (noise * noise * system.squares / freedom).sqrt().max(grain);
    let covariance = System::new(model, &parameters, priors, noise).normal.cholesky()?.inverse();
    Some(Fit { parameters, covariance, noise })
}

/// Weighted normal equations, in units of the noise.
struct System<const P: usize> {
    normal: SMatrix<f64, P, P>,
    gradient: SVector<f64, P>,
    cost: f64,
    /// Sum of the weights.
    weight: f64,
    /// Weighted sum of the squares of the residuals over the noise.
    squares: f64,
}

impl<const P: usize> System<P> {
    fn new(model: &impl Model<P>, parameters: &SVector<f64, P>, priors: &[Prior], noise: f64) -> System<P> {
        let mut system: System<P> =
            System { normal: SMatrix::zeros(), gradient: SVector::zeros(), cost: 0.0, weight: 0.0, squares: 0.0 };
        for i in 0..model.len() {
            let (residual, derivatives) = model.residual(parameters, i);
            let r = residual / noise;
            let weight = if r.abs() > HUBER { HUBER / r.abs() } else { 1.0 };
            let scaled = derivatives / noise;
            system.normal.ger(weight, &scaled, &scaled, 1.0);
            system.gradient.axpy(weight * r, &scaled, 1.0);
            system.cost += huber(r);
            system.weight += weight;
            system.squares += weight * r * r;
        }
        for prior in priors {
            let r = (prior.mean - parameters[prior.index]) / prior.sigma;
            system.normal[(prior.index, prior.index)] += 1.0 / (prior.sigma * prior.sigma);
            system.gradient[prior.index] += r / prior.sigma;
            system.cost += r * r / 2.0;
        }
        system
    }
}

fn huber(r: f64) -> f64 {
    if r.abs() > HUBER { HUBER * (r.abs() - HUBER / 2.0) } else { r * r / 2.0 }
}

fn cost<const P: usize>(model: &impl Model<P>, parameters: &SVector<f64, P>, priors: &[Prior], noise: f64) -> f64 {
    let data: f64 = (0..model.len()).map(|i| huber(model.residual(parameters, i).0 / noise)).sum();
    let prior: f64 = priors.iter().map(|p| ((p.mean - parameters[p.index]) / p.sigma).powi(2) / 2.0).sum();
    data + prior
}

/// Robust standard deviation of the residuals, from the median of their absolute values.
fn spread<const P: usize>(model: &impl Model<P>, parameters: &SVector<f64, P>, grain: f64) -> f64 {
    let mut sizes: Vec<f64> = (0..model.len()).map(|i| model.residual(parameters, i).0.abs()).collect();
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    (1.4826 * *median).max(grain)
}

/// The error function, to 1.5·10⁻⁷ (Abramowitz and Stegun 1964, 7.1.26), and its derivative.
pub(super) fn erf(x: f64) -> (f64, f64) {
    let gauss = (-x * x).exp();
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let tail = t
        * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))))
        * gauss;
    ((1.0 - tail).copysign(x), std::f64::consts::FRAC_2_SQRT_PI * gauss)
}
