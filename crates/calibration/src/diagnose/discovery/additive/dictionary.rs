//! The dictionary of the additive model.

use std::collections::BTreeSet;
use std::ops::Range;

use depthcal_formula::FormulaCovariate as C;
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
/// Values per row of a group of smooth functions.
pub(super) const WIDTH: usize = CUBIC + 1;

/// A covariate in a place, cut into basis functions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Smooth {
    pub covariate: C,
    pub of: Of,
    pub axis: Axis,
}

/// A smooth function of a covariate, or a constant, times a factor, in a place and form: a group of columns.
#[derive(Debug, Clone)]
pub(super) struct Group {
    /// Number of its covariate among [`Dictionary::smooth`]; `None` of a constant.
    pub smooth: Option<usize>,
    /// Number of its factor among [`Dictionary::factors`].
    pub factor: Option<usize>,
    pub of: Of,
    pub on: On,
    /// Its columns among all.
    pub columns: Range<usize>,
}

/// All groups.
#[derive(Debug)]
pub(super) struct Dictionary {
    pub smooth: Vec<Smooth>,
    /// Factors with their means, which are subtracted.
    pub factors: Vec<(C, f64)>,
    pub groups: Vec<Group>,
    pub width: usize,
}

/// Values of the basis functions, factors and slopes at a sample, of which the entries of all groups are products.
pub(super) struct Values {
    /// First basis function and values of every smooth covariate; zero where it is unknown.
    bases: Vec<(usize, [f64; WIDTH])>,
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
        smooth.extend(smooth_of(C::Z, Of::Measured, COVARIATES[3].1));
        let mean = |covariate: C| {
            let values = || observations.samples().map(|s| s.value(covariate, Of::True)).filter(|v| v.is_finite());
            values().sum::<f64>() / values().count().max(1) as f64
        };
        let varies = |c: &&C| observations.span(**c, Of::True).is_some();
        let factors: Vec<(C, f64)> = FACTORS.iter().filter(varies).map(|c| (*c, mean(*c))).collect();
        let mut dictionary = Self { smooth, factors, groups: Vec::new(), width: 0 };
        dictionary.add_groups();
        dictionary
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
                    self.groups.push(Group { smooth: number, factor: *factor, of: place, on: *on, columns });
                }
            }
        }
    }

    /// The axis of a group; `None` of a constant.
    pub fn axis(&self, number: usize) -> Option<Axis> {
        self.groups[number].smooth.map(|i| self.smooth[i].axis)
    }

    /// The covariates of a group.
    pub fn covariates(&self, group: &Group) -> BTreeSet<C> {
        let smooth = group.smooth.map(|i| self.smooth[i].covariate);
        let of_group: BTreeSet<C> = smooth.into_iter().chain(group.factor.map(|f| self.factors[f].0)).collect();
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
                let (first, entries) = values.entries(group);
                for (i, entry) in entries.iter().enumerate().take(group.columns.len()) {
                    columns[(row, start + first + i)] = *entry;
                }
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

    /// The number of the first column of a group that is not zero, counted within the group, and the entries from it on; of a
    /// constant the first alone.
    pub fn entries(&self, group: &Group) -> (usize, [f64; WIDTH]) {
        let factor = self.weight(group);
        match group.smooth {
            Some(smooth) => {
                let (first, values) = self.bases[smooth];
                (first, values.map(|value| value * factor))
            }
            None => (0, [factor, 0.0, 0.0, 0.0]),
        }
    }
}
