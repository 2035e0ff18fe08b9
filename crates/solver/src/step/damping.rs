//! Damping and trust-region radius, and how they follow accepted and rejected steps.

use crate::step::options::{Damping, Method, Scaling};

/// Minimum factor by which an accepted step multiplies μ. Nielsen's 1/3 slows the last iterations down.
const MIN_FACTOR: f64 = 0.1;
const MIN_RADIUS_FACTOR: f64 = 1.0 / 3.0;
/// Damping at which steps are too short to matter.
const MAX_DAMPING: f64 = 1e20;
/// Fraction of the Gauss–Newton step at which steps are too short to matter.
const MIN_FRACTION: f64 = 1e-15;

/// Updates the diagonal of D² from the diagonal of H.
pub(crate) fn update_scaling(damping: Damping, scaling: Scaling, diagonal: &[f64], d2: &mut [f64]) {
    for (d2, h) in d2.iter_mut().zip(diagonal) {
        *d2 = match (damping, scaling) {
            (Damping::Nielsen { .. } | Damping::WhenNeeded { .. }, Scaling::Jacobi) => d2.max(*h),
            (_, Scaling::None) => 1.0,
            (Damping::Radius { .. }, Scaling::Jacobi) => *h,
        };
        if *d2 == 0.0 {
            // A component without influence on the residuals does not move.
            *d2 = 1.0;
        }
    }
}

/// The damping μ and the trust-region radius.
#[derive(Clone, Debug)]
pub(crate) struct StepControl {
    method: Method,
    damping: Damping,
    /// μ; 0 until [`start`](Self::start).
    pub mu: f64,
    /// Factor by which the next rejected step multiplies μ.
    pub nu: f64,
    /// Radius Δ of the dog-leg, or the fraction of the full step of Gauss–Newton.
    pub radius: f64,
    /// Damping below which [`Damping::WhenNeeded`] leaves it away, and with which it begins; 0 for other rules.
    threshold: f64,
}

impl StepControl {
    pub fn new(method: Method, damping: Damping) -> Self {
        Self { method, damping, mu: 0.0, nu: 2.0, radius: 0.0, threshold: 0.0 }
    }

    /// Sets the radius at the start of a run.
    pub fn reset_radius(&mut self) {
        self.radius = match self.method {
            Method::DogLeg { radius } => radius,
            _ => 1.0,
        };
    }

    /// Sets μ before the first step, unless it is known from an earlier run. `least` is the smallest useful damping.
    pub fn start(&mut self, diagonal: &[f64], d2: &[f64], least: f64) {
        let scaled = || diagonal.iter().zip(d2).map(|(h, d2)| h / d2).fold(0.0, f64::max);
        if let Damping::WhenNeeded { tau } = self.damping {
            self.threshold = tau * scaled();
        }
        if self.mu > 0.0 {
            return;
        }
        let start = match self.damping {
            _ if self.method != Method::LevenbergMarquardt => least,
            Damping::Nielsen { tau } => tau * scaled(),
            Damping::WhenNeeded { .. } => least,
            Damping::Radius { initial, .. } => 1.0 / initial,
        };
        self.mu = start.max(least);
    }

    /// After a step with this gain ratio and length ‖D δ‖ was accepted. `least` is the smallest useful damping.
    pub fn step_accepted(&mut self, gain_ratio: f64, length: f64, least: f64) {
        match self.method {
            Method::LevenbergMarquardt if gain_ratio.is_finite() => {
                let (min_factor, min_damping) = match self.damping {
                    Damping::Nielsen { .. } | Damping::WhenNeeded { .. } => (MIN_FACTOR, least),
                    Damping::Radius { max, .. } => (MIN_RADIUS_FACTOR, (1.0 / max).max(least)),
                };
                let factor = (1.0 - (2.0 * gain_ratio - 1.0).powi(3)).max(min_factor);
                self.mu = (self.mu * factor).max(min_damping);
                if self.mu < self.threshold {
                    self.mu = least;
                }
            }
            Method::DogLeg { .. } if gain_ratio > 0.75 => self.radius = self.radius.max(3.0 * length),
            Method::DogLeg { .. } if gain_ratio < 0.25 => self.radius *= 0.5,
            Method::GaussNewton => self.radius = 1.0,
            _ => {}
        }
        self.nu = 2.0;
    }

    /// After a step of this length ‖D δ‖ was rejected.
    pub fn step_rejected(&mut self, length: f64) {
        match self.method {
            Method::LevenbergMarquardt => self.increase_damping(),
            // The region has to become smaller than the rejected step.
            Method::DogLeg { .. } => self.radius = 0.5 * self.radius.min(length),
            Method::GaussNewton => self.radius *= 0.5,
        }
    }

    /// After no step was found because H + μ D² is not positive definite in floating-point arithmetic, or after a
    /// rejected step.
    pub fn increase_damping(&mut self) {
        if self.mu < self.threshold {
            self.mu = self.threshold;
            return;
        }
        self.mu *= self.nu;
        self.nu *= 2.0;
    }

    /// Whether steps have become too short to matter.
    pub fn is_stalled(&self) -> bool {
        let tiny = match self.method {
            Method::LevenbergMarquardt => false,
            Method::DogLeg { .. } => self.radius <= 1.0 / MAX_DAMPING,
            Method::GaussNewton => self.radius <= MIN_FRACTION,
        };
        tiny || self.mu > MAX_DAMPING
    }
}
