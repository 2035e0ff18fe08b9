//! Errors of evaluated frames with 95 % intervals, by resampling frames: their pixels share errors.

use depthcal_io::{BeforeAfter, Interval, Spread};
use depthcal_statistics::{Bootstrap, Estimate, quantile};

use super::camera::EvaluatedFrame;
use super::depth_errors::{DepthErrors, Sums};

/// Fewest frames of an interval.
const FEWEST_FRAMES: usize = 3;
/// The resamples of all intervals.
const BOOTSTRAP: Bootstrap = Bootstrap::OVER_FRAMES;
/// Ends of the range of most pixels.
const MOST: [f64; 2] = [0.05, 0.95];

/// Sum and count of one frame's contributions to a mean.
#[derive(Debug, Clone, Copy, Default)]
struct Total {
    /// Sum of the values, or of their squares.
    sum: f64,
    /// Number of values.
    count: usize,
}

impl Total {
    /// Sum and count of the finite values.
    fn of(values: impl Iterator<Item = f64>) -> Self {
        values.filter(|v| v.is_finite()).fold(Self::default(), |t, v| Self { sum: t.sum + v, count: t.count + 1 })
    }
}

/// How totals are combined to an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// The mean.
    Mean,
    /// The root of the mean; the totals are of squares.
    Rms,
}

/// An error before and after, and the difference after − before. Its interval comes from the same resamples of frames, so
/// that it is narrower than those of the two errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// The error of depth as measured.
    pub before: Estimate,
    /// The error of corrected depth.
    pub after: Estimate,
    /// Their difference.
    pub difference: Estimate,
    /// Frames with such an error.
    pub frames: usize,
}

impl Change {
    /// Both errors with their intervals; `None` where there are none.
    pub fn intervals(&self) -> Option<BeforeAfter<Interval>> {
        Some(BeforeAfter { before: interval_of(&self.before)?, after: self.after_interval()? })
    }

    /// The error of corrected depth with its interval; `None` where there is none.
    pub fn after_interval(&self) -> Option<Interval> {
        interval_of(&self.after)
    }
}

/// An error with its interval; `None` where there is none.
pub(super) fn interval_of(e: &Estimate) -> Option<Interval> {
    e.has_interval().then_some(Interval { mean: e.value, low: e.low, high: e.high })
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
fn change(before: &[Total], after: &[Total], kind: Kind) -> Option<Change> {
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
fn estimate(totals: &[Total], kind: Kind) -> Option<(Estimate, usize)> {
    change(totals, totals, kind).map(|c| (c.after, c.frames))
}

/// Mean dot error, mm; `None` without depth at markers.
pub fn dot_error<'a>(frames: impl Iterator<Item = &'a EvaluatedFrame> + Clone) -> Option<Change> {
    let side = |i: usize| totals(frames.clone(), |f| Total::of(f.dots.iter().map(|d| d[i])));
    change(&side(0), &side(1), Kind::Mean)
}

/// Mean plane error, mm; `None` without depth.
pub fn plane_error<'a>(frames: impl Iterator<Item = &'a EvaluatedFrame> + Clone) -> Option<Change> {
    of_depth(frames, |depth| &depth.height, |sums| sums.sizes_mm, Kind::Mean)
}

/// Root mean square depth error, mm; `None` without depth.
pub fn depth_rms<'a>(frames: impl Iterator<Item = &'a EvaluatedFrame> + Clone) -> Option<Change> {
    of_depth(frames, |depth| &depth.depth, |sums| sums.squares_mm2, Kind::Rms)
}

/// Root mean square reprojection error, px, and the number of frames; `None` without markers.
pub fn reprojection<'a>(frames: impl Iterator<Item = &'a EvaluatedFrame>) -> Option<(Estimate, usize)> {
    let squares = |f: &EvaluatedFrame| Total::of(f.reprojection.iter().map(|e| e[2].powi(2) + e[3].powi(2)));
    estimate(&totals(frames, squares), Kind::Rms)
}

fn totals<'a>(frames: impl Iterator<Item = &'a EvaluatedFrame>, of: impl Fn(&EvaluatedFrame) -> Total) -> Vec<Total> {
    frames.map(of).collect()
}

fn of_depth<'a>(
    frames: impl Iterator<Item = &'a EvaluatedFrame> + Clone,
    sums: impl Fn(&DepthErrors) -> &BeforeAfter<Sums>,
    sum: impl Fn(&Sums) -> f64,
    kind: Kind,
) -> Option<Change> {
    let side = |side: &dyn Fn(&BeforeAfter<Sums>) -> Sums| {
        let total = |f: &EvaluatedFrame| Total { sum: sum(&side(sums(&f.depth))), count: f.depth.pixels };
        totals(frames.clone(), total)
    };
    change(&side(&|errors| errors.before), &side(&|errors| errors.after), kind)
}

/// The range of the depth errors of 90 % of some pixels, mm; `None` of none.
pub fn spread(pixels: impl Iterator<Item = f64> + Clone) -> Option<Spread> {
    let [low, high] = MOST.map(|q| quantile(pixels.clone(), q));
    (low <= high).then_some(Spread { low, high })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    use super::*;

    fn evaluated(errors_mm: &[f64]) -> Vec<EvaluatedFrame> {
        let frames = errors_mm.iter().enumerate();
        frames.map(|(i, e)| EvaluatedFrame::of_depth_errors(format!("{i:03}"), &[*e; 10])).collect()
    }

    #[test]
    fn errors_and_their_intervals() {
        let interval = |errors_mm: &[f64]| depth_rms(evaluated(errors_mm).iter())?.after_interval();
        // Of equal frames every draw is the same; of two kinds the interval lies between them and about the whole.
        let same = interval(&[2.0; 20]).unwrap();
        assert!([same.mean, same.low, same.high].iter().all(|v| (v - 2.0).abs() < 1e-12), "{same:?}");
        let mixed: Vec<f64> = (0..40).map(|i| if i % 2 == 0 { 1.0 } else { 3.0 }).collect();
        let interval_of_mixed = interval(&mixed).unwrap();
        assert!((interval_of_mixed.mean - 5.0_f64.sqrt()).abs() < 1e-12, "{interval_of_mixed:?}");
        // The mean square, 5 mm², has the standard error 4 / √40 = 0.63 mm².
        let ends = [interval_of_mixed.low, interval_of_mixed.high].map(|v| (v * v - 5.0).abs() / (1.96 * 0.632));
        assert!(ends.iter().all(|e| (e - 1.0).abs() < 0.25), "{interval_of_mixed:?}");
        assert!(interval(&[1.0; 2]).is_none());
    }

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
}
