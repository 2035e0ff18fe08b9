//! Whether frames that a search has not seen confirm what it found: the sign and the size of its effect.

use nalgebra::{DMatrix, DVector};

use super::observations::Observations;
use super::score::estimate;
use super::term::Term;

/// Standard errors by which the size has to differ from zero.
const LEAST_T: f64 = 3.0;
/// Bounds of the size in the frames set aside over that in the others.
const SIZES: [f64; 2] = [0.5, 2.0];

/// Size of a term in the frames set aside, over that which the other frames give, with its standard error over frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Replication {
    pub size: f64,
    pub standard_error: f64,
}

impl Replication {
    /// Whether sign and size are confirmed.
    pub fn confirms(self) -> bool {
        self.size > LEAST_T * self.standard_error && (SIZES[0]..=SIZES[1]).contains(&self.size)
    }
}

/// The replication of a term that was found in the frames that are not set aside; `None` where it cannot be estimated, as without
/// frames that are.
pub(super) fn replicate(all: &Observations, term: &Term) -> Option<Replication> {
    let (searched, shared) = (all.searched(), all.shared);
    all.frames.iter().any(|frame| frame.is_set_aside).then_some(())?;
    let theta = estimate(&searched.normals(term), shared)?;
    // The effect as found, once for the frames of the search and once for those set aside, estimated jointly with all else.
    let normals = all.normals(term);
    let size = shared + 2;
    let combined: Vec<(DMatrix<f64>, DVector<f64>)> = normals
        .iter()
        .zip(&all.frames)
        .map(|(normal, frame)| {
            let more = theta.len();
            let column = shared + usize::from(frame.is_set_aside);
            let mut hessian = DMatrix::zeros(size, size);
            let mut gradient = DVector::zeros(size);
            hessian.view_mut((0, 0), (shared, shared)).copy_from(&normal.hessian.view((0, 0), (shared, shared)));
            gradient.rows_mut(0, shared).copy_from(&normal.gradient.rows(0, shared));
            let cross = normal.hessian.view((0, shared), (shared, more)) * &theta;
            hessian.view_mut((0, column), (shared, 1)).copy_from(&cross);
            hessian.view_mut((column, 0), (1, shared)).copy_from(&cross.transpose());
            hessian[(column, column)] = theta.dot(&(normal.hessian.view((shared, shared), (more, more)) * &theta));
            gradient[column] = normal.gradient.rows(shared, more).dot(&theta);
            (hessian, gradient)
        })
        .collect();
    let whole = combined.iter().fold(DMatrix::zeros(size, size), |sum, (h, _)| sum + h);
    let gradient = combined.iter().fold(DVector::zeros(size), |sum, (_, g)| sum + g);
    let inverse = whole.try_inverse()?;
    let step = -(&inverse * gradient);
    // Standard error over frames (sandwich): frames have errors of their own that single pixels do not show.
    let last = inverse.row(size - 1);
    let meat: f64 = combined
        .iter()
        .map(|(h, g)| {
            let left = g + h * &step;
            (last * left)[0].powi(2)
        })
        .sum();
    let frames = all.frames.len() as f64;
    Some(Replication { size: step[size - 1], standard_error: (meat * frames / (frames - 1.0)).sqrt() })
}
