//! The records of errors of one camera or several.

use depthcal_io::Evaluation;

use crate::judge::evaluate::Evaluated;

/// The record of errors, `suffix` being added to the names of datasets.
pub(super) fn evaluation_of(rig: &Evaluated, suffix: &str) -> Evaluation {
    let (mut datasets, mut transfer) = (rig.records(), rig.transfer_records());
    datasets.iter_mut().for_each(|d| d.name += suffix);
    transfer.iter_mut().for_each(|t| t.dataset += suffix);
    Evaluation { datasets, transfer }
}

/// Adds the errors on further captures to a record.
pub(super) fn extend(evaluation: &mut Evaluation, more: Evaluation) {
    evaluation.datasets.extend(more.datasets);
    evaluation.transfer.extend(more.transfer);
}
