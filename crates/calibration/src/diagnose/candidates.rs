//! The effects that a model may lack: every effect of the register that is not among its pieces, with the values of its
//! constant that are searched.

use depthcal_model::{AnyPiece, Covariate, Of, On, PieceSpec, Placement, Register, Role, Scan, ScanKind};

use super::observed_states::{ObservedStates, Range};
use crate::calibrate::CalibratedCamera;

/// Most cycles over the range of the data for which a wave is searched.
const MOST_CYCLES: f64 = 26.0;
/// Fewest cycles: a wave of less is no wave to these data but any smooth function of depth.
const FEWEST_CYCLES: f64 = 1.4;
/// Cycles over the range by which neighbouring periods differ: a wave between two of them keeps 93 % of its amplitude in the
/// nearer one.
const CYCLE_STEP: f64 = 0.4;
/// Number of reference amplitudes that are searched.
const REFERENCES: usize = 9;
/// Reference amplitudes are searched from this factor times the lowest amplitude to this factor times the highest.
const REFERENCE_FACTORS: [f64; 2] = [0.5, 2.0];
/// Time constants that are searched, as shares of the time that was captured.
const TIME_CONSTANT_SHARES: [f64; 6] = [0.1, 0.2, 0.33, 0.5, 0.8, 1.3];
/// Distances between projector and camera that are searched, mm: up to the width of common depth cameras, to either side.
const BASELINES_MM: [f64; 7] = [0.0, 40.0, -40.0, 75.0, -75.0, 120.0, -120.0];
/// Parts into which a refined search divides the interval between the neighbours of the best value.
const REFINED_PARTS: i32 = 8;
/// Values to either side of the present one that are searched once an effect is in the model, and their distance as a share of
/// a step of the coarse search.
const VALUES_TO_EITHER_SIDE: i32 = 10;
const SHARE_OF_STEP: f64 = 0.05;

/// An effect that the model lacks.
#[derive(Debug, Clone)]
pub struct Effect {
    /// Its name.
    pub name: &'static str,
    /// Values of its constant that are searched; empty where it has none.
    pub values: Vec<f64>,
    /// Name of that constant.
    constant: Option<&'static str>,
    /// Places and forms in which it may act, its own first.
    pub placements: Vec<Placement>,
    /// Whether its constant has another value in another place: a wave over depth has.
    pub shifts: bool,
    /// Whether finer values about the best one are searched as well.
    pub refine: bool,
    /// Values that are searched only once the effect is in the model, because a search among them would let it imitate other
    /// effects in the first test; where empty, values about the one found are searched then.
    pub afterwards: Vec<f64>,
}

impl Effect {
    /// Its specification in a place and a form, with a value of its constant where it has one.
    pub fn spec(&self, value: Option<f64>, placement: Placement) -> PieceSpec {
        let spec = PieceSpec::new(self.name).placed(placement);
        match (self.constant, value) {
            (Some(constant), Some(value)) => spec.with(constant, value),
            _ => spec,
        }
    }
}

/// The effects of `register` that the camera of a fit lacks and that one of its technology may have; of any where this is not
/// declared. The values of their constants follow from the range of the covariates.
pub fn missing_effects(register: &Register, fit: &CalibratedCamera, states: &ObservedStates) -> Vec<Effect> {
    let technology = fit.capture.technology;
    let candidates = register.names().filter(|name| fit.camera.block(name).is_none());
    candidates
        .filter_map(|name| {
            let block = register.block(name, None).ok()?;
            let piece = block.piece()?;
            let technologies = piece.technologies();
            let is_of_another =
                technology.is_some_and(|declared| !technologies.is_empty() && !technologies.contains(&declared));
            if piece.role() != Role::Effect || is_of_another {
                return None;
            }
            let scan = piece.scan();
            let (values, refine) = scan.map_or((Vec::new(), false), |scan| scan_values(scan, states));
            let constant = scan.map(|s| s.constant).filter(|_| !values.is_empty());
            let is_baseline = scan.is_some_and(|s| s.kind == ScanKind::Baseline);
            let afterwards = if is_baseline { BASELINES_MM.to_vec() } else { Vec::new() };
            let placements = placements(&**piece);
            let shifts = scan.is_some_and(|s| {
                s.kind == ScanKind::Period && matches!(s.covariate, Covariate::Depth | Covariate::InverseDepth)
            });
            Some(Effect { name, values, constant, placements, shifts, refine, afterwards })
        })
        .collect()
}

/// The places and forms in which a piece may act, its own first.
fn placements(piece: &dyn AnyPiece) -> Vec<Placement> {
    if !piece.can_be_placed() {
        return vec![Placement::default()];
    }
    let others = On::ALL.into_iter().filter(|on| *on != piece.form()).map(Some);
    let forms: Vec<Option<On>> = std::iter::once(None).chain(others).collect();
    Of::ALL.into_iter().flat_map(|of| forms.iter().map(move |on| Placement { of, on: *on })).collect()
}

/// Values of a constant that are searched, and whether the search is refined about the best one.
fn scan_values(scan: Scan, states: &ObservedStates) -> (Vec<f64>, bool) {
    let range: Option<Range> = states.range(|state, context| scan.covariate.value(state, context));
    let Some(range) = range.filter(|r| r.span() > 0.0 || scan.kind == ScanKind::Reference) else {
        return (Vec::new(), false);
    };
    match scan.kind {
        // Only a reference amplitude is searched: another reference temperature adds a constant that D describes, but another
        // reference amplitude adds a constant bias of depth, which D does not.
        ScanKind::Reference if scan.covariate == Covariate::Amplitude => {
            let (low, high) = (REFERENCE_FACTORS[0] * range.low, REFERENCE_FACTORS[1] * range.high);
            ((0..REFERENCES).map(|i| low * (high / low).powf(i as f64 / (REFERENCES - 1) as f64)).collect(), true)
        }
        // The baseline refines the effect; searched in the first test it would let the effect imitate others.
        ScanKind::Baseline => (vec![0.0], false),
        ScanKind::Reference => (vec![round_to_three_digits(range.middle)], false),
        ScanKind::TimeConstant => {
            (TIME_CONSTANT_SHARES.iter().map(|s| s * range.span()).chain([f64::INFINITY]).collect(), true)
        }
        ScanKind::Period => {
            let steps = ((MOST_CYCLES - FEWEST_CYCLES) / CYCLE_STEP) as usize;
            ((0..=steps).map(|i| range.span() / (FEWEST_CYCLES + CYCLE_STEP * i as f64)).collect(), true)
        }
    }
}

/// Rounds to three significant digits: a reference is a convention and needs no more.
fn round_to_three_digits(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    let digits = 10f64.powf(2.0 - value.abs().log10().floor());
    (value * digits).round() / digits
}

/// Values between the neighbours of `best` in `values`, evenly spaced in 1/value.
pub fn finer(values: &[f64], best: f64) -> Vec<f64> {
    let inverse = |v: f64| 1.0 / v;
    let mut sorted: Vec<f64> = values.iter().map(|v| inverse(*v)).collect();
    sorted.sort_by(f64::total_cmp);
    let Some(place) = sorted.iter().position(|v| *v == inverse(best)) else { return Vec::new() };
    let low = sorted[place.saturating_sub(1)];
    let high = sorted[(place + 1).min(sorted.len() - 1)];
    let parts = f64::from(REFINED_PARTS);
    (1..REFINED_PARTS)
        .map(|i| low + (high - low) * f64::from(i) / parts)
        .filter(|v| *v > 0.0)
        .map(|v| 1.0 / v)
        .collect()
}

/// Values about `present`, evenly spaced in 1/value, over half a step of the coarse search to either side.
pub fn around(present: f64, values: &[f64]) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.iter().map(|v| 1.0 / v).collect();
    sorted.sort_by(f64::total_cmp);
    let place = sorted.iter().position(|v| *v >= 1.0 / present).unwrap_or(sorted.len() - 1).max(1);
    let step = sorted[place] - sorted[place - 1];
    (-VALUES_TO_EITHER_SIDE..=VALUES_TO_EITHER_SIDE)
        .map(|i| 1.0 / present + step * SHARE_OF_STEP * f64::from(i))
        .filter(|v| *v > 0.0)
        .map(|v| 1.0 / v)
        .collect()
}
