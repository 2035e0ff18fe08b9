//! The mapping from board to image under an unknown lens: a homography and a smooth correction.

use nalgebra::{DMatrix, DVector};

use super::homography::Homography;

/// Terms of a cubic in two variables.
const TERMS: usize = 10;

/// A smooth map from the board (mm) to the image (px), fitted to markers: a homography plus a cubic polynomial in board
/// coordinates that absorbs lens distortion. With fewer than 20 markers there is no polynomial.
#[derive(Debug, Clone)]
pub struct BoardMap {
    homography: Homography,
    /// Centre and half size of the markers on the board: polynomials are evaluated in [−1, 1].
    center: [f64; 2],
    scale: f64,
    correction: Option<[[f64; TERMS]; 2]>,
    /// Inverse of the normal matrix of the polynomial's terms.
    inverse: Option<DMatrix<f64>>,
    rms_px: f64,
}

fn terms([x, y]: [f64; 2]) -> [f64; TERMS] {
    [1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y]
}

impl BoardMap {
    /// Fits the map to pairs (board mm, image px). `None` when they do not determine a homography.
    pub fn fit(pairs: &[([f64; 2], [f64; 2])]) -> Option<BoardMap> {
        let homography = Homography::fit(pairs)?;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (p, _) in pairs {
            for i in 0..2 {
                low[i] = low[i].min(p[i]);
                high[i] = high[i].max(p[i]);
            }
        }
        let center = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0];
        let scale = ((high[0] - low[0]).max(high[1] - low[1]) / 2.0).max(f64::MIN_POSITIVE);
        let mut map = BoardMap { homography, center, scale, correction: None, inverse: None, rms_px: 0.0 };
        if pairs.len() >= 2 * TERMS {
            map.correction = map.fit_correction(pairs);
        }
        let squares: f64 = pairs
            .iter()
            .map(|(p, q)| map.apply(*p).map_or(f64::INFINITY, |r| (r[0] - q[0]).powi(2) + (r[1] - q[1]).powi(2)))
            .sum();
        map.rms_px = (squares / pairs.len() as f64).sqrt();
        Some(map)
    }

    fn fit_correction(&mut self, pairs: &[([f64; 2], [f64; 2])]) -> Option<[[f64; TERMS]; 2]> {
        let design = DMatrix::from_fn(pairs.len(), TERMS, |i, j| terms(self.unit(pairs[i].0))[j]);
        // Slight damping keeps the solution finite when the markers do not determine every term.
        let normal = design.tr_mul(&design) + DMatrix::identity(TERMS, TERMS) * (1e-6 * pairs.len() as f64);
        let solve = normal.cholesky()?;
        let mut correction = [[0.0; TERMS]; 2];
        for (axis, row) in correction.iter_mut().enumerate() {
            let mut left = DVector::zeros(pairs.len());
            for (i, (p, q)) in pairs.iter().enumerate() {
                left[i] = q[axis] - self.homography.apply(*p)?[axis];
            }
            row.copy_from_slice(solve.solve(&design.tr_mul(&left)).as_slice());
        }
        self.inverse = Some(solve.inverse());
        Some(correction)
    }

    /// By what factor the distance of a marker from the map scatters more than that of the markers which it was fitted to:
    /// √(1 + t N⁻¹ tᵀ) of the terms t at the marker and their normal matrix N. It is large away from them. `None` without a
    /// polynomial.
    pub(crate) fn leverage(&self, board: [f64; 2]) -> Option<f64> {
        let t = DVector::from_row_slice(&terms(self.unit(board)));
        Some((1.0 + t.dot(&(self.inverse.as_ref()? * &t))).sqrt())
    }

    fn unit(&self, p: [f64; 2]) -> [f64; 2] {
        [(p[0] - self.center[0]) / self.scale, (p[1] - self.center[1]) / self.scale]
    }

    /// Maps a board point; `None` at and beyond the horizon.
    pub fn apply(&self, board: [f64; 2]) -> Option<[f64; 2]> {
        let mut pixel = self.homography.apply(board)?;
        if let Some(correction) = &self.correction {
            let t = terms(self.unit(board));
            for axis in 0..2 {
                pixel[axis] += (0..TERMS).map(|i| correction[axis][i] * t[i]).sum::<f64>();
            }
        }
        Some(pixel)
    }

    /// The homography alone.
    pub fn homography(&self) -> &Homography {
        &self.homography
    }

    /// Root mean square distance between the mapped and the given image points, px.
    pub fn rms_px(&self) -> f64 {
        self.rms_px
    }
}
