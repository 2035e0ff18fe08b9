//! Errors of depth and dots with intervals, by resampling frames.

use depthcal_statistics::{Bootstrap, Estimate};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Fewest frames of an interval.
const FEWEST_FRAMES: usize = 3;
/// Seed of tests that flip signs: the same input gives the same report.
const SIGN_SEED: u64 = 0x6465_7074_6863_616d;
/// The resamples of all intervals.
const BOOTSTRAP: Bootstrap = Bootstrap::OVER_FRAMES;

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

/// An error before and after correction with 95 % intervals, from the totals of each frame ([`Bootstrap::ratio`]; that of the
/// difference by percentiles). `None` where no frame has a value.
pub(super) fn change(before: &[Total], after: &[Total], kind: Kind) -> Option<Change> {
    let used: Vec<usize> = (0..before.len()).filter(|i| before[*i].count > 0 && after[*i].count > 0).collect();
    let before: Vec<Total> = used.iter().map(|i| before[*i]).collect();
    let after: Vec<Total> = used.iter().map(|i| after[*i]).collect();
    let frames = before.len();
    if frames == 0 {
        return None;
    }
    let (b, a) = (pooled(&before, kind, |_| 1.0), pooled(&after, kind, |_| 1.0));
    let none = Estimate::without_interval;
    if frames < FEWEST_FRAMES {
        return Some(Change { before: none(b), after: none(a), difference: none(a - b), frames });
    }
    let mut differences: Vec<f64> = Vec::new();
    let mut weights = vec![0.0; frames];
    for drawn in BOOTSTRAP.draws(&[frames]) {
        weights.fill(0.0);
        drawn[0].iter().for_each(|i| weights[*i] += 1.0);
        let (b, a) = (pooled(&before, kind, |i| weights[i]), pooled(&after, kind, |i| weights[i]));
        differences.push(a - b);
    }
    let difference = Estimate::from_resamples(a - b, differences, 0.95);
    Some(Change { before: interval(&before, kind), after: interval(&after, kind), difference, frames })
}

/// One error with its interval over the frames that the totals are of.
fn interval(totals: &[Total], kind: Kind) -> Estimate {
    let of_frames: Vec<(f64, f64)> = totals.iter().map(|t| (t.sum, t.count as f64)).collect();
    let mean = BOOTSTRAP.ratio(&of_frames);
    match kind {
        Kind::Mean => mean,
        Kind::Rms => Estimate { value: mean.value.sqrt(), low: mean.low.sqrt(), high: mean.high.sqrt() },
    }
}

/// One error with its interval, and the number of frames.
pub(super) fn estimate(totals: &[Total], kind: Kind) -> Option<(Estimate, usize)> {
    change(totals, totals, kind).map(|c| (c.after, c.frames))
}

/// Root mean square of finite values; NaN of none.
pub(super) fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let total = Total::of(values.map(|v| v * v));
    (total.sum / total.count as f64).sqrt()
}

/// The generator of tests that flip signs.
pub(super) fn sign_generator() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(SIGN_SEED)
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
    fn too_few_frames_have_no_interval_and_no_frames_no_value() {
        let two = [Total { sum: 1.0, count: 1 }, Total { sum: 3.0, count: 1 }];
        let (e, _) = estimate(&two, Kind::Mean).unwrap();
        assert!(e.value == 2.0 && !e.has_interval());
        assert!(estimate(&[Total::default()], Kind::Rms).is_none());
        assert_eq!(Total::of([f64::NAN, 2.0].into_iter()).count, 1);
    }

    #[test]
    fn root_mean_squares_leave_out_what_is_no_number() {
        assert_eq!(rms([3.0, f64::NAN, -4.0].into_iter()), 12.5_f64.sqrt());
        assert!(rms(std::iter::empty()).is_nan());
    }
}
