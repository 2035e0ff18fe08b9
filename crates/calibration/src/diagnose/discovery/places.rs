//! The places and forms in which a term explains as much as where it was found.

use depthcal_io::DiagnosisPlace;
use depthcal_model::{Of, On};
use depthcal_statistics::mean_to_standard_error;

use super::observations::Observations;
use super::selection::Judged;
use super::term::Term;
use crate::diagnose::thresholds::Thresholds;

/// Places and forms other than the term's own that the frames do not tell from it: there it explains nearly as much, or the
/// difference on left-out frames is not certain. A searched constant may have another value there.
pub(super) fn places_not_told_apart(
    observations: &Observations,
    term: &Term,
    thresholds: &Thresholds,
) -> Vec<DiagnosisPlace> {
    let judged = Judged::new(observations, term.clone());
    let all = Of::ALL.into_iter().flat_map(|of| On::ALL.into_iter().map(move |on| DiagnosisPlace { of, on }));
    let is_rival = |place: &DiagnosisPlace| {
        let rival = Judged::refined(observations, Term { of: place.of, on: place.on, ..term.clone() });
        rival.gain() >= (1.0 - thresholds.least_placement_gain) * judged.gain()
            || mean_to_standard_error(&judged.lost_by(&rival)) < thresholds.distinguishing_t
    };
    all.filter(|place| (place.of, place.on) != (term.of, term.on) && is_rival(place)).collect()
}
