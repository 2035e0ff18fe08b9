//! Errors frame by frame, their means over datasets, and bootstrap intervals over frames.
//!
//! Pixels of a frame share the error of its pose and are correlated with their neighbours, so whole frames rather than pixels
//! are resampled (cluster bootstrap; Davison, Hinkley 1997, section 3.8). All models are evaluated on the same resamples
//! (paired), so that their differences are more certain than the errors themselves.

use depthcal_io::{Errors, Interval};
use depthcal_statistics::{Bootstrap, Estimate};

use crate::judge::camera::EvaluatedCamera;

/// Bootstrap over frames, with equal draws for all models.
const BOOTSTRAP: Bootstrap = Bootstrap { resamples: 2000, seed: 0x636f_6d70_6172_6500 };

/// Sum and number of values.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Total {
    sum: f64,
    count: usize,
}

impl Total {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        values.fold(Self::default(), |t, v| Self { sum: t.sum + v, count: t.count + 1 })
    }

    fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.count += other.count;
    }

    fn mean(self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }
}

/// Sums of one frame: dot errors, absolute heights over the board, squared depth errors.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameErrors {
    /// Its name.
    pub name: String,
    totals: [Total; 3],
    /// Depth pixels that could not be corrected, and all.
    pub uncorrectable: [usize; 2],
}

/// The frames of one dataset after correction.
pub fn frame_errors(evaluated: &EvaluatedCamera) -> Vec<FrameErrors> {
    let frame = |f: &crate::judge::camera::EvaluatedFrame| FrameErrors {
        name: f.name.clone(),
        totals: [
            Total::of(f.dots.iter().map(|d| d[1])),
            Total { sum: f.depth.height.after.sizes_mm, count: f.depth.pixels },
            Total { sum: f.depth.depth.after.squares_mm2, count: f.depth.pixels },
        ],
        uncorrectable: [f.uncorrectable, f.uncorrectable + f.depth.pixels],
    };
    evaluated.frames.iter().map(frame).collect()
}

/// Dot error, plane error and depth rms: mean over datasets of each dataset's own, as in the thesis' tables 6.6 to 6.9 (of the
/// mean square for the rms). `pick` selects the frames of each dataset, repeatedly where it lists them repeatedly.
fn errors_of<'a>(
    datasets: &'a [Vec<FrameErrors>],
    mut pick: impl FnMut(usize, &'a [FrameErrors]) -> Vec<&'a FrameErrors>,
) -> [Option<f64>; 3] {
    let mut means = [Total::default(); 3];
    for (i, frames) in datasets.iter().enumerate() {
        let mut totals = [Total::default(); 3];
        for frame in pick(i, frames) {
            totals.iter_mut().zip(frame.totals).for_each(|(t, f)| t.add(f));
        }
        for (mean, total) in means.iter_mut().zip(totals) {
            if let Some(value) = total.mean() {
                mean.add(Total { sum: value, count: 1 });
            }
        }
    }
    let [dot, plane, square] = means.map(Total::mean);
    [dot, plane, square.map(f64::sqrt)]
}

/// Errors without intervals.
pub fn errors(datasets: &[Vec<FrameErrors>]) -> Errors<Option<f64>> {
    let [dot_error_mm, plane_error_mm, depth_rms_mm] = errors_of(datasets, |_, f| f.iter().collect());
    Errors { dot_error_mm, plane_error_mm, depth_rms_mm }
}

/// The errors of every model with 95 % intervals, and its resampled dot errors (depth rms where there are no dots), from
/// which intervals of differences are made. All models must have the same frames in the same order.
pub fn resampled(models: &[&[Vec<FrameErrors>]]) -> Vec<(Errors<Option<Interval>>, Vec<f64>)> {
    let Some(first) = models.first() else { return Vec::new() };
    let sizes: Vec<usize> = first.iter().map(Vec::len).collect();
    let draws = BOOTSTRAP.draws(&sizes);
    models
        .iter()
        .map(|datasets| {
            let mut samples: [Vec<f64>; 3] = Default::default();
            for draw in &draws {
                let drawn = errors_of(datasets, |i, frames| draw[i].iter().filter_map(|k| frames.get(*k)).collect());
                for (sample, value) in samples.iter_mut().zip(drawn) {
                    sample.push(value.unwrap_or(f64::NAN));
                }
            }
            let plain = errors(datasets);
            let interval = |mean: Option<f64>, i: usize| mean.map(|mean| interval(mean, samples[i].clone(), 0.05));
            let errors = Errors {
                dot_error_mm: interval(plain.dot_error_mm, 0),
                plane_error_mm: interval(plain.plane_error_mm, 1),
                depth_rms_mm: interval(plain.depth_rms_mm, 2),
            };
            let ranked_by = if plain.dot_error_mm.is_some() { 0 } else { 2 };
            (errors, std::mem::take(&mut samples[ranked_by]))
        })
        .collect()
}

/// The percentile interval that excludes the share `outside` of the resampled values, half at each end.
pub fn interval(mean: f64, samples: Vec<f64>, outside: f64) -> Interval {
    let Estimate { value, low, high } = Estimate::from_resamples(mean, samples, 1.0 - outside);
    Interval { mean: value, low, high }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(i: usize, error: f64) -> FrameErrors {
        let total = Total { sum: 10.0 * error, count: 10 };
        FrameErrors { name: i.to_string(), totals: [total; 3], uncorrectable: [0, 10] }
    }

    /// Two models whose errors vary from frame to frame by far more than they differ: paired, the difference is exact.
    #[test]
    fn differences_are_paired() {
        let a: Vec<FrameErrors> = (0..20).map(|i| frame(i, 5.0 + (i % 5) as f64)).collect();
        let b: Vec<FrameErrors> = (0..20).map(|i| frame(i, 5.1 + (i % 5) as f64)).collect();
        let (a, b) = (vec![a], vec![b]);
        let both = resampled(&[&a, &b]);
        let (error, _) = &both[0];
        let dot = error.dot_error_mm.unwrap();
        assert!((dot.mean - 7.0).abs() < 1e-12 && dot.low < 6.7 && dot.high > 7.3, "{dot:?}");
        let difference: Vec<f64> = both[1].1.iter().zip(&both[0].1).map(|(b, a)| b - a).collect();
        let difference = interval(0.1, difference, 0.05);
        assert!((difference.low - 0.1).abs() < 1e-9 && (difference.high - 0.1).abs() < 1e-9);
    }

    #[test]
    fn datasets_count_alike_however_many_frames_they_have() {
        let small: Vec<FrameErrors> = (0..2).map(|i| frame(i, 1.0)).collect();
        let large: Vec<FrameErrors> = (0..30).map(|i| frame(i, 3.0)).collect();
        let all = errors(&[small, large]);
        assert_eq!(all.dot_error_mm, Some(2.0));
        // The root of the mean of the datasets' mean squares.
        assert_eq!(all.depth_rms_mm, Some(2.0_f64.sqrt()));
    }
}
