//! How the damping or the trust region follows the success of steps.

use super::LevenbergMarquardt;
use crate::options::{Damping, Method, Scaling};
use crate::report::Termination;

/// By what a good step multiplies the damping at least. A third, as Nielsen has it, slows the last iterations down.
const MIN_FACTOR: f64 = 0.1;
const MIN_RADIUS_FACTOR: f64 = 1.0 / 3.0;
/// Damping at which steps are too short to matter.
const MAX_DAMPING: f64 = 1e20;
/// Share of the Gauss–Newton step at which it is.
const MIN_SHARE: f64 = 1e-15;

impl LevenbergMarquardt {
    /// Brings D² and, before the first step, μ up to date after a linearisation.
    pub(super) fn scale(&mut self) {
        let Some(system) = &self.system else { return };
        for (d2, h) in self.d2.iter_mut().zip(system.diagonal()) {
            *d2 = match (self.options.damping, self.options.scaling) {
                (Damping::Nielsen { .. }, Scaling::Jacobi) => d2.max(*h),
                (_, Scaling::None) => 1.0,
                (Damping::Radius { .. }, Scaling::Jacobi) => *h,
            };
            if *d2 == 0.0 {
                // A component without influence on the residuals stays where it is.
                *d2 = 1.0;
            }
        }
        if self.mu > 0.0 {
            return;
        }
        let least = system.min_damping();
        let start = match self.options.damping {
            _ if self.options.method != Method::LevenbergMarquardt => least,
            Damping::Nielsen { tau } => {
                let scaled = system.diagonal().iter().zip(&self.d2).map(|(h, d2)| h / d2);
                tau * scaled.fold(0.0, f64::max)
            }
            Damping::Radius { initial, .. } => 1.0 / initial,
        };
        self.mu = start.max(least);
    }

    fn min_damping(&self) -> f64 {
        let least = self.system.as_ref().map_or(0.0, |s| s.min_damping());
        match self.options.damping {
            Damping::Nielsen { .. } => least,
            Damping::Radius { max, .. } => (1.0 / max).max(least),
        }
    }

    /// After a step with this gain ratio and length was taken.
    pub(super) fn reward(&mut self, ratio: f64, length: f64) {
        match self.options.method {
            Method::LevenbergMarquardt if ratio.is_finite() => {
                let least = match self.options.damping {
                    Damping::Nielsen { .. } => MIN_FACTOR,
                    Damping::Radius { .. } => MIN_RADIUS_FACTOR,
                };
                let factor = (1.0 - (2.0 * ratio - 1.0).powi(3)).max(least);
                self.mu = (self.mu * factor).max(self.min_damping());
            }
            Method::DogLeg { .. } if ratio > 0.75 => self.radius = self.radius.max(3.0 * length),
            Method::DogLeg { .. } if ratio < 0.25 => self.radius *= 0.5,
            Method::GaussNewton => self.radius = 1.0,
            _ => {}
        }
        self.nu = 2.0;
    }

    /// After a step of this length was rejected.
    pub(super) fn punish(&mut self, length: f64) {
        match self.options.method {
            Method::LevenbergMarquardt => return self.damp_more(),
            // The region has to shrink below the step just rejected.
            Method::DogLeg { .. } => self.radius = 0.5 * self.radius.min(length),
            Method::GaussNewton => self.radius *= 0.5,
        }
        self.stop_if_stalled();
    }

    /// After no step was found, because H + μ D² is not positive definite in floating-point numbers.
    pub(super) fn damp_more(&mut self) {
        self.mu *= self.nu;
        self.nu *= 2.0;
        self.stop_if_stalled();
    }

    fn stop_if_stalled(&mut self) {
        let tiny = match self.options.method {
            Method::LevenbergMarquardt => false,
            Method::DogLeg { .. } => self.radius <= 1.0 / MAX_DAMPING,
            Method::GaussNewton => self.radius <= MIN_SHARE,
        };
        if (tiny || self.mu > MAX_DAMPING) && self.termination.is_none() {
            self.termination = Some(Termination::Stalled);
        }
    }
}
