//! The loop: fit, left over, candidates, decision, trial, judged; again until nothing is left to try.
//!
//! | step | file |
//! |---|---|
//! | the declared model is fitted, without frames that do not belong to the others | `start`, `frames` |
//! | its residuals are examined | [`examination`](super::examination) |
//! | a decision is made, without effects that are refuted | `decided`, [`decision`](super::decision) |
//! | effects are proposed, or refused | `proposal` |
//! | they are tried: fitted, and judged on held-out frames | `trial`, `refinement` |
//! | functions are found together, and explained | `additive`, `functions`, `naming` |
//! | earlier decisions are looked at again | `revisit`, `last_model` |
//! | a formula is searched for what is unexplained, or instead of the effects | `formula` |
//! | what no effect explains is left, with a free map | `unexplained` |
//! | the last state is reported | `conclusion` |
//!
//! A step reads the [`State`] and returns an [`Event`]; `State::apply` alone changes the state. What fits and judges models is
//! behind the trait [`Bench`].

mod additive;
mod augmented_model;
mod bench;
mod conclusion;
mod decided;
mod fitter;
mod formula;
mod frames;
mod functions;
mod known_searches;
mod last_model;
#[cfg(test)]
mod linear_bench;
mod lost_gain;
mod naming;
mod proposal;
mod refinement;
mod revisit;
mod start;
mod state;
mod trial;
mod unexplained;

use self::additive::{explained_anew, explained_together};
use self::bench::Bench;
use self::conclusion::conclude;
use self::decided::Decided;
use self::fitter::{Fitter, OnFrames};
use self::formula::{formula_for_residuals, formula_for_unexplained, formula_instead, may_be_searched};
use self::last_model::without_uncertain;
use self::proposal::Proposal;
use self::revisit::{frames_readmitted, other_frames_excluded, without_hidden_lens_effects};
use self::start::{options_of_fits, start};
use self::state::{Event, Next, State};
use self::trial::tried;
use self::unexplained::{negligible, unexplained};
use super::bad_frames::without_duplicates;
use super::decision::Decision;
use super::diagnosis::CameraDiagnosis;
use super::error::DiagnoseError;
use super::examination::Examination;
use super::options::CameraDiagnoseOptions;
use super::round::{Round, RoundOutcome};
use crate::calibrate::check_declared_depth;
use crate::observe::CameraFrames;

/// Diagnoses a capture: which effects does the declared model lack? Errors are those on `verify` where it is given, else on
/// frames that cross-validation holds out.
///
/// # Errors
///
/// [`DiagnoseError`] where there is no depth, or where a model cannot be fitted or examined.
pub fn diagnose_camera(
    capture: &CameraFrames,
    verify: Option<&CameraFrames>,
    options: &CameraDiagnoseOptions,
) -> Result<CameraDiagnosis, DiagnoseError> {
    if !capture.has_depth() {
        return Err(DiagnoseError::NoDepth { dataset: capture.name.clone() });
    }
    let options = options_of_fits(capture, options);
    let (whole, duplicates) = without_duplicates(capture, &options.thresholds);
    let fitter = Fitter::new(whole, verify, &options);
    let state = start(&fitter, duplicates)?;
    if let Some(verify) = verify {
        check_declared_depth(&state.first.fit.camera, verify, &options.calibrate)?;
    }
    let mut closed_loop = ClosedLoop { fitter: &fitter, state };
    let examination = closed_loop.run()?;
    conclude(&fitter, closed_loop.state, examination)
}

/// The loop with its state.
struct ClosedLoop<'a> {
    fitter: &'a Fitter<'a>,
    state: State,
}

impl ClosedLoop<'_> {
    /// Fits and judges models on the present frames, in the present round.
    fn bench(&self) -> OnFrames<'_> {
        self.fitter.on(&self.state.frames.used, self.state.rounds.len())
    }

    /// Runs the loop to its end. Returns the last examination.
    fn run(&mut self) -> Result<Examination, DiagnoseError> {
        let mut examination = loop {
            let examination = self.rounds()?;
            if self.formula_after_rounds(&examination)? != Next::Examine && self.anew(&examination)? != Next::Examine {
                break examination;
            }
        };
        let effects = self.state.model.added.len();
        let readmitted = frames_readmitted(self.fitter, &self.state)?;
        let are_other_frames = readmitted.is_some();
        readmitted.map(|event| self.state.apply(event));
        without_uncertain(&self.bench(), &self.state)?.map(|event| self.state.apply(event));
        if are_other_frames || self.state.model.added.len() < effects {
            examination = self.examine()?;
        }
        Ok(examination)
    }

    /// Rounds until nothing is missing that can be added.
    fn rounds(&mut self) -> Result<Examination, DiagnoseError> {
        let mut examination = self.examine()?;
        loop {
            match self.round(&examination)? {
                Next::Examine => examination = self.examine()?,
                Next::Decide => {}
                Next::GoOn | Next::Settled => return Ok(examination),
            }
        }
    }

    fn examine(&self) -> Result<Examination, DiagnoseError> {
        let State { frames, model, present, rounds, .. } = &self.state;
        let bench = self.fitter.on(&frames.used, rounds.len() + 1);
        bench.report("examining what is left", &model.options(bench.declared()));
        Ok(bench.examine(&present.fit)?)
    }

    /// A round: a decision on the residuals, and what comes of it.
    fn round(&mut self, examination: &Examination) -> Result<Next, DiagnoseError> {
        let State { present, memory, .. } = &self.state;
        let Decided { decision, refuted } =
            decided::decided(&present.fit, examination, memory, self.bench().options())?;
        self.state.apply(Event::Decided(Box::new(Round::new(examination, decision.clone(), refuted))));
        // Functions first, names second; later rounds have what the first names leave.
        if self.state.rounds.len() == 1 && self.together(examination)? == Next::Examine {
            return Ok(Next::Examine);
        }
        match &decision {
            Decision::Nothing => self.stop(examination, None),
            Decision::Unexplained { free, explained, .. } => self.explain(examination, *free, *explained),
            Decision::Add { effect, jointly_with, indistinguishable, .. } => {
                self.add(examination, Proposal { effect: *effect, jointly_with, indistinguishable })
            }
        }
    }

    /// Tries the effects of a proposal. Where they are accepted, frames are looked at again.
    fn add(&mut self, examination: &Examination, proposal: Proposal<'_>) -> Result<Next, DiagnoseError> {
        let event = match tried(&self.bench(), &self.state, examination, proposal)? {
            Event::Stopped(outcome) => return self.stop(examination, outcome),
            event => event,
        };
        let next = self.state.apply(event);
        if next == Next::Examine
            && let Some(event) = other_frames_excluded(self.fitter, &self.state)?
        {
            self.state.apply(event);
        }
        Ok(next)
    }

    /// Ends the rounds, unless functions explain what is left: functions that hide each other show in no test of one alone.
    fn stop(&mut self, examination: &Examination, outcome: Option<RoundOutcome>) -> Result<Next, DiagnoseError> {
        if self.together(examination)? == Next::Examine {
            return Ok(Next::Examine);
        }
        Ok(self.state.apply(Event::Stopped(outcome)))
    }

    /// Explains what is left by functions, all at once; those that were tried under this model are not tried again.
    fn together(&mut self, examination: &Examination) -> Result<Next, DiagnoseError> {
        if self.state.memory.tried.functions || !self.functions_are_wanted() {
            return Ok(Next::GoOn);
        }
        let event = explained_together(&self.bench(), &self.state, examination)?;
        let next = self.state.apply(event);
        if next == Next::Examine
            && let Some(event) = other_frames_excluded(self.fitter, &self.state)?
        {
            self.state.apply(event);
        }
        Ok(next)
    }

    /// Whether functions without a name are searched, and a round is left.
    fn functions_are_wanted(&self) -> bool {
        let bench = self.bench();
        bench.options().formulas && self.state.rounds.len() < bench.thresholds().most_rounds
    }

    /// Explains all effects of depth anew, once under each model.
    fn anew(&mut self, examination: &Examination) -> Result<Next, DiagnoseError> {
        if self.state.memory.tried.anew || !self.functions_are_wanted() {
            return Ok(Next::GoOn);
        }
        let event = Event::ExplainedAnew(explained_anew(&self.bench(), &self.state, examination)?);
        Ok(self.state.apply(event))
    }

    /// Something that no named effect explains: effects of the lens may have been added for it; a formula may describe it, or
    /// everything; else it is left.
    fn explain(&mut self, examination: &Examination, free: usize, explained: f64) -> Result<Next, DiagnoseError> {
        let thresholds = *self.bench().thresholds();
        if let Some(outcome) = negligible(examination, free, &thresholds) {
            return self.stop(examination, Some(outcome));
        }
        if self.state.rounds.len() < thresholds.most_rounds
            && let Some(event) = without_hidden_lens_effects(&self.bench(), &self.state)?
        {
            return Ok(self.state.apply(event));
        }
        if self.formula_instead()? == Next::Examine {
            return Ok(Next::Examine);
        }
        // A function first: a formula takes its place where it says as much.
        if self.together(examination)? == Next::Examine {
            return Ok(Next::Examine);
        }
        if may_be_searched(&self.bench(), &self.state) {
            let event = formula_for_unexplained(&self.bench(), &self.state, examination)?;
            if self.state.apply(event) == Next::Examine {
                return Ok(Next::Examine);
            }
        }
        let event = unexplained(&self.bench(), &self.state, examination, free, explained);
        Ok(self.state.apply(event))
    }

    /// After the last round: a formula instead of the effects, or for what no free function of one covariate shows.
    fn formula_after_rounds(&mut self, examination: &Examination) -> Result<Next, DiagnoseError> {
        if self.formula_instead()? == Next::Examine {
            return Ok(Next::Examine);
        }
        let findings = &self.state.findings;
        let is_searched = !findings.left_over.is_empty() || findings.formula_refused.is_some();
        if is_searched || !may_be_searched(&self.bench(), &self.state) {
            return Ok(Next::Settled);
        }
        let event = formula_for_residuals(&self.bench(), &self.state, examination)?;
        Ok(self.state.apply(event))
    }

    fn formula_instead(&mut self) -> Result<Next, DiagnoseError> {
        let event = formula_instead(&self.bench(), &self.state)?;
        Ok(event.map_or(Next::GoOn, |event| self.state.apply(event)))
    }
}
