//! The dictionary of the additive model.

use std::collections::BTreeSet;
use std::iter::once;

use depthcal_formula::FormulaCovariate as C;
use depthcal_io::DiagnosisSearched;
use depthcal_model::{Of, On};
use depthcal_solver::additive::{Additive, Axis, CUBIC, Cluster, Group, Table};
use nalgebra::DMatrix;

use super::super::observations::{FrameRows, Observations, Sample};

/// Covariates of smooth functions, with the number of their basis functions: errors of single columns and rows, rings, and waves
/// over depth are finer than effects of amplitude, incidence, time and temperature.
const COVARIATES: [(C, usize); 8] = [
    (C::X, 16),
    (C::Y, 16),
    (C::R, 16),
    (C::Z, 24),
    (C::Incidence, 6),
    (C::Amplitude, 10),
    (C::Time, 6),
    (C::Temperature, 5),
];
/// Covariates that functions are multiplied with.
const FACTORS: [C; 5] = [C::X, C::Y, C::R, C::Time, C::Temperature];
/// Basis functions of functions of quantities that users record.
const OF_QUANTITIES: usize = 6;
/// Pairs of covariates whose functions are no products of a function of one and the other, and the number of their basis
/// functions along each.
const PAIRS: [[C; 2]; 4] = [[C::X, C::Y], [C::R, C::Z], [C::X, C::Z], [C::Y, C::Z]];
const OF_PAIRS: usize = 7;
/// Most basis functions along each: formulas have a limit of parameters.
const MOST_OF_PAIRS: usize = 9;
/// A covariate in a place, cut into basis functions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Smooth {
    pub covariate: C,
    pub of: Of,
    pub axis: Axis,
}

/// A smooth function of a covariate, or a constant, times a factor, or a smooth function of two covariates, in a place and form.
#[derive(Debug, Clone)]
pub(super) struct Function {
    /// Its splines: of one covariate or of two, or none of a constant.
    pub splines: Vec<Smooth>,
    /// With the mean that is subtracted.
    pub factor: Option<(C, f64)>,
    pub of: Of,
    pub on: On,
}

/// All functions, in the order of the groups of their [`Additive`] model.
#[derive(Debug)]
pub(super) struct Dictionary {
    /// Covariates by the numbers that they have in the model.
    covariates: Vec<C>,
    /// Covariates in their places; functions of two have splines of their own.
    smooth: Vec<Smooth>,
    /// Factors with their means, which are subtracted.
    factors: Vec<(C, f64)>,
    pub functions: Vec<Function>,
}

/// Whether a covariate changes with the frames alone: consecutive ones may have values of their own.
fn is_of_frames(covariate: C) -> bool {
    matches!(covariate, C::Time | C::Temperature | C::Quantity(_))
}

/// Amplitudes spread over decades.
fn scaled(covariate: C, value: f64) -> f64 {
    if covariate == C::Amplitude { value.ln() } else { value }
}

impl Smooth {
    /// The covariate as the axis has it.
    fn coordinate(&self, sample: &Sample) -> f64 {
        scaled(self.covariate, sample.value(self.covariate, self.of))
    }
}

impl Function {
    /// Its covariates.
    fn covariates(&self) -> BTreeSet<C> {
        let of_function: BTreeSet<C> =
            self.splines.iter().map(|smooth| smooth.covariate).chain(self.factor.map(|(c, _)| c)).collect();
        // A constant in millimetres or as a factor is a function of depth where inverse depth is measured.
        if of_function.is_empty() { BTreeSet::from([C::Z]) } else { of_function }
    }

    /// Number of its coefficients.
    pub fn count(&self) -> usize {
        self.splines.iter().map(|smooth| smooth.axis.count).product()
    }

    /// Change of inverse depth where its splines are 1.
    pub fn weight_in_inverse_depth(&self, sample: &Sample) -> f64 {
        let slope = sample.slopes[usize::from(self.of == Of::Measured)];
        self.factor.map_or(1.0, |factor| factor_at(factor, sample)) * sample.slope(self.of, self.on) / slope
    }

    fn words(&self) -> String {
        let names: Vec<&str> = self.splines.iter().map(|smooth| smooth.covariate.name()).collect();
        let splines = if names.is_empty() { "1".to_owned() } else { names.join(", ") };
        let factor = self.factor.map_or(String::new(), |(c, _)| format!("·{}", c.name()));
        format!("s({splines}){factor} {} {}", self.of.name(), self.on.name())
    }
}

/// The value of a factor at a sample; zero where it is unknown.
fn factor_at((covariate, mean): (C, f64), sample: &Sample) -> f64 {
    let value = sample.value(covariate, Of::True) - mean;
    if value.is_finite() { value } else { 0.0 }
}

impl Dictionary {
    /// The functions of the covariates that vary in the observations, with so many times the usual basis functions.
    pub fn of(observations: &Observations, finer: usize) -> Self {
        let smooth_of = |covariate: C, of: Of, count: usize| {
            let span = observations.span(covariate, of)?;
            let spans = (count - CUBIC) * finer;
            let [low, high] = [span.low, span.high].map(|end| scaled(covariate, end));
            let axis = Axis { low, high, count: spans + CUBIC, degree: CUBIC };
            (axis.high > axis.low).then_some(Smooth { covariate, of, axis })
        };
        let mut smooth: Vec<Smooth> =
            COVARIATES.iter().filter_map(|(c, count)| smooth_of(*c, Of::True, *count)).collect();
        let quantities = observations.with_quantities(&[]);
        smooth.extend(quantities.iter().filter_map(|c| smooth_of(*c, Of::True, OF_QUANTITIES)));
        smooth.extend(smooth_of(C::Z, Of::Measured, COVARIATES[3].1));
        let mean = |covariate: C| {
            let values = || observations.samples().map(|s| s.value(covariate, Of::True)).filter(|v| v.is_finite());
            values().sum::<f64>() / values().count().max(1) as f64
        };
        let varies = |c: &&C| observations.span(**c, Of::True).is_some();
        let factors: Vec<(C, f64)> = FACTORS.iter().chain(&quantities).filter(varies).map(|c| (*c, mean(*c))).collect();
        let covariates = COVARIATES.iter().map(|(covariate, _)| *covariate).chain(quantities).collect();
        let mut dictionary = Self { covariates, smooth, factors, functions: Vec::new() };
        dictionary.add_functions();
        dictionary.add_pairs(((OF_PAIRS - CUBIC) * finer + CUBIC).min(MOST_OF_PAIRS));
        dictionary
    }

    /// Its functions by the names of their covariates.
    pub fn searched(&self) -> DiagnosisSearched {
        let name = |covariate: &C| covariate.name().to_owned();
        let has = |covariate: &C| self.smooth.iter().any(|smooth| smooth.covariate == *covariate);
        let (functions_of, unknown): (Vec<C>, Vec<C>) = self.covariates.iter().copied().partition(has);
        let mut pairs: Vec<&[C; 2]> = PAIRS.iter().filter(|pair| pair.iter().all(has)).collect();
        pairs.sort_by_key(|pair| pair.map(|covariate| self.number(covariate)));
        DiagnosisSearched {
            functions_of: functions_of.iter().map(name).collect(),
            times: self.factors.iter().map(|(covariate, _)| name(covariate)).collect(),
            functions_of_pairs: pairs.iter().map(|pair| [name(&pair[0]), name(&pair[1])]).collect(),
            unknown: unknown.iter().map(name).collect(),
        }
    }

    /// The number of a covariate in the model.
    fn number(&self, covariate: C) -> usize {
        self.covariates.iter().position(|other| *other == covariate).unwrap_or(self.covariates.len())
    }

    /// The covariates of these numbers.
    pub fn covariates_of(&self, numbers: &BTreeSet<usize>) -> BTreeSet<C> {
        numbers.iter().filter_map(|number| self.covariates.get(*number).copied()).collect()
    }

    /// Forms differ by powers of depth: a function of depth has them all.
    fn forms(splines: &[Smooth]) -> &'static [On] {
        if splines.iter().any(|smooth| smooth.covariate == C::Z) { &[On::InverseDepth] } else { &On::ALL }
    }

    fn add_functions(&mut self) {
        let factors: Vec<Option<(C, f64)>> = once(None).chain(self.factors.iter().copied().map(Some)).collect();
        for smooth in once(None).chain(self.smooth.iter().copied().map(Some)) {
            for factor in &factors {
                if smooth.is_some_and(|s| factor.is_some_and(|(c, _)| c == s.covariate)) {
                    continue;
                }
                let splines: Vec<Smooth> = smooth.into_iter().collect();
                let function = |on: &On| Function {
                    splines: splines.clone(),
                    factor: *factor,
                    of: smooth.map_or(Of::True, |s| s.of),
                    on: *on,
                };
                self.functions.extend(Self::forms(&splines).iter().map(function));
            }
        }
    }

    fn add_pairs(&mut self, count: usize) {
        let spline = |covariate: C| {
            let smooth = self.smooth.iter().find(|smooth| smooth.covariate == covariate)?;
            Some(Smooth { axis: Axis { count, ..smooth.axis }, ..*smooth })
        };
        for [a, b] in PAIRS {
            let Some(splines) = spline(a).zip(spline(b)).map(|(a, b)| vec![a, b]) else { continue };
            let forms = Self::forms(&splines).iter();
            self.functions.extend(forms.map(|on| Function {
                splines: splines.clone(),
                factor: None,
                of: Of::True,
                on: *on,
            }));
        }
    }

    /// The column of a factor's weights in a place and form.
    fn weight(&self, factor: Option<C>, of: Of, on: On) -> usize {
        let place = |c: C| 1 + self.factors.iter().position(|(other, _)| *other == c).unwrap_or(0);
        let form = On::ALL.iter().position(|other| *other == on).unwrap_or(0);
        (factor.map_or(0, place) * Of::ALL.len() + usize::from(of == Of::Measured)) * On::ALL.len() + form
    }

    /// The additive model of the observations.
    pub fn model<'a>(&self, observations: &'a Observations) -> Additive<'a> {
        let column = |spline: &Smooth| {
            let is_same = |smooth: &Smooth| (smooth.covariate, smooth.of) == (spline.covariate, spline.of);
            self.smooth.iter().position(is_same).unwrap_or(0)
        };
        let group = |function: &Function| Group {
            axes: function.splines.iter().map(|spline| (column(spline), spline.axis)).collect(),
            weight: self.weight(function.factor.map(|(c, _)| c), function.of, function.on),
            covariates: function.covariates().into_iter().map(|covariate| self.number(covariate)).collect(),
            words: function.words(),
        };
        let cluster = |frame: &'a FrameRows| Cluster { rows: &frame.rows, table: self.table(frame) };
        Additive {
            clusters: observations.frames.iter().map(cluster).collect(),
            groups: self.functions.iter().map(group).collect(),
            sequential: self.covariates.iter().filter(|c| is_of_frames(**c)).map(|c| self.number(*c)).collect(),
        }
    }

    fn table(&self, frame: &FrameRows) -> Table {
        let rows = frame.samples.len();
        let mut covariates = DMatrix::zeros(rows, self.smooth.len());
        let mut weights = DMatrix::zeros(rows, (1 + self.factors.len()) * Of::ALL.len() * On::ALL.len());
        for (row, sample) in frame.samples.iter().enumerate() {
            for (column, smooth) in self.smooth.iter().enumerate() {
                covariates[(row, column)] = smooth.coordinate(sample);
            }
            let mut column = 0;
            for factor in once(None).chain(self.factors.iter().copied().map(Some)) {
                let factor = factor.map_or(1.0, |factor| factor_at(factor, sample));
                for of in Of::ALL {
                    for on in On::ALL {
                        weights[(row, column)] = factor * sample.slope(of, on);
                        column += 1;
                    }
                }
            }
        }
        Table { covariates, weights }
    }
}
