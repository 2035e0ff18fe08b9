//! The effects that a model may lack: every effect of the register that the model does not have, with the values of its
//! constants that are to be tried.

use depthcal_model::{Block, Camera, Covariate, Register, Role, Scan, ScanKind};

use super::sight::{Range, Sights};

/// Most cycles over the data's range that a wave is searched with.
const MOST_CYCLES: f64 = 26.0;
/// Cycles over the range between neighbouring periods: a wave half a step off keeps 93 % of its amplitude.
const CYCLE_STEP: f64 = 0.4;

/// Reference amplitudes that are tried.
const REFERENCES: usize = 9;

/// Baselines that are tried, mm: depth cameras are between a hand's and two hands' breadths wide.
const BASELINES_MM: [f64; 7] = [0.0, 40.0, -40.0, 75.0, -75.0, 120.0, -120.0];

/// An effect that may be missing.
#[derive(Debug, Clone)]
pub struct Effect {
    /// Its name.
    pub name: &'static str,
    /// Its constant that is searched for, with the values to try; empty where it has none.
    pub values: Vec<f64>,
    constant: Option<&'static str>,
    /// Whether finer values between the best ones make sense.
    pub refine: bool,
    /// Values that are tried once it is in the model, where they are more freedom than a first test should have; empty where
    /// those about the value found are.
    pub afterwards: Vec<f64>,
}

impl Effect {
    /// `NAME` or `NAME@CONSTANT=VALUE`, as on the command line.
    pub fn spec(&self, value: Option<f64>) -> String {
        match (self.constant, value) {
            (Some(constant), Some(value)) => format!("{}@{constant}={value}", self.name),
            _ => self.name.to_owned(),
        }
    }

    /// Specs of all values to try.
    pub fn specs(&self) -> Vec<(Option<f64>, String)> {
        if self.values.is_empty() {
            return vec![(None, self.spec(None))];
        }
        self.values.iter().map(|v| (Some(*v), self.spec(Some(*v)))).collect()
    }
}

/// The effects of `register` that `camera` lacks.
pub fn missing_effects(register: &Register, camera: &Camera, sights: &Sights) -> Vec<Effect> {
    let candidates = register.names().filter(|name| camera.block(name).is_none());
    candidates
        .filter_map(|name| {
            let block = register.block(name, None).ok()?;
            let piece = block.piece()?;
            if piece.role() != Role::Effect {
                return None;
            }
            let scan = piece.scan();
            let (values, refine) = scan.map_or((Vec::new(), false), |scan| scan_values(scan, sights));
            let constant = scan.map(|s| s.constant).filter(|_| !values.is_empty());
            let is_baseline = scan.is_some_and(|s| s.kind == ScanKind::Baseline);
            let afterwards = if is_baseline { BASELINES_MM.to_vec() } else { Vec::new() };
            Some(Effect { name, values, constant, refine, afterwards })
        })
        .collect()
}

/// The block of an effect with its constants.
pub fn block_of(register: &Register, spec: &str) -> Option<Block> {
    register.block(spec, None).ok()
}

/// Values of a scanned constant, and whether they may be refined.
fn scan_values(scan: Scan, sights: &Sights) -> (Vec<f64>, bool) {
    let range: Option<Range> = sights.range(|state, context| scan.covariate.value(state, context));
    let Some(range) = range.filter(|r| r.span() > 0.0 || scan.kind == ScanKind::Reference) else {
        return (Vec::new(), false);
    };
    match scan.kind {
        // A temperature's reference is taken up by D. An amplitude's is not: with it goes a constant bias of depth.
        ScanKind::Reference if scan.covariate == Covariate::Amplitude => {
            let (low, high) = (0.5 * range.low, 2.0 * range.high);
            ((0..REFERENCES).map(|i| low * (high / low).powf(i as f64 / (REFERENCES - 1) as f64)).collect(), true)
        }
        // The shift is a correction to the effect, and would let it pass for others.
        ScanKind::Baseline => (vec![0.0], false),
        ScanKind::Reference => (vec![round(range.middle)], false),
        ScanKind::TimeConstant => {
            let shares = [0.1, 0.2, 0.33, 0.5, 0.8, 1.3];
            (shares.iter().map(|s| s * range.span()).chain([f64::INFINITY]).collect(), true)
        }
        ScanKind::Period => {
            let steps = ((MOST_CYCLES - 1.0) / CYCLE_STEP) as usize;
            ((0..=steps).map(|i| range.span() / (1.0 + CYCLE_STEP * i as f64)).collect(), true)
        }
    }
}

/// Three significant digits: a convention need not look like a measurement.
fn round(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    let digits = 10f64.powf(2.0 - value.abs().log10().floor());
    (value * digits).round() / digits
}

/// Values between the neighbours of `best` in `values`, evenly in 1/value.
pub fn finer(values: &[f64], best: f64) -> Vec<f64> {
    let inverse = |v: f64| 1.0 / v;
    let mut sorted: Vec<f64> = values.iter().map(|v| inverse(*v)).collect();
    sorted.sort_by(f64::total_cmp);
    let Some(at) = sorted.iter().position(|v| *v == inverse(best)) else { return Vec::new() };
    let low = sorted[at.saturating_sub(1)];
    let high = sorted[(at + 1).min(sorted.len() - 1)];
    (1..8).map(|i| low + (high - low) * f64::from(i) / 8.0).filter(|v| *v > 0.0).map(|v| 1.0 / v).collect()
}

/// Values about `present`, evenly in 1/value, over half a step of the coarse search to either side.
pub fn around(present: f64, values: &[f64]) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.iter().map(|v| 1.0 / v).collect();
    sorted.sort_by(f64::total_cmp);
    let at = sorted.iter().position(|v| *v >= 1.0 / present).unwrap_or(sorted.len() - 1).max(1);
    let step = sorted[at] - sorted[at - 1];
    (-10..=10).map(|i| 1.0 / present + step * 0.05 * f64::from(i)).filter(|v| *v > 0.0).map(|v| 1.0 / v).collect()
}
