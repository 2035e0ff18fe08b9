//! The record of a diagnosis, with everything that follows from it.

use depthcal_formula::FormulaError;
use depthcal_io::{DiagnosisFile, FileReference};
use depthcal_model::Register;

use crate::diagnose::Diagnosis;
use crate::diagnose::record::to_file;
use crate::diagnose::separability::separability;
use crate::progress::ProgressHandle;

/// The record of a diagnosis of `dataset` whose declared model was `model`, and the register with the formulas that were found.
///
/// # Errors
///
/// [`FormulaError`] where a formula cannot be a piece.
pub fn diagnosis_record(
    diagnosis: &Diagnosis,
    dataset: FileReference,
    model: &str,
    register: &Register,
    progress: &ProgressHandle,
) -> Result<(DiagnosisFile, Register), FormulaError> {
    let mut register = register.clone();
    for formula in &diagnosis.formulas {
        formula.effect.register(&mut register)?;
    }
    let mut record = to_file(diagnosis, dataset, model);
    // The matrix is optional in the record; the diagnosis itself has linearised the same model.
    let _stage = progress.stage("separability");
    record.separability = separability(diagnosis, &register).ok();
    Ok((record, register))
}
