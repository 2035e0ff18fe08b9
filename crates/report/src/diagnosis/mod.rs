//! What a diagnosis tells in the report: how wrong the depth was, where and why, what was added, how wrong it is now, how
//! sure that is, and what to capture next.

mod account;
mod words;

use depthcal_io::DiagnosisFile;
use depthcal_model::Register;

use super::pool::Pool;
use super::{ReportDataset, ReportInput, Role};
use depthcal_calibration::calibrate::Calibrated;
use depthcal_calibration::judge::evaluate::Evaluated;

pub(super) use account::{apart, candidates, frames, next, steps};
pub(super) use words::{answers, pill, sentence};

/// A diagnosis: its account, and the declared model beside the last one, which is the report's calibration.
#[derive(Debug, Clone, Copy)]
pub struct ReportDiagnosis<'a> {
    /// The account.
    pub account: &'a DiagnosisFile,
    /// The declared model, fitted to all good frames.
    pub first: &'a Calibrated,
    /// Errors of the declared model on frames that it did not see.
    pub before: &'a Evaluated,
    /// The pieces that the account names.
    pub register: &'a Register,
}

impl<'a> ReportDiagnosis<'a> {
    /// The frames under the declared model.
    pub(super) fn declared(&self) -> Pool<'a> {
        Pool::one(&ReportDataset { evaluated: self.before, role: Role::HeldOut })
    }

    /// Names of what was added, in order.
    pub(super) fn added(&self) -> Vec<&'a str> {
        self.account.steps.iter().filter_map(|s| s.effects.first().map(String::as_str)).collect()
    }
}

/// The frames under the last model: those that the headline speaks of.
pub(super) fn last<'a>(input: &ReportInput<'a>) -> Pool<'a> {
    Pool::headline(input).0
}
