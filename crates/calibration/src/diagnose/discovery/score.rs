//! Cost that columns explain, from the frames' normal equations: in all frames, and in frames that were left out.

use depthcal_solver::additive::Normal;
use nalgebra::{DMatrix, DVector};

/// Estimates of the columns after the first `shared`, jointly with these, from all frames.
pub(super) fn estimate(normals: &[Normal], shared: usize) -> Option<DVector<f64>> {
    let step = Normal::sum(normals)?.step();
    Some(step.rows(shared, step.len() - shared).into_owned())
}

/// Fall of the cost ½ Σ r² of every frame when the columns after the first `shared` are estimated from all other frames, over
/// that with the shared columns alone. `prior` is added to the columns' normal matrix.
pub(super) fn held_out_gains(normals: &[Normal], shared: usize, prior: Option<&DMatrix<f64>>) -> Vec<f64> {
    let Some(mut whole) = Normal::sum(normals) else { return Vec::new() };
    if let Some(prior) = prior {
        whole.add_prior(shared, prior);
    }
    let gain = |frame: &Normal| {
        let others = whole.without(frame);
        let without = frame.of_shared(shared).change(&others.of_shared(shared).step());
        without - frame.change(&others.step())
    };
    normals.iter().map(gain).collect()
}

/// Strengths of a prior, relative to the columns' own information, that are compared on left-out frames.
const STRENGTHS: [f64; 5] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// The gains on every frame left out and the prior that are best over some strengths of it.
fn best_strength(normals: &[Normal], whole: &Normal, shared: usize, prior: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    let information: f64 = (shared..whole.gradient.len()).map(|i| whole.hessian[(i, i)]).sum();
    let scale = information / prior.trace().max(f64::MIN_POSITIVE);
    let with_strength = |strength: f64| {
        let prior = prior * (strength * scale);
        (held_out_gains(normals, shared, Some(&prior)), prior)
    };
    let total = |(gains, _): &(Vec<f64>, DMatrix<f64>)| gains.iter().sum::<f64>();
    // From the middle in the direction in which the gain rises; it has one maximum.
    let middle = STRENGTHS.len() / 2;
    let (mut place, mut best) = (middle, with_strength(STRENGTHS[middle]));
    for step in [1, -1] {
        while let Some(next) = place.checked_add_signed(step).filter(|next| *next < STRENGTHS.len()) {
            let other = with_strength(STRENGTHS[next]);
            if total(&other) <= total(&best) {
                break;
            }
            (place, best) = (next, other);
        }
        if place != middle {
            break;
        }
    }
    best
}

/// Gains on every frame left out with the strength of a prior that gains most.
pub(super) fn smooth_gains(normals: &[Normal], shared: usize, prior: &DMatrix<f64>) -> Option<Vec<f64>> {
    Some(best_strength(normals, &Normal::sum(normals)?, shared, prior).0)
}

/// The largest total gain over some strengths of a prior, relative to the columns' own information, and the estimates with it, of
/// the shared columns first; `None` where nothing is gained.
pub(super) fn smooth_estimate(normals: &[Normal], shared: usize, prior: &DMatrix<f64>) -> Option<(f64, DVector<f64>)> {
    let mut whole = Normal::sum(normals)?;
    let (gains, prior) = best_strength(normals, &whole, shared, prior);
    let gain: f64 = gains.iter().sum();
    if !(gain > 0.0) {
        return None;
    }
    whole.add_prior(shared, &prior);
    Some((gain, whole.step()))
}

/// The score of columns against the shared ones: its parts by frame, and its information.
#[derive(Debug, Clone)]
pub(super) struct Score {
    /// One row per frame.
    pub parts: Vec<DVector<f64>>,
    pub information: DMatrix<f64>,
    /// Coefficients of the shared columns that take up the others: H_ss⁻¹ H_sc.
    carried: DMatrix<f64>,
}

impl Score {
    /// The score of the columns after the first `shared`.
    pub fn of(normals: &[Normal], shared: usize) -> Option<Self> {
        let whole = Normal::sum(normals)?;
        let more = whole.gradient.len() - shared;
        let of_shared = whole.hessian.view((0, 0), (shared, shared)).into_owned();
        let cross = whole.hessian.view((0, shared), (shared, more)).into_owned();
        let carried = of_shared.cholesky()?.solve(&cross);
        let information = whole.hessian.view((shared, shared), (more, more)) - cross.tr_mul(&carried);
        let part = |normal: &Normal| {
            normal.gradient.rows(shared, more) - carried.tr_mul(&normal.gradient.rows(0, shared).into_owned())
        };
        Some(Self { parts: normals.iter().map(part).collect(), information, carried })
    }

    /// The share of the information that the normal equations of a part have: H_cc − H_cs A − Aᵀ H_sc + Aᵀ H_ss A, with A =
    /// H_ss⁻¹ H_sc of all.
    pub fn information_of(&self, part: &Normal, shared: usize) -> DMatrix<f64> {
        let more = part.gradient.len() - shared;
        let of_shared = part.hessian.view((0, 0), (shared, shared));
        let cross = part.hessian.view((0, shared), (shared, more));
        let taken = cross.tr_mul(&self.carried);
        let of_columns = part.hessian.view((shared, shared), (more, more));
        of_columns - &taken - taken.transpose() + self.carried.tr_mul(&(of_shared * &self.carried))
    }

    /// The score of every part when the shared columns are estimated from the others. What they have been fitted to has smaller
    /// residuals than noise (jackknife; MacKinnon, Nielsen, Webb 2023).
    pub fn parts_left_out(&self, normals: &[Normal], shared: usize) -> Vec<DVector<f64>> {
        let Some(whole) = Normal::sum(normals) else { return Vec::new() };
        let left_out = |(normal, part): (&Normal, &DVector<f64>)| {
            let step = whole.without(normal).of_shared(shared).step();
            let more = normal.gradient.len() - shared;
            let cross = normal.hessian.view((shared, 0), (more, shared)) * &step;
            let through = normal.hessian.view((0, 0), (shared, shared)) * &step;
            part + cross - self.carried.tr_mul(&through)
        };
        normals.iter().zip(&self.parts).map(left_out).collect()
    }

    /// Uᵀ V⁻¹ U of the weighted sum of its parts.
    pub fn statistic(&self, weight: impl Fn(usize) -> f64) -> f64 {
        let n = self.information.nrows();
        let total = self.parts.iter().enumerate().fold(DVector::zeros(n), |sum, (i, part)| sum + part * weight(i));
        self.information.clone().cholesky().map_or(0.0, |factor| total.dot(&factor.solve(&total)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn normals() -> Vec<Normal> {
        // Three frames of y = 2 x₁ + 3 x₂ with one shared column x₁.
        let rows = [[1.0, 0.2], [0.5, 1.0], [0.3, -0.7], [1.2, 0.4], [-0.2, 0.9], [0.8, 0.1]];
        rows.chunks(2)
            .map(|rows| {
                let j = DMatrix::from_fn(2, 2, |i, k| rows[i][k]);
                let r = DVector::from_fn(2, |i, _| -(2.0 * rows[i][0] + 3.0 * rows[i][1]));
                Normal { hessian: j.tr_mul(&j), gradient: j.tr_mul(&r) }
            })
            .collect()
    }

    #[test]
    fn without_noise_estimates_are_exact_and_left_out_frames_are_predicted() {
        let normals = normals();
        assert!((estimate(&normals, 1).unwrap()[0] - 3.0).abs() < 1e-6);
        let gains = held_out_gains(&normals, 1, None);
        assert!(gains.iter().all(|gain| *gain > 0.0), "{gains:?}");
        let score = Score::of(&normals, 1).unwrap();
        // All of the cost that the shared column leaves: U²/V = V θ².
        let expected = score.information[(0, 0)] * 9.0;
        assert!((score.statistic(|_| 1.0) - expected).abs() < 1e-6 * expected);
    }
}
