//! The dictionary of the additive model.

use std::collections::BTreeSet;
use std::iter::once;

use depthcal_formula::{FormulaCovariate as C, MOST_PARAMETERS};
use depthcal_io::DiagnosisSearched;
use depthcal_model::{Of, On};
use depthcal_solver::additive::{Additive, Axis, CUBIC, Cluster, Found, Group, Table};
use nalgebra::DMatrix;

use super::super::observations::{FrameRows, Observations, Sample};

/// Covariates of smooth functions, with the number of their basis functions: errors of single columns and rows, rings, and waves
/// over depth are finer than effects of amplitude, incidence, time and temperature.
const COVARIATES: [(C, usize); 8] = [
    (C::X, 16),
    (C::Y, 16),
    (C::R, 16),
    (C::Z, 24),
    (C::Incidence, 16),
    (C::Amplitude, 16),
    (C::Time, 16),
    (C::Temperature, 12),
];
/// Covariates that functions are multiplied with.
const FACTORS: [C; 5] = [C::X, C::Y, C::R, C::Time, C::Temperature];
/// Basis functions of functions of quantities that users record.
const OF_QUANTITIES: usize = 6;
/// Most basis functions of functions of pairs along each.
const OF_PAIRS: usize = 6;
/// … where they are finer, and of functions of one covariate: formulas have a limit of parameters.
const MOST_OF_PAIRS: usize = 9;
const MOST_OF_ONE: usize = 45;
/// Most basis functions along the one of two covariates along which a function is fine …
const FINE: usize = 16;
/// … and the number along the other.
const COARSE: usize = 4;
/// Form in which functions of two covariates are compared: those of the other forms differ by a power of depth.
const FORM_OF_PAIRS: On = On::Factor;
/// Most quantities that users record of which there are functions of pairs.
const PAIRED_QUANTITIES: usize = 2;

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

/// Functions, in the order of the groups of their [`Additive`] model.
#[derive(Debug, Clone)]
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
    /// The covariate cut into so many basis functions.
    fn with_count(self, count: usize) -> Self {
        Self { axis: Axis { count, ..self.axis }, ..self }
    }

    /// The covariate as the axis has it.
    fn coordinate(&self, sample: &Sample) -> f64 {
        scaled(self.covariate, sample.value(self.covariate, self.of))
    }
}

impl Function {
    /// A function of two covariates in the form in which these are compared.
    fn compared(splines: Vec<Smooth>, factor: Option<(C, f64)>) -> Self {
        let forms = Dictionary::forms(&splines);
        let on = if forms.contains(&FORM_OF_PAIRS) { FORM_OF_PAIRS } else { forms[0] };
        Self { of: splines.first().map_or(Of::True, |smooth| smooth.of), on, splines, factor }
    }

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
    /// The functions of one covariate that varies in the observations, alone or times another, and those of two. Products with
    /// another covariate are finer than functions of two, and show less by their fewer parameters.
    pub fn of(observations: &Observations) -> Self {
        let smooth_of = |covariate: C, of: Of, count: usize| {
            let span = observations.span(covariate, of)?;
            let [low, high] = [span.low, span.high].map(|end| scaled(covariate, end));
            let axis = Axis { low, high, count, degree: CUBIC };
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
        for smooth in once(None).chain(dictionary.smooth.clone().into_iter().map(Some)) {
            let splines: Vec<Smooth> = smooth.into_iter().collect();
            dictionary.add_in_all_forms(&Function::compared(splines.clone(), None));
            for factor in dictionary.factors.clone() {
                if smooth.is_none_or(|smooth| smooth.covariate != factor.0) {
                    dictionary.functions.push(Function::compared(splines.clone(), Some(factor)));
                }
            }
        }
        let functions = dictionary.pairs().into_iter().map(|splines| Function::compared(splines.to_vec(), None));
        dictionary.functions.extend(functions.collect::<Vec<_>>());
        dictionary
    }

    /// A covariate as functions of it alone have it.
    fn alone(&self, covariate: C) -> Option<Smooth> {
        self.smooth.iter().find(|smooth| smooth.covariate == covariate).copied()
    }

    /// The pairs of covariates of which there are functions of two.
    fn pairs(&self) -> Vec<[Smooth; 2]> {
        let quantities = self.covariates.iter().filter(|c| matches!(c, C::Quantity(_)));
        let unpaired: Vec<C> = quantities.skip(PAIRED_QUANTITIES).copied().collect();
        let takes_part = |smooth: &&Smooth| smooth.of == Of::True && !unpaired.contains(&smooth.covariate);
        let coarse = |smooth: &Smooth| smooth.with_count(smooth.axis.count.min(OF_PAIRS));
        let smooth: Vec<Smooth> = self.smooth.iter().filter(takes_part).map(coarse).collect();
        let pairs = smooth.iter().enumerate().flat_map(|(place, a)| smooth[place + 1..].iter().map(|b| [*a, *b]));
        // Radius is a function of x and y.
        let is_new = |[a, b]: &[Smooth; 2]| ![[C::X, C::R], [C::Y, C::R]].contains(&[a.covariate, b.covariate]);
        pairs.filter(is_new).collect()
    }

    /// Functions of it, by their numbers, and then those of two covariates that are fine along one of them, which are many and
    /// wide.
    pub fn with_fine_pairs(&self, functions: &[usize]) -> Self {
        let known = functions.iter().filter_map(|number| self.functions.get(*number).cloned());
        let mut wide = Self { functions: known.collect(), ..self.clone() };
        for [a, b] in self.pairs() {
            for (along, across) in [(a, b), (b, a)] {
                let count = self.alone(along.covariate).map_or(0, |smooth| smooth.axis.count.min(FINE));
                if count > OF_PAIRS {
                    let splines = vec![along.with_count(count), across.with_count(COARSE)];
                    wide.functions.push(Function::compared(splines, None));
                }
            }
        }
        wide
    }

    /// Functions of it, by their numbers, and then those that may take their places: finer ones and those of other forms; for a
    /// function of two covariates also products of a function of one with the other, and functions of each alone.
    pub fn with_alternatives(&self, functions: &[usize]) -> Self {
        let functions: Vec<Function> =
            functions.iter().filter_map(|number| self.functions.get(*number).cloned()).collect();
        let mut all = Self { functions: functions.clone(), ..self.clone() };
        all.functions.extend(all.finer(2).functions);
        for function in &functions {
            all.add_in_all_forms(function);
            if let [a, b] = &function.splines[..] {
                for (along, across) in [(a, b), (b, a)] {
                    let Some(smooth) = self.alone(along.covariate) else { continue };
                    all.add_in_all_forms(&Function::compared(vec![smooth], None));
                    if let Some(factor) = self.factors.iter().find(|(covariate, _)| *covariate == across.covariate) {
                        all.add_in_all_forms(&Function::compared(vec![smooth], Some(*factor)));
                    }
                }
            }
        }
        let mut seen = BTreeSet::new();
        all.functions.retain(|function| seen.insert((function.words(), function.count())));
        all
    }

    /// Its functions with so many times as many pieces.
    pub fn finer(&self, times: usize) -> Self {
        let mut finer = self.clone();
        for function in &mut finer.functions {
            let most = if function.splines.len() > 1 { MOST_OF_PAIRS } else { MOST_OF_ONE };
            for place in 0..function.splines.len() {
                // A formula has a limit of parameters.
                let across = function.count() / function.splines[place].axis.count;
                let axis = &mut function.splines[place].axis;
                let most = most.max(axis.count).min(MOST_PARAMETERS / across);
                axis.count = ((axis.count - CUBIC) * times + CUBIC).min(most);
            }
        }
        finer
    }

    /// Its functions by the names of their covariates.
    pub fn searched(&self) -> DiagnosisSearched {
        let name = |covariate: &C| covariate.name().to_owned();
        let has = |covariate: &C| self.smooth.iter().any(|smooth| smooth.covariate == *covariate);
        let (functions_of, unknown): (Vec<C>, Vec<C>) = self.covariates.iter().copied().partition(has);
        DiagnosisSearched {
            functions_of: functions_of.iter().map(name).collect(),
            times: self.factors.iter().map(|(covariate, _)| name(covariate)).collect(),
            functions_of_pairs: self.pairs().iter().map(|pair| pair.map(|smooth| name(&smooth.covariate))).collect(),
            unknown: unknown.iter().map(name).collect(),
        }
    }

    /// Functions that were found, each with as many groups as one formula can have.
    pub fn within_formulas(&self, found: Vec<Found>) -> Vec<Found> {
        let count = |group: &usize| self.functions.get(*group).map_or(0, Function::count);
        let divided = |function: Found| {
            let mut parts: Vec<Vec<usize>> = Vec::new();
            for group in &function.groups {
                let fits = |part: &Vec<usize>| part.iter().chain([group]).map(count).sum::<usize>() <= MOST_PARAMETERS;
                match parts.last_mut().filter(|part| fits(part)) {
                    Some(part) => part.push(*group),
                    None => parts.push(vec![*group]),
                }
            }
            let share = function.share / parts.len() as f64;
            parts.into_iter().map(move |groups| Found { groups, share, ..function.clone() })
        };
        found.into_iter().flat_map(divided).collect()
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

    fn add_in_all_forms(&mut self, function: &Function) {
        let forms = Self::forms(&function.splines).iter();
        self.functions.extend(forms.map(|on| Function { on: *on, ..function.clone() }));
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
