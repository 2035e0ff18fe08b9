//! Quantiles, tails, root mean squares, and errors with intervals by resampling frames.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Number of resamples of an interval.
const RESAMPLES: usize = 2000;
/// Fewest frames of an interval.
const FEWEST_FRAMES: usize = 3;
/// Fixed, so that the same input gives the same report.
const SEED: u64 = 0x6465_7074_6863_616c;

/// Sum and count of one frame's contributions to a mean.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Total {
    /// Sum of the values, or of their squares.
    pub sum: f64,
    /// Number of values.
    pub count: usize,
}

impl Total {
    /// Sum and count of the finite values.
    pub(super) fn of(values: impl Iterator<Item = f64>) -> Self {
        values.filter(|v| v.is_finite()).fold(Self::default(), |t, v| Self { sum: t.sum + v, count: t.count + 1 })
    }
}

/// How totals are combined to an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// The mean.
    Mean,
    /// The root of the mean; the totals are of squares.
    Rms,
}

/// An error and its 95 % interval; ends are NaN where there is no interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Estimate {
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

impl Estimate {
    pub(super) fn has_interval(&self) -> bool {
        self.low.is_finite() && self.high.is_finite()
    }
}

/// An error before and after, and the difference after − before. Its interval comes from the same resamples of frames, so
/// that it is narrower than those of the two errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Change {
    pub before: Estimate,
    pub after: Estimate,
    pub difference: Estimate,
    /// Frames with such an error.
    pub frames: usize,
}

fn pooled(totals: &[Total], kind: Kind, weight: impl Fn(usize) -> f64) -> f64 {
    let (sum, count) = totals.iter().enumerate().fold((0.0, 0.0), |(s, n), (i, t)| {
        let w = weight(i);
        (s + w * t.sum, n + w * t.count as f64)
    });
    match kind {
        Kind::Mean => sum / count,
        Kind::Rms => (sum / count).sqrt(),
    }
}

/// An error before and after correction with intervals, from the totals of each frame (bootstrap over frames, percentile
/// intervals). `None` where no frame has a value.
pub(super) fn change(before: &[Total], after: &[Total], kind: Kind) -> Option<Change> {
    let used: Vec<usize> = (0..before.len()).filter(|i| before[*i].count > 0 && after[*i].count > 0).collect();
    let before: Vec<Total> = used.iter().map(|i| before[*i]).collect();
    let after: Vec<Total> = used.iter().map(|i| after[*i]).collect();
    let frames = before.len();
    if frames == 0 {
        return None;
    }
    let (b, a) = (pooled(&before, kind, |_| 1.0), pooled(&after, kind, |_| 1.0));
    let none = |value: f64| Estimate { value, low: f64::NAN, high: f64::NAN };
    if frames < FEWEST_FRAMES {
        return Some(Change { before: none(b), after: none(a), difference: none(a - b), frames });
    }
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut drawn: [Vec<f64>; 3] = Default::default();
    let mut weights = vec![0.0; frames];
    for _ in 0..RESAMPLES {
        weights.fill(0.0);
        (0..frames).for_each(|_| weights[rng.random_range(0..frames)] += 1.0);
        let (b, a) = (pooled(&before, kind, |i| weights[i]), pooled(&after, kind, |i| weights[i]));
        for (list, value) in drawn.iter_mut().zip([b, a, a - b]) {
            list.push(value);
        }
    }
    let interval = |value: f64, list: &mut Vec<f64>| {
        list.sort_by(f64::total_cmp);
        Estimate { value, low: quantile_of_sorted(list, 0.025), high: quantile_of_sorted(list, 0.975) }
    };
    let [db, da, dd] = &mut drawn;
    Some(Change { before: interval(b, db), after: interval(a, da), difference: interval(a - b, dd), frames })
}

/// One error with its interval, and the number of frames.
pub(super) fn estimate(totals: &[Total], kind: Kind) -> Option<(Estimate, usize)> {
    change(totals, totals, kind).map(|c| (c.after, c.frames))
}

/// Quantile of sorted values, linearly interpolated; NaN of none.
pub(super) fn quantile_of_sorted(sorted: &[f64], q: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let position = q * last as f64;
    let (i, t) = (position.floor() as usize, position.fract());
    let next = sorted[(i + 1).min(last)];
    sorted[i] + t * (next - sorted[i])
}

/// Quantile of finite values; NaN of none.
pub(super) fn quantile(values: impl Iterator<Item = f64>, q: f64) -> f64 {
    let mut sorted: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    quantile_of_sorted(&sorted, q)
}

/// Root mean square of finite values; NaN of none.
pub(super) fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let total = Total::of(values.map(|v| v * v));
    (total.sum / total.count as f64).sqrt()
}

/// Median of values, which are reordered; NaN of none.
pub(super) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    let upper = *values.select_nth_unstable_by(middle, f64::total_cmp).1;
    // Of an even number the mean of the two in the middle: the upper one alone would be biased.
    if values.len() % 2 == 1 { upper } else { (upper + greatest(&values[..middle])) / 2.0 }
}

fn greatest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// The generator of tests that flip signs; its seed differs from that of the intervals.
pub(super) fn sign_generator() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(SEED ^ 1)
}

/// Quantile 0.975 of Student's t, by Cornish–Fisher expansion about the normal quantile; exact to 1 % from three
/// degrees of freedom on.
pub(super) fn student(degrees: usize) -> f64 {
    match degrees {
        0 => f64::NAN,
        1 => 12.706,
        2 => 4.303,
        n => {
            let (z, n) = (1.959_964_f64, n as f64);
            let (z3, z5, z7) = (z.powi(3), z.powi(5), z.powi(7));
            z + (z3 + z) / (4.0 * n)
                + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * n * n)
                + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * n * n * n)
        }
    }
}

/// Probability that a mean of `n` squared standard normal numbers exceeds `ratio` (Wilson and Hilferty 1931).
pub(super) fn chi_square_tail(ratio: f64, n: f64) -> f64 {
    let v = 2.0 / (9.0 * n);
    normal_tail((ratio.cbrt() - (1.0 - v)) / v.sqrt())
}

/// Probability that a standard normal number exceeds `z`, to 10⁻⁷ (Abramowitz and Stegun 1964, 26.2.17).
fn normal_tail(z: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * z.abs());
    let series = [0.319_381_530, -0.356_563_782, 1.781_477_937, -1.821_255_978, 1.330_274_429];
    let sum = series.iter().rev().fold(0.0, |s, b| (s + b) * t);
    let tail = (-z * z / 2.0).exp() / std::f64::consts::TAU.sqrt() * sum;
    if z < 0.0 { 1.0 - tail } else { tail }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_distr::{Distribution, Normal};

    #[test]
    fn intervals_hold_what_the_frames_say() {
        // 40 frames of one value each, standard normal about 10: the standard error is 1/√40 = 0.158.
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let normal = Normal::new(10.0, 1.0).unwrap();
        let totals: Vec<Total> = (0..40).map(|_| Total { sum: normal.sample(&mut rng), count: 1 }).collect();
        let (e, frames) = estimate(&totals, Kind::Mean).unwrap();
        assert_eq!(frames, 40);
        let half = (e.high - e.low) / 2.0;
        assert!((half / (1.96 * 0.158) - 1.0).abs() < 0.3, "half width {half}");
        assert!(e.low < e.value && e.value < e.high);
    }

    #[test]
    fn a_paired_difference_is_known_better_than_its_parts() {
        let before: Vec<Total> = (0..20).map(|i| Total { sum: 10.0 + f64::from(i), count: 1 }).collect();
        let after: Vec<Total> = before.iter().map(|t| Total { sum: t.sum - 1.0, count: 1 }).collect();
        let c = change(&before, &after, Kind::Mean).unwrap();
        assert!((c.difference.low + 1.0).abs() < 1e-9 && (c.difference.high + 1.0).abs() < 1e-9);
        assert!(c.before.high - c.before.low > 1.0);
    }

    #[test]
    fn medians_are_not_biased() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), 2.5);
        assert!(median(&mut []).is_nan());
    }

    #[test]
    fn too_few_frames_have_no_interval_and_no_frames_no_value() {
        let two = [Total { sum: 1.0, count: 1 }, Total { sum: 3.0, count: 1 }];
        let (e, _) = estimate(&two, Kind::Mean).unwrap();
        assert!(e.value == 2.0 && !e.has_interval());
        assert!(estimate(&[Total::default()], Kind::Rms).is_none());
        assert_eq!(Total::of([f64::NAN, 2.0].into_iter()).count, 1);
    }

    #[test]
    fn student_quantiles() {
        for (n, t) in [(3, 3.182), (5, 2.571), (10, 2.228), (30, 2.042)] {
            assert!((student(n) / t - 1.0).abs() < 0.011, "{n}: {}", student(n));
        }
    }

    #[test]
    fn tails_agree_with_tables() {
        assert!((normal_tail(1.96) - 0.025).abs() < 1e-4 && (normal_tail(-1.96) - 0.975).abs() < 1e-4);
        // The 95 % point of chi-square with 20 degrees of freedom is 31.41.
        assert!((chi_square_tail(31.41 / 20.0, 20.0) - 0.05).abs() < 1e-3);
    }

    #[test]
    fn root_mean_squares_leave_out_what_is_no_number() {
        assert_eq!(rms([3.0, f64::NAN, -4.0].into_iter()), 12.5_f64.sqrt());
        assert!(rms(std::iter::empty()).is_nan());
    }
}
