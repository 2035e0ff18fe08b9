//! One iteration: linearise, solve for a step, try it.

use std::time::Instant;

use crate::problem::error::EvaluationFailure;
use crate::problem::values::Values;
use crate::step::damping::update_scaling;
use crate::step::dog_leg::DogLeg;
use crate::step::levenberg_marquardt::{LevenbergMarquardt, in_pool};
use crate::step::options::Method;
use crate::step::report::{Iteration, Termination};

/// Relative difference of costs below which it is due to rounding errors.
const COST_ROUNDING: f64 = 1e-12;
/// Root mean square of the residuals that counts as zero if no step decreases it.
const ZERO_RESIDUAL: f64 = 1e-10;

impl LevenbergMarquardt {
    /// Linearises at `values` and updates scaling and damping.
    pub(super) fn linearize(&mut self, values: &Values) -> Result<(), EvaluationFailure> {
        let Some(system) = self.system.as_mut() else { return Ok(()) };
        let start = Instant::now();
        let cost = in_pool(self.pool.as_ref(), || system.linearize(values));
        self.seconds.linearize += start.elapsed().as_secs_f64();
        self.cost = cost?;
        self.linearized = true;
        self.newton_known = false;
        self.first_prediction = None;
        update_scaling(self.options.damping, self.options.scaling, system.diagonal(), &mut self.d2);
        self.control.start(system.diagonal(), &self.d2, system.min_damping());
        system.constrain_active_set(values);
        self.gradient = system.gradient().iter().fold(0.0, |max, g| g.abs().max(max));
        Ok(())
    }

    /// Writes the next step δ to try. Returns the decrease of the cost that the linear model predicts, and ‖D δ‖ for the
    /// dog-leg (0 for other methods); `None` if the linear system is not positive definite.
    fn find_step(&mut self, values: &Values) -> Option<(f64, f64)> {
        let system = self.system.as_mut()?;
        if self.options.method == Method::LevenbergMarquardt {
            let (mu, d2, step) = (self.control.mu, &self.d2, &mut self.step);
            if !in_pool(self.pool.as_ref(), || system.solve_within(values, mu, d2, step)) {
                return None;
            }
            // F(0) − F(δ) of the model F = ½ ‖r + J δ‖², where H δ = −g − μ D² δ.
            let terms = self.step.iter().zip(system.gradient()).zip(&self.d2);
            return Some((terms.map(|((s, g), d2)| 0.5 * s * (mu * d2 * s - g)).sum(), 0.0));
        }
        if !self.newton_known {
            self.newton.resize(self.step.len(), 0.0);
            let (mu, d2, newton) = (self.control.mu, &self.d2, &mut self.newton);
            if !in_pool(self.pool.as_ref(), || system.solve_within(values, mu, d2, newton)) {
                return None;
            }
            self.newton_known = true;
        }
        let newton = &self.newton;
        let gradient = system.gradient();
        if let Method::DogLeg { .. } = self.options.method {
            for ((s, g), d2) in self.step.iter_mut().zip(gradient).zip(&self.d2) {
                *s = -g / d2;
            }
            let curvature = system.quadratic_form(&self.step);
            let dog_leg = DogLeg { gradient, d2: &self.d2, newton, curvature, radius: self.control.radius };
            return Some(dog_leg.step(&mut self.step));
        }
        let fraction = self.control.radius;
        self.step.iter_mut().zip(newton).for_each(|(s, n)| *s = fraction * n);
        let slope: f64 = newton.iter().zip(gradient).map(|(n, g)| -n * g).sum();
        Some((fraction * (1.0 - 0.5 * fraction) * slope, 0.0))
    }

    /// Computes a step and tries it. Returns the values after the step if it is accepted.
    pub(super) fn try_step(&mut self, values: &Values) -> Option<Values> {
        let start = Instant::now();
        if self.system.as_ref().is_some_and(|s| s.extended_active_set()) {
            // Components that were constrained for the rejected step may move in a shorter one.
            let first_prediction = self.first_prediction;
            self.linearize(values).ok()?;
            self.first_prediction = first_prediction;
        }
        let step = self.find_step(values);
        self.seconds.linear_solve += start.elapsed().as_secs_f64();
        let mut record = self.untried();
        let Some((mut predicted, length)) = step else {
            self.trace.push(record);
            self.control.increase_damping();
            self.stop_if_stalled();
            return None;
        };
        let system = self.system.as_mut()?;
        let clipped = system.clip(values, &mut self.step);
        predicted = clipped.unwrap_or(predicted);
        // A small decrease is no sign of convergence if bounds have shortened the step.
        let unrestricted = clipped.is_none() && !system.extended_active_set();
        record.predicted = predicted;
        record.step = self.step.iter().zip(system.diagonal()).fold(0.0, |max, (s, h)| (s.abs() * h.sqrt()).max(max));
        let start = Instant::now();
        let mut trial = self.values_pool.copy_of(values);
        system.retract(&mut trial, &self.step);
        record.trial_cost =
            in_pool(self.pool.as_ref(), || system.cost(&trial)).ok().filter(|c| c.is_finite()).unwrap_or(f64::INFINITY);
        self.seconds.evaluate += start.elapsed().as_secs_f64();
        let first = self.first_prediction.is_none() && unrestricted;
        let first_predicted = *self.first_prediction.get_or_insert(predicted);
        let decrease = self.cost - record.trial_cost;
        let ratio = decrease / predicted;
        // Close to the minimum the decrease of the cost is lost in rounding errors; the step is then judged by the model.
        let rounding = COST_ROUNDING * self.cost;
        let level = predicted <= rounding && decrease.abs() <= rounding;
        let last = first && level;
        record.accepted = last || clipped.is_some() && level || decrease > 0.0 && ratio > self.options.min_gain_ratio;
        let still = record.step <= self.options.parameter_tolerance * (2.0 * self.cost).sqrt();
        let tolerance = (self.options.cost_tolerance * self.cost).max(self.options.decrease_tolerance);
        let (residuals, least_damping) = (system.layout.rows as f64, system.min_damping());
        let (accepted, trial_cost) = (record.accepted, record.trial_cost);
        self.trace.push(record);
        if accepted {
            // After rejected steps a small decrease is due to the damping and no sign of convergence.
            if first && decrease <= tolerance {
                self.termination = Some(Termination::Cost);
            } else if first && still {
                self.termination = Some(Termination::Parameters);
            } else if last {
                self.termination = Some(Termination::Rounding);
            }
            self.control.step_accepted(ratio, length, least_damping);
            self.cost = trial_cost;
            self.linearized = false;
            return Some(trial);
        }
        if unrestricted && first_predicted <= tolerance {
            self.termination = Some(Termination::Cost);
        } else if first && still {
            self.termination = Some(Termination::Parameters);
        } else if self.cost <= 0.5 * residuals * ZERO_RESIDUAL * ZERO_RESIDUAL {
            self.termination = Some(Termination::Rounding);
        }
        self.values_pool.put(trial);
        self.control.step_rejected(length);
        self.stop_if_stalled();
        None
    }

    /// The record of an iteration whose step is not known yet.
    fn untried(&self) -> Iteration {
        Iteration {
            cost: self.cost,
            trial_cost: f64::INFINITY,
            predicted: f64::NAN,
            gradient: self.gradient,
            step: f64::NAN,
            damping: if self.options.method == Method::LevenbergMarquardt {
                self.control.mu
            } else {
                self.control.radius
            },
            accepted: false,
        }
    }

    fn stop_if_stalled(&mut self) {
        if self.control.is_stalled() && self.termination.is_none() {
            self.termination = Some(Termination::Stalled);
        }
    }
}
