//! One iteration: linearising, solving for a step, trying it.

use std::time::Instant;

use super::{LevenbergMarquardt, in_pool};
use crate::dog_leg::DogLeg;
use crate::error::EvaluationFailure;
use crate::options::Method;
use crate::report::{Iteration, Termination};
use crate::values::Values;

/// Relative differences of the cost below this are rounding errors.
const COST_ROUNDING: f64 = 1e-12;
/// Root mean square of residuals that counts as zero once a step cannot improve on it.
const ZERO_RESIDUAL: f64 = 1e-10;

impl LevenbergMarquardt {
    /// Linearises at the present values and brings scaling and damping up to date.
    pub(super) fn linearize(&mut self, values: &Values) -> Result<(), EvaluationFailure> {
        let Some(system) = self.system.as_mut() else { return Ok(()) };
        let start = Instant::now();
        let cost = in_pool(self.pool.as_ref(), || system.linearize(values));
        self.seconds.linearize += start.elapsed().as_secs_f64();
        self.cost = cost?;
        self.linearized = true;
        self.newton_known = false;
        self.first_prediction = None;
        self.scale();
        let Some(system) = self.system.as_mut() else { return Ok(()) };
        system.hold_active(values);
        self.gradient = system.gradient().iter().fold(0.0, |max, g| g.abs().max(max));
        Ok(())
    }

    /// Writes the next step to try; returns the decrease of the cost that the model predicts and ‖D δ‖ where it matters, or
    /// nothing if the linear system is not positive definite.
    fn find_step(&mut self, values: &Values) -> Option<(f64, f64)> {
        let system = self.system.as_mut()?;
        if self.options.method == Method::LevenbergMarquardt {
            let (mu, d2, step) = (self.mu, &self.d2, &mut self.step);
            if !in_pool(self.pool.as_ref(), || system.solve_within(values, mu, d2, step)) {
                return None;
            }
            // F(0) − F(δ) of the model ½ ‖r + J δ‖², with H δ = −g − μ D² δ put in.
            let terms = self.step.iter().zip(system.gradient()).zip(&self.d2);
            return Some((terms.map(|((s, g), d2)| 0.5 * s * (mu * d2 * s - g)).sum(), 0.0));
        }
        if !self.newton_known {
            self.newton.resize(self.step.len(), 0.0);
            let (mu, d2, newton) = (self.mu, &self.d2, &mut self.newton);
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
            let dog_leg = DogLeg { gradient, d2: &self.d2, newton, curvature, radius: self.radius };
            return Some(dog_leg.step(&mut self.step));
        }
        let share = self.radius;
        self.step.iter_mut().zip(newton).for_each(|(s, n)| *s = share * n);
        let slope: f64 = newton.iter().zip(gradient).map(|(n, g)| -n * g).sum();
        Some((share * (1.0 - 0.5 * share) * slope, 0.0))
    }

    /// Solves for a step and tries it; the moved values if the step is good.
    pub(super) fn try_step(&mut self, values: &Values) -> Option<Values> {
        let start = Instant::now();
        if self.system.as_ref().is_some_and(|s| s.narrowed()) {
            // What the rejected step held may be free to move in a shorter one.
            let first_prediction = self.first_prediction;
            self.linearize(values).ok()?;
            self.first_prediction = first_prediction;
        }
        let found = self.find_step(values);
        self.seconds.linear_solve += start.elapsed().as_secs_f64();
        let mut record = Iteration {
            cost: self.cost,
            trial_cost: f64::INFINITY,
            predicted: f64::NAN,
            gradient: self.gradient,
            step: f64::NAN,
            damping: if self.options.method == Method::LevenbergMarquardt { self.mu } else { self.radius },
            accepted: false,
        };
        let Some((mut predicted, length)) = found else {
            self.trace.push(record);
            self.damp_more();
            return None;
        };
        let system = self.system.as_mut()?;
        let clipped = system.clip(values, &mut self.step);
        predicted = clipped.unwrap_or(predicted);
        // While bounds come into play a small decrease says nothing.
        let whole = clipped.is_none() && !system.narrowed();
        record.predicted = predicted;
        record.step = self.step.iter().zip(system.diagonal()).fold(0.0, |max, (s, h)| (s.abs() * h.sqrt()).max(max));
        let start = Instant::now();
        let mut trial = self.spare.take_copy(values);
        system.retract(&mut trial, &self.step);
        record.trial_cost =
            in_pool(self.pool.as_ref(), || system.cost(&trial)).ok().filter(|c| c.is_finite()).unwrap_or(f64::INFINITY);
        self.seconds.evaluate += start.elapsed().as_secs_f64();
        let first = self.first_prediction.is_none() && whole;
        let promised = *self.first_prediction.get_or_insert(predicted);
        let decrease = self.cost - record.trial_cost;
        let ratio = decrease / predicted;
        // Close to the minimum the cost can no longer tell a good step from a bad one, but the model can.
        let rounding = COST_ROUNDING * self.cost;
        let level = predicted <= rounding && decrease.abs() <= rounding;
        let last = first && level;
        record.accepted = last || clipped.is_some() && level || decrease > 0.0 && ratio > self.options.min_gain_ratio;
        let still = record.step <= self.options.parameter_tolerance * (2.0 * self.cost).sqrt();
        let tolerance = self.options.cost_tolerance * self.cost;
        let residuals = system.layout.rows as f64;
        let (accepted, trial_cost) = (record.accepted, record.trial_cost);
        self.trace.push(record);
        if accepted {
            // After rejected steps a small decrease is due to the damping and says nothing.
            if first && decrease <= tolerance {
                self.termination = Some(Termination::Cost);
            } else if first && still {
                self.termination = Some(Termination::Parameters);
            } else if last {
                self.termination = Some(Termination::Rounding);
            }
            self.reward(ratio, length);
            self.cost = trial_cost;
            self.linearized = false;
            return Some(trial);
        }
        if whole && promised <= tolerance {
            self.termination = Some(Termination::Cost);
        } else if first && still {
            self.termination = Some(Termination::Parameters);
        } else if self.cost <= 0.5 * residuals * ZERO_RESIDUAL * ZERO_RESIDUAL {
            self.termination = Some(Termination::Rounding);
        }
        self.spare.put(trial);
        self.punish(length);
        None
    }
}
