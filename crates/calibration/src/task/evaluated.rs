//! The records of errors of one camera or several.

use depthcal_io::Evaluation;

use crate::calibrate::CalibratedCamera;
use crate::judge::evaluate::Evaluated;
use crate::judge::whole_frames::whole_frames;

/// The record of errors, `suffix` being added to the names of datasets; `fit` has the calibrations by the names of cameras.
pub(super) fn evaluation_of<'a>(
    rig: &Evaluated,
    suffix: &str,
    fit: impl Fn(&str) -> Option<&'a CalibratedCamera>,
) -> Evaluation {
    let (mut datasets, mut transfer) = (rig.records(), rig.transfer_records());
    for (record, (name, evaluated)) in datasets.iter_mut().zip(&rig.cameras) {
        record.name += suffix;
        record.whole_frames = fit(name).and_then(|fit| whole_frames(fit, &evaluated.frames));
    }
    transfer.iter_mut().for_each(|t| t.dataset += suffix);
    Evaluation { datasets, transfer }
}

/// Adds the errors on further captures to a record.
pub(super) fn extend(evaluation: &mut Evaluation, more: Evaluation) {
    evaluation.datasets.extend(more.datasets);
    evaluation.transfer.extend(more.transfer);
}
