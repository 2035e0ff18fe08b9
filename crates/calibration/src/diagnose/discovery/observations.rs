//! The depth observations of a fit as rows of a linear problem from which poses have been eliminated: what a column added to them
//! would explain, frame by frame.

use depthcal_formula::FormulaCovariate as C;
use depthcal_model::chain::POSE;
use depthcal_model::{Camera, Context, Of, On, Quantities};
use depthcal_solver::additive::{ClusterRows, Normal};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::library::Span;
use super::term::Term;
use crate::adjust::adjustment::Adjustment;
use crate::adjust::smoothness_selection::prior_of_smooth_functions;
use crate::calibrate::CalibratedCamera;
use crate::diagnose::candidate_blocks::with_probes;
use crate::diagnose::observed_states::Range;
use crate::observe::board_plane::BoardPlane;

/// Depth samples that take part, about: more make the search slower and its answers no better.
const MOST_SAMPLES: usize = 12_000;

/// Blocks of consecutive frames; every third is set aside.
const BLOCKS: usize = 9;

/// Least length of a covariate's range, over its largest value.
const LEAST_SPAN: f64 = 0.02;

/// A depth sample: what terms depend on, and how its residual changes where inverse depth is changed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Ray (x, y), true inverse depth and cosine of the angle of incidence.
    pub state: [f64; 4],
    /// Inverse depth that the model says the camera measures.
    pub measured_rho: f64,
    pub context: Context,
    /// The residual, in standard deviations.
    pub residual: f64,
    /// ∂residual/∂ρ before the depth model, and behind it.
    pub slopes: [f64; 2],
}

/// The rows of a frame.
#[derive(Debug, Clone)]
pub(super) struct FrameRows {
    pub samples: Vec<Sample>,
    /// One row per sample, the pose eliminated.
    pub rows: ClusterRows,
    /// Whether the frame is set aside: searches do not see it, so that it can confirm what they find.
    pub is_set_aside: bool,
}

/// The rows of all frames.
#[derive(Debug, Clone)]
pub(super) struct Observations {
    pub frames: Vec<FrameRows>,
    pub shared: usize,
}

/// Whether a frame is in a block that is set aside.
fn is_in_block_set_aside(frame: usize, frames: usize) -> bool {
    (frame * BLOCKS / frames.max(1)) % 3 == 1
}

impl Sample {
    /// Inverse depth in a place.
    fn rho(&self, of: Of) -> f64 {
        if of == Of::True { self.state[2] } else { self.measured_rho }
    }

    /// The value of a covariate in a place; NaN where it is unknown.
    #[inline]
    pub fn value(&self, covariate: C, of: Of) -> f64 {
        let [x, y, _, cosine] = self.state;
        covariate.value(&[x, y, self.rho(of), cosine], &self.context)
    }

    /// Change of the residual by a value of 1 in a place and a form.
    #[inline]
    pub fn slope(&self, of: Of, on: On) -> f64 {
        let rho = self.rho(of);
        let slope = self.slopes[usize::from(of == Of::Measured)];
        slope
            * match on {
                On::Depth => -rho * rho,
                On::InverseDepth => 1.0,
                On::Factor => -rho,
            }
    }
}

impl Observations {
    /// The rows of a fit; `None` where its frames cannot be evaluated.
    pub fn of(fit: &CalibratedCamera) -> Option<Self> {
        Self::thinned(fit, MOST_SAMPLES)
    }

    /// The samples of all frames.
    pub fn samples(&self) -> impl Iterator<Item = &Sample> + Clone {
        self.frames.iter().flat_map(|frame| &frame.samples)
    }

    /// The rows of about so many samples of a fit at most; `None` where its frames cannot be evaluated.
    pub fn thinned(fit: &CalibratedCamera, most_samples: usize) -> Option<Self> {
        let (camera, probes) = with_probes(&fit.camera);
        let adjustment = Adjustment::new(&fit.capture, &camera, &fit.noise, true);
        let starts: Vec<usize> = camera.parameter_ranges().map(|range| range.start).collect();
        let free = camera.free_parameters();
        let columns: Vec<usize> =
            free.iter().copied().chain(probes.map(|block| starts[block])).map(|column| POSE + column).collect();
        let shared = free.len();
        let total: usize = fit.capture.frames.iter().map(|frame| frame.samples.len()).sum();
        let step = total.div_ceil(most_samples).max(1);
        let frames: Vec<FrameRows> = (0..fit.capture.frames.len())
            .into_par_iter()
            .filter_map(|index| {
                let frame = &fit.capture.frames[index];
                let [image, depth] = adjustment.weighted_parts(index, &columns)?;
                let size = POSE + shared;
                let mut normal = DMatrix::zeros(size, size);
                let mut gradient = DVector::zeros(size);
                let (jacobian, residuals) = image;
                let n = jacobian.ncols();
                normal.view_mut((0, 0), (n, n)).gemm_tr(1.0, &jacobian, &jacobian, 1.0);
                gradient.rows_mut(0, n).gemm_tr(1.0, &jacobian, &residuals, 1.0);
                let (jacobian, residuals) = depth;
                let rows: Vec<usize> = (0..residuals.len()).step_by(step).collect();
                let jacobian = jacobian.select_rows(&rows);
                let residuals = residuals.select_rows(&rows);
                let model_jacobian = jacobian.columns(0, size).into_owned();
                normal.gemm_tr(1.0, &model_jacobian, &model_jacobian, 1.0);
                gradient.gemm_tr(1.0, &model_jacobian, &residuals, 1.0);

                let plane = BoardPlane::new(&frame.camera_from_board);
                let samples: Option<Vec<Sample>> = rows
                    .iter()
                    .enumerate()
                    .map(|(row, sample)| {
                        let sample = &frame.samples[*sample];
                        let ray = fit.camera.ray(sample.context.pixel, 1.0 / sample.depth_mm).ok()?;
                        let state = plane.depth_state(ray)?;
                        let measured_rho = fit.camera.measured_inverse_depth(&sample.context, ray, state[3], state[2]);
                        let slopes = [0, 1].map(|probe| jacobian[(row, size + probe)]);
                        Some(Sample { state, measured_rho, context: sample.context, residual: residuals[row], slopes })
                    })
                    .collect();
                let rows = ClusterRows::new(&model_jacobian, &residuals, &Normal { hessian: normal, gradient }, POSE)?;
                Some(FrameRows { samples: samples?, rows, is_set_aside: false })
            })
            .collect();
        (frames.len() > 2).then(|| Self { frames, shared }.with_smooth_functions(&camera))
    }

    /// Adds the priors of smooth functions that pieces of the camera have themselves: every frame has its share of them.
    fn with_smooth_functions(mut self, camera: &Camera) -> Self {
        let (mut precision, mut pull) = prior_of_smooth_functions(camera);
        let frames = self.frames.len() as f64;
        precision /= frames;
        pull /= frames;
        for frame in &mut self.frames {
            frame.rows.add_shared(&precision, &pull);
        }
        self
    }

    /// Sets frames aside: those of another capture under the same camera where there is one, else blocks of its own.
    pub fn with_set_aside(mut self, other: Option<Self>) -> Self {
        let count = self.frames.len();
        match other {
            Some(other) => {
                let aside = other.frames.into_iter().map(|frame| FrameRows { is_set_aside: true, ..frame });
                self.frames.extend(aside);
            }
            None => {
                for (i, frame) in self.frames.iter_mut().enumerate() {
                    frame.is_set_aside = is_in_block_set_aside(i, count);
                }
            }
        }
        self
    }

    /// Those that are not set aside.
    pub fn searched(&self) -> Self {
        let frames = self.frames.iter().filter(|frame| !frame.is_set_aside).cloned();
        Self { frames: frames.collect(), shared: self.shared }
    }

    /// Covariates, and the quantities that the samples have besides.
    pub fn with_quantities(&self, covariates: &[C]) -> Vec<C> {
        let quantities = Quantities::names_of(self.samples().map(|sample| &sample.context.quantities));
        covariates.iter().copied().chain(quantities.into_iter().map(C::Quantity)).collect()
    }

    /// The range of a covariate; `None` where it is unknown in a tenth of the samples or hardly varies.
    pub fn span(&self, covariate: C, of: Of) -> Option<Span> {
        let samples = self.frames.iter().flat_map(|frame| &frame.samples);
        let values: Vec<f64> = samples.map(|sample| sample.value(covariate, of)).collect();
        let known = values.iter().filter(|v| v.is_finite()).count();
        let range = Range::of(values.iter().copied()).filter(|_| known * 10 >= values.len() * 9)?;
        let varies = range.span() > LEAST_SPAN * range.high.abs().max(range.low.abs());
        varies.then_some(Span { low: range.low, middle: range.middle, high: range.high })
    }

    /// Sum of the frames' normal matrices of the shared columns.
    pub fn shared_hessian(&self) -> DMatrix<f64> {
        self.frames.iter().fold(DMatrix::zeros(self.shared, self.shared), |sum, frame| sum + frame.rows.hessian())
    }

    /// The rows with the residuals after a step of the shared columns and of others, which are given by frame.
    pub fn shifted(&self, columns: impl Fn(&FrameRows) -> DMatrix<f64> + Sync, step: &DVector<f64>) -> Self {
        let shifted = |frame: &FrameRows| FrameRows {
            samples: frame.samples.clone(),
            rows: frame.rows.shifted(&columns(frame), step),
            is_set_aside: frame.is_set_aside,
        };
        let frames = self.frames.par_iter().map(shifted);
        Self { frames: frames.collect(), shared: self.shared }
    }

    /// The frames' normal equations over the shared columns and those of a term.
    pub fn normals(&self, term: &Term) -> Vec<Normal> {
        self.normals_of(|frame| frame.columns(term))
    }

    /// The frames' normal equations over the shared columns and any others, given by frame.
    pub fn normals_of(&self, columns: impl Fn(&FrameRows) -> DMatrix<f64> + Sync) -> Vec<Normal> {
        self.frames.par_iter().map(|frame| frame.rows.normal(&columns(frame))).collect()
    }
}

impl FrameRows {
    /// The columns of a term: what its parameters change the residuals by.
    pub fn columns(&self, term: &Term) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(self.samples.len(), term.columns());
        for (row, sample) in self.samples.iter().enumerate() {
            let slope = sample.slope(term.of, term.on);
            let mut next = 0;
            for product in &term.products {
                let factor = product.factor.map_or(1.0, |f| f.values(sample.value(f.covariate, term.of))[0]);
                let values = product.function.values(sample.value(product.function.covariate, term.of));
                for value in &values[..product.columns()] {
                    let entry = slope * factor * value;
                    columns[(row, next)] = if entry.is_finite() { entry } else { 0.0 };
                    next += 1;
                }
            }
        }
        columns
    }
}
