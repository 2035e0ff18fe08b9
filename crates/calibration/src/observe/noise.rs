//! Noise of the measurements, estimated from residuals.

pub use depthcal_model::uncertainty::DepthNoise;

/// Standard deviations at which residuals are clipped when a variance is estimated.
const CLIP: f64 = 3.0;
/// E[min(r², 9)] of a standard normal r, which makes the clipped variance consistent.
const CLIPPED_UNIT_VARIANCE: f64 = 0.995_012;

/// Standard deviations of markers and depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseModel {
    /// Of a marker's coordinate with `std_px` = 1, px.
    pub pixel_sigma: f64,
    /// Of depth.
    pub depth: DepthNoise,
    /// Of the depth of whole frames.
    pub planes: PlaneScatter,
}

/// Scatter of the frames' own planes in inverse depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneScatter {
    /// Standard deviation of each of their coefficients of (1, u, v), u and v the undistorted coordinates, from −1 to 1 over the
    /// image, in standard deviations of the noise of a pixel; 0 where frames have no planes of their own. One for all three: with
    /// one each, the scale of depth and the scatter of the constants could grow together.
    pub of_noise: f64,
    /// Standard deviation of each coefficient by itself, in the unit of [`of_noise`](Self::of_noise). The fourth is the
    /// coefficient of 1/amplitude, in units of its mean over all frames; 0 where amplitudes are unknown. The covariance of the
    /// parameters takes all four into account.
    pub deviations: [f64; 4],
    /// Design effect (Kish 1965): how many times the variance of what the samples of a frame say together is larger than it would
    /// be without these planes; 1 where frames have none.
    pub design_effect: f64,
}

impl PlaneScatter {
    /// No planes but those of the poses.
    pub const NONE: Self = Self { of_noise: 0.0, deviations: [0.0; 4], design_effect: 1.0 };
}

/// Maximum-likelihood estimate of a² and b² from pairs of inverse depth and residual (both 1/mm), from clipped variances in
/// bins of equal counts. `inflation` is the number of residuals over their redundancy. `None` with fewer than 20
/// residuals, or where all are zero.
pub fn fit_depth_noise(samples: &[(f64, f64)], inflation: f64) -> Option<DepthNoise> {
    const BINS: usize = 12;
    let mut sorted: Vec<(f64, f64)> =
        samples.iter().copied().filter(|(rho, r)| rho.is_finite() && r.is_finite()).collect();
    if sorted.len() < 20 {
        return None;
    }
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = sorted.len().div_ceil(BINS);
    let bins: Vec<(f64, f64, f64)> = sorted
        .chunks(size)
        .map(|bin| {
            let residuals: Vec<f64> = bin.iter().map(|s| s.1).collect();
            let quartic = bin.iter().map(|s| s.0.powi(4)).sum::<f64>() / bin.len() as f64;
            (quartic, clipped_sigma(&residuals).powi(2) * inflation, bin.len() as f64)
        })
        .collect();
    let scale = bins.iter().map(|b| b.0).fold(0.0, f64::max);
    let total = bins.iter().map(|b| b.1 * b.2).sum::<f64>() / bins.iter().map(|b| b.2).sum::<f64>();
    // Scoring on (a², b² scale), held non-negative: reweighted least squares of variances, whose own variance is
    // proportional to their square.
    let law = |weights: &dyn Fn(f64) -> f64| -> (f64, f64) {
        let (mut s1, mut sx, mut sxx, mut sy, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (quartic, variance, n) in &bins {
            let (x, w) = (quartic / scale, n * weights(*quartic / scale));
            s1 += w;
            sx += w * x;
            sxx += w * x * x;
            sy += w * variance;
            sxy += w * x * variance;
        }
        let det = s1 * sxx - sx * sx;
        let (a, b) = ((sxx * sy - sx * sxy) / det, (s1 * sxy - sx * sy) / det);
        match (a >= 0.0 && det > 0.0, b >= 0.0 && det > 0.0) {
            (true, true) => (a, b),
            (false, _) => (0.0, sxy / sxx),
            (true, false) => (sy / s1, 0.0),
        }
    };
    let (mut a, mut b) = (total, 0.0);
    for _ in 0..20 {
        let floor = 1e-6 * total;
        (a, b) = law(&|x| 1.0 / (a + b * x).max(floor).powi(2));
    }
    let fitted = DepthNoise { a_per_mm: a.sqrt(), b_mm: (b / scale).sqrt() };
    (fitted.a_per_mm + fitted.b_mm > 0.0).then_some(fitted)
}

/// Standard deviation about zero with residuals clipped at three standard deviations (Huber 1981, proposal 2): consistent for
/// normal noise, and outliers have bounded influence. NaN without residuals.
pub fn clipped_sigma(residuals: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).filter(|r| r.is_finite()).collect();
    if sizes.is_empty() {
        return f64::NAN;
    }
    sizes.sort_by(f64::total_cmp);
    let mut sigma = 1.4826 * sizes[sizes.len() / 2];
    if sigma == 0.0 {
        sigma = (sizes.iter().map(|r| r * r).sum::<f64>() / sizes.len() as f64).sqrt();
    }
    for _ in 0..50 {
        let limit = CLIP * sigma;
        let clipped = sizes.iter().map(|r| r.min(limit).powi(2)).sum::<f64>() / sizes.len() as f64;
        let next = (clipped / CLIPPED_UNIT_VARIANCE).sqrt();
        let settled = (next - sigma).abs() <= 1e-9 * sigma;
        sigma = next;
        if settled {
            break;
        }
    }
    sigma
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    fn normal(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let unit = Normal::new(0.0, 1.0).unwrap();
        (0..n).map(|_| unit.sample(&mut rng)).collect()
    }

    /// Sampling error of a standard deviation from 20 000 values: 0.5 %; three of those.
    #[test]
    fn clipped_sigma_is_consistent_and_robust() {
        let mut values = normal(20_000, 1);
        assert!((clipped_sigma(&values) - 1.0).abs() < 0.015);
        values.extend(std::iter::repeat_n(1e6, 400));
        assert!((clipped_sigma(&values) - 1.0).abs() < 0.12, "2 % of gross outliers may raise it by some 10 %");
    }

    #[test]
    fn the_law_over_depth_is_recovered() {
        for (a, b) in [(2e-6, 0.0), (0.0, 3.0), (2e-6, 3.0)] {
            let truth = DepthNoise { a_per_mm: a, b_mm: b };
            let unit = normal(40_000, 2);
            let samples: Vec<(f64, f64)> = unit
                .iter()
                .enumerate()
                .map(|(i, n)| {
                    let rho = 1.0 / (300.0 + 1200.0 * (i as f64 / 40_000.0));
                    (rho, n * truth.sigma(rho))
                })
                .collect();
            let fitted = fit_depth_noise(&samples, 1.0).unwrap();
            for z in [400.0, 800.0, 1400.0] {
                let ratio = fitted.sigma(1.0 / z) / truth.sigma(1.0 / z);
                assert!((ratio - 1.0).abs() < 0.04, "at {z} mm the law is {ratio} of the truth for a = {a}, b = {b}");
            }
        }
    }
}
