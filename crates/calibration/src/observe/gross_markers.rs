//! Markers that are grossly wrong, found in one frame alone: whatever the lens, the map from board to image is smooth, and they
//! are far from it.
//!
//! The map is a homography times a smooth remainder; both together are a polynomial of the board's coordinates to within a pixel
//! or so. It is fitted by iteratively reweighted least squares, first with the weights of least absolute deviations, then without
//! the markers that are far off. A camera is not needed, so that the start values of one are not spoiled.

use depthcal_model::Target;
use depthcal_statistics::upper_median;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, OMatrix, U2};

use depthcal_io::MarkerObservation;

/// A marker nearer to the polynomial is not wrong for certain, px …
const LEAST_PX: f64 = 2.0;
/// … nor is one within so many standard deviations of the others, the remainder of the lens included.
const SIGMAS: f64 = 8.0;
/// Of boards of which more is wrong nothing is known.
const LARGEST_SHARE: f64 = 0.4;
/// Markers per coefficient of the polynomial.
const PER_TERM: usize = 3;
/// Total degrees that are tried, with their numbers of coefficients.
const DEGREES: [(i32, usize); 4] = [(5, 21), (4, 15), (3, 10), (2, 6)];
/// Iterations with the weights of absolute deviations, and without wrong markers.
const ITERATIONS: [usize; 2] = [10, 4];
/// Deviation below which weights no longer grow, px.
const FLOOR_PX: f64 = 0.1;

/// Which markers of a frame are grossly wrong; none where there are too few markers to tell, or where too many are far off.
///
/// Of the degrees that the number of markers allows, the one counts from which half of the markers are least far.
pub(crate) fn gross_markers(target: &Target, markers: &[MarkerObservation]) -> Vec<bool> {
    let points: Vec<[f64; 2]> = markers.iter().map(|m| target.point(m.index)).collect();
    let pixels = OMatrix::<f64, Dyn, U2>::from_fn(markers.len(), |i, j| markers[i].pixel[j]);
    let allowed = DEGREES.into_iter().filter(|(_, terms)| markers.len() >= PER_TERM * terms);
    let fits = allowed.filter_map(|(degree, terms)| far_off(&design(&points, degree, terms), &pixels));
    let best = fits.min_by(|a, b| a.std_px.total_cmp(&b.std_px));
    match best {
        Some(fit) if fit.count() as f64 <= LARGEST_SHARE * markers.len() as f64 => fit.wrong,
        _ => vec![false; markers.len()],
    }
}

/// Markers that are far from a polynomial, and the standard deviation of a coordinate of the others, px.
struct FarOff {
    wrong: Vec<bool>,
    std_px: f64,
}

impl FarOff {
    fn count(&self) -> usize {
        self.wrong.iter().filter(|wrong| **wrong).count()
    }
}

/// The robust fit of a polynomial; `None` where the markers do not determine it.
fn far_off(design: &DMatrix<f64>, pixels: &OMatrix<f64, Dyn, U2>) -> Option<FarOff> {
    let mut weights = DVector::from_element(design.nrows(), 1.0);
    for _ in 0..ITERATIONS[0] {
        let distances = Fit::new(design, pixels, &weights)?.distances;
        weights.iter_mut().zip(&distances).for_each(|(weight, d)| *weight = 1.0 / d.max(FLOOR_PX));
    }
    let mut latest = None;
    for _ in 0..ITERATIONS[1] {
        let fit = Fit::new(design, pixels, &weights)?;
        let (leverages, distances) = (fit.leverages(design), fit.distances);
        // The median of a Rayleigh distribution is 1.18 standard deviations of a coordinate; the fit takes its share of the
        // freedoms.
        let freedoms = 1.0 - design.ncols() as f64 / design.nrows() as f64;
        let std_px = upper_median(&mut distances.clone())? / (2.0 * std::f64::consts::LN_2 * freedoms).sqrt();
        let limit = LEAST_PX.max(SIGMAS * std_px);
        // A marker that did not take part is extrapolated to: the deviation of its prediction grows with its leverage.
        let beyond = |(d, leverage): (&f64, &f64)| *d > limit * (1.0 + leverage).sqrt();
        let wrong: Vec<bool> = distances.iter().zip(&leverages).map(beyond).collect();
        weights.iter_mut().zip(&wrong).for_each(|(weight, wrong)| *weight = if *wrong { 0.0 } else { 1.0 });
        latest = Some(FarOff { wrong, std_px });
    }
    latest
}

/// Monomials of the board's coordinates, scaled to −1 … 1, up to a total degree.
fn design(points: &[[f64; 2]], degree: i32, terms: usize) -> DMatrix<f64> {
    let scaled = |axis: usize| -> Vec<f64> {
        let values = || points.iter().map(|p| p[axis]);
        let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        values().map(|v| (2.0 * v - low - high) / (high - low).max(f64::MIN_POSITIVE)).collect()
    };
    let [x, y] = [0, 1].map(scaled);
    let mut design = DMatrix::zeros(points.len(), terms);
    let powers = (0..=degree).flat_map(|i| (0..=degree - i).map(move |j| (i, j)));
    for (column, (i, j)) in powers.enumerate() {
        for row in 0..points.len() {
            design[(row, column)] = x[row].powi(i) * y[row].powi(j);
        }
    }
    design
}

/// A weighted fit of the polynomial.
struct Fit {
    normal: Cholesky<f64, Dyn>,
    /// Distances of the pixels from it, px.
    distances: Vec<f64>,
}

impl Fit {
    fn new(design: &DMatrix<f64>, pixels: &OMatrix<f64, Dyn, U2>, weights: &DVector<f64>) -> Option<Self> {
        let mut weighted = design.clone();
        for (mut row, weight) in weighted.row_iter_mut().zip(weights) {
            row *= *weight;
        }
        let normal = (weighted.transpose() * design).cholesky()?;
        let residuals = pixels - design * normal.solve(&(weighted.transpose() * pixels));
        Some(Self { normal, distances: residuals.row_iter().map(|r| r.norm()).collect() })
    }

    /// Variances of the polynomial at the markers per variance of a marker of weight one.
    fn leverages(&self, design: &DMatrix<f64>) -> Vec<f64> {
        let spread = self.normal.solve(&design.transpose());
        design.row_iter().zip(spread.column_iter()).map(|(row, column)| row.transpose().dot(&column)).collect()
    }
}

#[cfg(test)]
mod tests {
    use depthcal_model::Pattern;
    use rand::{RngExt, SeedableRng, rngs::StdRng};

    use super::*;

    /// A board seen by a wide camera: an equidistant projection of a plane that reaches 60° off the axis.
    fn markers(count: [usize; 2], random: &mut StdRng) -> (Target, Vec<MarkerObservation>) {
        let target = Target { pattern: Pattern::Chessboard, columns: count[0], rows: count[1], spacing_mm: 30.0 };
        let observe = |index: usize| {
            let [x, y] = target.point(index);
            let (x, y, z) = (x - 20.0, y - 30.0, 150.0 + 0.3 * x);
            let angle = x.hypot(y).atan2(z);
            let scale = 300.0 * angle / x.hypot(y).max(1e-9);
            let mut noise = || 0.1 * (random.random::<f64>() - 0.5);
            MarkerObservation { index, pixel: [320.0 + scale * x + noise(), 240.0 + scale * y + noise()], std_px: 1.0 }
        };
        (target.clone(), (0..target.len()).map(observe).collect())
    }

    /// None on boards without wrong markers. Where a third is wrong, some are left for the checks after the fit: this one only
    /// has to spare the start values.
    #[test]
    fn wrong_markers_are_found_and_others_hardly_ever() {
        let mut random = StdRng::seed_from_u64(3);
        let (mut right, mut spared, mut wrong, mut missed) = (0, 0, 0, 0);
        let cases = [([9, 6], 0.0), ([12, 9], 0.0), ([9, 6], 0.1), ([9, 6], 0.3), ([5, 4], 0.1), ([12, 9], 0.3)];
        for (count, share) in cases.into_iter().cycle().take(600) {
            let (target, mut markers) = markers(count, &mut random);
            let mut moved = vec![false; markers.len()];
            for (marker, moved) in markers.iter_mut().zip(&mut moved) {
                if random.random_bool(share) {
                    let (sine, cosine) = random.random_range(0.0..std::f64::consts::TAU).sin_cos();
                    let distance = random.random_range(6.0..20.0);
                    marker.pixel = [marker.pixel[0] + distance * cosine, marker.pixel[1] + distance * sine];
                    *moved = true;
                }
            }
            for (i, (found, moved)) in gross_markers(&target, &markers).into_iter().zip(moved).enumerate() {
                assert!(!found || share > 0.0, "marker {i} of {count:?}");
                right += usize::from(!moved);
                spared += usize::from(!moved && !found);
                wrong += usize::from(moved);
                missed += usize::from(moved && !found);
            }
        }
        assert!(missed * 5 < wrong, "{missed} of {wrong} missed");
        assert!((right - spared) * 500 < right, "{} of {right} wrongly left out", right - spared);
    }

    #[test]
    fn few_markers_and_boards_that_are_wrong_as_a_whole_are_left_alone() {
        let mut random = StdRng::seed_from_u64(4);
        let (target, mut markers) = markers([9, 6], &mut random);
        assert_eq!(gross_markers(&target, &markers[..17]), [false; 17]);
        markers.iter_mut().for_each(|m| m.pixel = [0, 1].map(|_| random.random_range(0.0..480.0)));
        assert_eq!(gross_markers(&target, &markers), [false; 54]);
    }
}
