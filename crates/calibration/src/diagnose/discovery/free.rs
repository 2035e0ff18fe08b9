//! The free function of a term's covariates, in its place and form: what any formula of them could explain.

use depthcal_formula::FormulaCovariate as C;
use nalgebra::DMatrix;

use super::observations::{FrameRows, Observations};
use super::score::smooth_gain;
use super::term::Term;
use crate::diagnose::free_functions::smoothness_precision;
use crate::diagnose::spline_piece::{Axis, CUBIC};

/// Basis functions over one covariate, and along each of two.
const ALONE: usize = 24;
const PAIRED: usize = 9;

/// Gain on left-out frames of the best smooth function of a term's covariates, of which there are one or two.
pub(super) fn gain_of_free_function(observations: &Observations, term: &Term) -> f64 {
    let covariates: Vec<C> = term.covariates().into_iter().collect();
    let count = if covariates.len() == 1 { ALONE } else { PAIRED };
    // Amplitudes spread over decades.
    let scaled = |covariate: C, value: f64| if covariate == C::Amplitude { value.ln() } else { value };
    let axes: Option<Vec<Axis>> = covariates
        .iter()
        .take(2)
        .map(|c| {
            let span = observations.span(*c, term.of)?;
            Some(Axis { low: scaled(*c, span.low), high: scaled(*c, span.high), count, degree: CUBIC })
        })
        .collect();
    let Some(axes) = axes.filter(|axes| !axes.is_empty()) else { return 0.0 };
    let width: usize = axes.iter().map(|axis| axis.count).product();
    let columns = |frame: &FrameRows| {
        let mut columns = DMatrix::zeros(frame.samples.len(), width);
        for (row, sample) in frame.samples.iter().enumerate() {
            let slope = sample.slope(term.of, term.on);
            let at = |i: usize| scaled(covariates[i], sample.value(covariates[i], term.of));
            if !at(0).is_finite() || (axes.len() > 1 && !at(1).is_finite()) {
                continue;
            }
            let (first, a) = axes[0].basis(at(0));
            match axes.get(1) {
                None => (0..=CUBIC).for_each(|i| columns[(row, first + i)] = slope * a[i]),
                Some(second) => {
                    let (start, b) = second.basis(at(1));
                    for k in 0..=CUBIC {
                        for i in 0..=CUBIC {
                            columns[(row, (start + k) * axes[0].count + first + i)] = slope * a[i] * b[k];
                        }
                    }
                }
            }
        }
        columns
    };
    smooth_gain(&observations.normals_of(columns), observations.shared, &smoothness_precision(&axes))
}
