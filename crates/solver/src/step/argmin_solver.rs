//! argmin's interface to the solver: initialisation and iterations.

use std::borrow::Borrow;
use std::time::Instant;

use argmin::core::{Error, KV, Problem, Solver, State};

use crate::problem::graph::Graph;
use crate::problem::values::Values;
use crate::step::error::SolveError;
use crate::step::interrupt::Interrupt;
use crate::step::levenberg_marquardt::{LevenbergMarquardt, SolverState};
use crate::step::options::Method;
use crate::step::report::Termination;

impl<G: Borrow<Graph>> Solver<G, SolverState> for LevenbergMarquardt {
    fn name(&self) -> &str {
        match self.options.method {
            Method::LevenbergMarquardt => "Levenberg-Marquardt",
            Method::DogLeg { .. } => "dog-leg",
            Method::GaussNewton => "Gauss-Newton",
        }
    }

    fn init(&mut self, problem: &mut Problem<G>, mut state: SolverState) -> Result<(SolverState, Option<KV>), Error> {
        let begin = Instant::now();
        let mut values = take_values(&mut state)?;
        problem.problem("structure_count", |graph| Ok(self.prepare(graph.borrow(), &values)?))?;
        self.seconds.structure += begin.elapsed().as_secs_f64();
        if let Some(system) = &self.system {
            system.bounds.project(&mut values);
        }
        problem.problem("linearize_count", |_| Ok(self.linearize(&values).map_err(SolveError::Start)?))?;
        self.cost0 = self.cost;
        self.seconds.total += begin.elapsed().as_secs_f64();
        let kv = argmin::kv!("gradient" => self.gradient; "damping" => self.control.mu;);
        let cost = self.cost;
        Ok((state.param(values).cost(cost), Some(kv)))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<G>,
        mut state: SolverState,
    ) -> Result<(SolverState, Option<KV>), Error> {
        let begin = Instant::now();
        let values = take_values(&mut state)?;
        if self.system.is_none() {
            problem.problem("structure_count", |graph| Ok(self.prepare(graph.borrow(), &values)?))?;
        }
        if !self.linearized
            && let Err(failure) = problem.problem("linearize_count", |_| Ok(self.linearize(&values)))?
        {
            self.termination = Some(Termination::NotDifferentiable(failure.to_string()));
        }
        if let Some(check) = self.resume_check.take() {
            check.check_cost(self.cost).map_err(SolveError::from)?;
            self.first_prediction = check.first_prediction;
        }
        if self.step.is_empty() {
            self.termination = Some(Termination::NothingToEstimate);
        } else if self.gradient <= self.options.gradient_tolerance {
            self.termination = Some(Termination::Gradient);
        }
        if self.termination.is_none() && self.options.interrupt.as_ref().is_some_and(Interrupt::is_raised) {
            self.termination = Some(Termination::Interrupted);
        }
        let trial = match self.termination {
            Some(_) => None,
            None => problem.problem("step_count", |_| Ok(self.try_step(&values)))?,
        };
        self.seconds.total += begin.elapsed().as_secs_f64();
        let cost = self.cost;
        let values = match trial {
            Some(trial) => {
                self.values_pool.put(values);
                trial
            }
            None => values,
        };
        let mut state = state.param(values).cost(cost);
        if let Some(termination) = &self.termination {
            state = state.terminate_with(termination.reason());
        }
        let kv = argmin::kv!("gradient" => self.gradient; "damping" => self.control.mu;);
        Ok((state, Some(kv)))
    }
}

fn take_values(state: &mut SolverState) -> Result<Values, Error> {
    state.take_param().ok_or_else(|| {
        let reason = "its state has no start values; set them by IterState::param".to_owned();
        SolveError::Executor { reason }.into()
    })
}
