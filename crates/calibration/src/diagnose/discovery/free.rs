//! The free function of a term's covariates, in its place and form: what any formula of them could explain.

use depthcal_formula::FormulaCovariate as C;
use depthcal_model::{Of, On};
use depthcal_solver::additive::{Axis, CUBIC, smoothness_precision};
use nalgebra::{DMatrix, DVector};

use super::observations::{FrameRows, Observations};
use super::score::smooth_estimate;
use super::term::Term;

/// Basis functions over one covariate, and along each of two.
const ALONE: usize = 24;
const PAIRED: usize = 9;

/// A smooth function of a term's covariates, of which there are one or two, in its place and form.
pub(super) struct FreeFunction {
    covariates: Vec<C>,
    axes: Vec<Axis>,
    of: Of,
    on: On,
}

/// Gain on left-out frames of the best smooth function of a term's covariates.
pub(super) fn gain_of_free_function(observations: &Observations, term: &Term) -> f64 {
    let estimate = FreeFunction::of(observations, term).and_then(|free| free.estimate(observations));
    estimate.map_or(0.0, |(gain, _)| gain)
}

/// The observations without the best smooth function of a term's covariates; `None` where none predicts left-out frames.
pub(super) fn without_free_function(observations: &Observations, term: &Term) -> Option<Observations> {
    let free = FreeFunction::of(observations, term)?;
    let (_, step) = free.estimate(observations)?;
    Some(observations.shifted(|frame| free.columns(frame), &step))
}

impl FreeFunction {
    fn of(observations: &Observations, term: &Term) -> Option<Self> {
        let covariates: Vec<C> = term.covariates().into_iter().take(2).collect();
        let count = if covariates.len() == 1 { ALONE } else { PAIRED };
        Self::of_covariates(observations, &covariates, term.of, term.on, count)
    }

    /// A function of one covariate or of two, with so many basis functions along each; `None` where one hardly varies.
    pub fn of_covariates(observations: &Observations, covariates: &[C], of: Of, on: On, count: usize) -> Option<Self> {
        let axes: Option<Vec<Axis>> = covariates
            .iter()
            .map(|c| {
                let span = observations.span(*c, of)?;
                Some(Axis { low: scaled(*c, span.low), high: scaled(*c, span.high), count, degree: CUBIC })
            })
            .collect();
        let axes = axes.filter(|axes| !axes.is_empty())?;
        Some(Self { covariates: covariates.to_vec(), axes, of, on })
    }

    /// Its dimensions.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Its gain on left-out frames, and the step of the shared columns and of its coefficients.
    fn estimate(&self, observations: &Observations) -> Option<(f64, DVector<f64>)> {
        let normals = observations.normals_of(|frame| self.columns(frame));
        smooth_estimate(&normals, observations.shared, &smoothness_precision(&self.axes))
    }

    /// The columns of its coefficients.
    pub fn columns(&self, frame: &FrameRows) -> DMatrix<f64> {
        let axes = &self.axes;
        let width: usize = axes.iter().map(|axis| axis.count).product();
        let mut columns = DMatrix::zeros(frame.samples.len(), width);
        for (row, sample) in frame.samples.iter().enumerate() {
            let slope = sample.slope(self.of, self.on);
            let coordinate = |i: usize| scaled(self.covariates[i], sample.value(self.covariates[i], self.of));
            if !coordinate(0).is_finite() || (axes.len() > 1 && !coordinate(1).is_finite()) {
                continue;
            }
            let (first, a) = axes[0].basis(coordinate(0));
            match axes.get(1) {
                None => (0..=CUBIC).for_each(|i| columns[(row, first + i)] = slope * a[i]),
                Some(second) => {
                    let (start, b) = second.basis(coordinate(1));
                    for k in 0..=CUBIC {
                        for i in 0..=CUBIC {
                            columns[(row, (start + k) * axes[0].count + first + i)] = slope * a[i] * b[k];
                        }
                    }
                }
            }
        }
        columns
    }
}

/// Amplitudes spread over decades.
fn scaled(covariate: C, value: f64) -> f64 {
    if covariate == C::Amplitude { value.ln() } else { value }
}
