//! The dictionary of the additive model.

use std::collections::BTreeSet;
use std::ops::Range;

use depthcal_formula::FormulaCovariate as C;
use depthcal_io::DiagnosisSearched;
use depthcal_model::{Of, On};
use nalgebra::DMatrix;

use super::super::observations::{FrameRows, Observations, Sample};
use crate::diagnose::spline_piece::{Axis, CUBIC};

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
/// Values per row of a group of smooth functions.
pub(super) const WIDTH: usize = CUBIC + 1;

/// A covariate in a place, cut into basis functions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Smooth {
    pub covariate: C,
    pub of: Of,
    pub axis: Axis,
}

/// A smooth function of a covariate, or a constant, times a factor, or a smooth function of two covariates, in a place and
/// form: a group of columns.
#[derive(Debug, Clone)]
pub(super) struct Group {
    /// Number of its covariate among [`Dictionary::smooth`]; `None` of a constant.
    pub smooth: Option<usize>,
    /// Number of its factor among [`Dictionary::factors`].
    pub factor: Option<usize>,
    /// Numbers of its two covariates among [`Dictionary::coarse`].
    pub pair: Option<[usize; 2]>,
    pub of: Of,
    pub on: On,
    /// Its columns among all.
    pub columns: Range<usize>,
}

/// All groups.
#[derive(Debug)]
pub(super) struct Dictionary {
    pub smooth: Vec<Smooth>,
    /// Covariates of functions of two.
    pub coarse: Vec<Smooth>,
    /// Factors with their means, which are subtracted.
    pub factors: Vec<(C, f64)>,
    pub groups: Vec<Group>,
    pub width: usize,
}

/// Values of the basis functions, factors and slopes at a sample, of which the entries of all groups are products.
pub(super) struct Values {
    /// First basis function and values of every smooth covariate; zero where it is unknown.
    bases: Vec<(usize, [f64; WIDTH])>,
    /// Those of functions of two covariates, with their numbers of basis functions.
    coarse: Vec<(usize, [f64; WIDTH], usize)>,
    factors: Vec<f64>,
    /// By place and form.
    slopes: [[f64; 3]; 2],
}

/// Amplitudes spread over decades.
fn scaled(covariate: C, value: f64) -> f64 {
    if covariate == C::Amplitude { value.ln() } else { value }
}

impl Smooth {
    /// The covariate as the axis has it.
    pub fn coordinate(&self, sample: &Sample) -> f64 {
        scaled(self.covariate, sample.value(self.covariate, self.of))
    }
}

impl Dictionary {
    /// The groups of the covariates that vary in the observations, with so many times the usual basis functions.
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
        let of_pairs = (OF_PAIRS - CUBIC) * finer;
        let of_pairs = (of_pairs + CUBIC).min(MOST_OF_PAIRS);
        let coarse = [C::X, C::Y, C::R, C::Z].into_iter().filter_map(|covariate| {
            let axis = smooth_of(covariate, Of::True, OF_PAIRS)?;
            Some(Smooth { axis: Axis { count: of_pairs, ..axis.axis }, ..axis })
        });
        let coarse = coarse.collect();
        let mut dictionary = Self { smooth, coarse, factors, groups: Vec::new(), width: 0 };
        dictionary.add_groups();
        dictionary.add_pairs();
        dictionary
    }

    /// Its functions by the names of their covariates.
    pub fn searched(&self) -> DiagnosisSearched {
        let name = |covariate: &C| covariate.name().to_owned();
        let has = |covariate: &C| self.smooth.iter().any(|smooth| smooth.covariate == *covariate);
        let (mut functions_of, unknown): (Vec<C>, Vec<C>) =
            COVARIATES.iter().map(|(covariate, _)| *covariate).partition(has);
        functions_of.extend(self.smooth.iter().map(|s| s.covariate).filter(|c| matches!(c, C::Quantity(_))));
        let pairs: BTreeSet<[usize; 2]> = self.groups.iter().filter_map(|group| group.pair).collect();
        DiagnosisSearched {
            functions_of: functions_of.iter().map(name).collect(),
            times: self.factors.iter().map(|(covariate, _)| name(covariate)).collect(),
            functions_of_pairs: pairs.iter().map(|pair| pair.map(|i| name(&self.coarse[i].covariate))).collect(),
            unknown: unknown.iter().map(name).collect(),
        }
    }

    fn add_groups(&mut self) {
        let factors: Vec<Option<usize>> = std::iter::once(None).chain((0..self.factors.len()).map(Some)).collect();
        for number in std::iter::once(None).chain((0..self.smooth.len()).map(Some)) {
            let smooth = number.map(|i| self.smooth[i]);
            for factor in &factors {
                if smooth.is_some_and(|s| factor.is_some_and(|f| self.factors[f].0 == s.covariate)) {
                    continue;
                }
                // Forms differ by powers of depth: a function of depth has them all.
                let forms =
                    if smooth.is_some_and(|s| s.covariate == C::Z) { &[On::InverseDepth][..] } else { &On::ALL };
                for on in forms {
                    let count = smooth.map_or(1, |s| s.axis.count);
                    let columns = self.width..self.width + count;
                    self.width = columns.end;
                    let place = smooth.map_or(Of::True, |s| s.of);
                    self.groups.push(Group {
                        smooth: number,
                        factor: *factor,
                        pair: None,
                        of: place,
                        on: *on,
                        columns,
                    });
                }
            }
        }
    }

    fn add_pairs(&mut self) {
        let number = |covariate: C| self.coarse.iter().position(|smooth| smooth.covariate == covariate);
        let pairs: Vec<[usize; 2]> = PAIRS.iter().filter_map(|[a, b]| Some([number(*a)?, number(*b)?])).collect();
        for pair in pairs {
            let has_depth = pair.iter().any(|i| self.coarse[*i].covariate == C::Z);
            let forms = if has_depth { &[On::InverseDepth][..] } else { &On::ALL };
            for on in forms {
                let columns =
                    self.width..self.width + pair.iter().map(|i| self.coarse[*i].axis.count).product::<usize>();
                self.width = columns.end;
                let group = Group { smooth: None, factor: None, pair: Some(pair), of: Of::True, on: *on, columns };
                self.groups.push(group);
            }
        }
    }

    /// The axes of a group; none of a constant.
    pub fn axes(&self, number: usize) -> Vec<Axis> {
        let Group { smooth, pair, .. } = &self.groups[number];
        let of_pair = pair.iter().flatten().map(|i| self.coarse[*i].axis);
        smooth.iter().map(|i| self.smooth[*i].axis).chain(of_pair).collect()
    }

    /// The covariates of a group.
    pub fn covariates(&self, group: &Group) -> BTreeSet<C> {
        let smooth = group.smooth.map(|i| self.smooth[i].covariate);
        let of_pair = group.pair.iter().flatten().map(|i| self.coarse[*i].covariate);
        let of_group: BTreeSet<C> =
            smooth.into_iter().chain(group.factor.map(|f| self.factors[f].0)).chain(of_pair).collect();
        // A constant in millimetres or as a factor is a function of depth where inverse depth is measured.
        if of_group.is_empty() { BTreeSet::from([C::Z]) } else { of_group }
    }

    /// Values of the basis functions, factors and slopes at a sample.
    pub fn values(&self, sample: &Sample) -> Values {
        let basis = |smooth: &Smooth| {
            let coordinate = smooth.coordinate(sample);
            if coordinate.is_finite() { smooth.axis.basis(coordinate) } else { (0, [0.0; WIDTH]) }
        };
        let factor = |(covariate, mean): &(C, f64)| {
            let value = sample.value(*covariate, Of::True) - mean;
            if value.is_finite() { value } else { 0.0 }
        };
        Values {
            bases: self.smooth.iter().map(basis).collect(),
            coarse: self
                .coarse
                .iter()
                .map(|smooth| {
                    let (first, values) = basis(smooth);
                    (first, values, smooth.axis.count)
                })
                .collect(),
            factors: self.factors.iter().map(factor).collect(),
            slopes: Of::ALL.map(|of| On::ALL.map(|on| sample.slope(of, on))),
        }
    }

    /// Change of inverse depth where the smooth function of a group is 1.
    pub fn weight_in_inverse_depth(&self, group: &Group, sample: &Sample) -> f64 {
        let slope = sample.slopes[usize::from(group.of == Of::Measured)];
        self.values(sample).weight(group) / slope
    }

    /// The columns of some groups in a frame, one after the other.
    pub fn columns(&self, frame: &FrameRows, groups: &[usize]) -> DMatrix<f64> {
        let width: usize = groups.iter().map(|g| self.groups[*g].columns.len()).sum();
        let mut columns = DMatrix::zeros(frame.samples.len(), width);
        for (row, sample) in frame.samples.iter().enumerate() {
            let values = self.values(sample);
            let mut start = 0;
            for group in groups.iter().map(|g| &self.groups[*g]) {
                values.runs(group, |first, entries| {
                    for (i, entry) in entries.iter().enumerate().take(group.columns.len()) {
                        columns[(row, start + first + i)] = *entry;
                    }
                });
                start += group.columns.len();
            }
        }
        columns
    }
}

impl Values {
    /// Change of the residual where the smooth function of a group is 1.
    pub fn weight(&self, group: &Group) -> f64 {
        let place = usize::from(group.of == Of::Measured);
        let form = On::ALL.iter().position(|on| *on == group.on).unwrap_or(0);
        group.factor.map_or(1.0, |f| self.factors[f]) * self.slopes[place][form]
    }

    /// Hands on the columns of a group that are not zero in runs, by the number of the first, counted within the group: of a
    /// function of one covariate one run, of two one for every basis function along the second, of a constant its one column.
    pub fn runs(&self, group: &Group, mut run: impl FnMut(usize, [f64; WIDTH])) {
        let weight = self.weight(group);
        match (group.smooth, group.pair) {
            (_, Some([u, v])) => {
                let ((first, along, per_row), (first_row, across, _)) = (self.coarse[u], self.coarse[v]);
                for (row, value) in across.iter().enumerate() {
                    run((first_row + row) * per_row + first, along.map(|entry| entry * value * weight));
                }
            }
            (Some(smooth), None) => {
                let (first, values) = self.bases[smooth];
                run(first, values.map(|value| value * weight));
            }
            (None, None) => run(0, [weight, 0.0, 0.0, 0.0]),
        }
    }
}
