//! How far two cameras are apart in pixels and in corrected depth, against the uncertainties of both.

use depthcal_model::uncertainty::{STEP, UncertainCamera};
use depthcal_model::{Camera, Context};
use depthcal_statistics::{quantile, weighted_chi_squared_tail};
use nalgebra::{DMatrix, Matrix3, Rotation3, Vector3};
use rayon::prelude::*;

/// Cells whose standard deviation is larger than this multiple of the median are no part of a size.
const WIDEST: f64 = 4.0;
/// Rays that differ by less at two distances are the same.
const SAME_RAY: f64 = 1e-9;

/// Values that depend on two cameras, with what one standard deviation along every direction of uncertainty changes in them. A
/// value that cannot be computed is NaN.
#[derive(Debug, Clone)]
pub struct Propagated {
    values: Vec<f64>,
    changes: Vec<Vec<f64>>,
}

/// Size of values over cells, against that of noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Root mean square over the cells.
    pub rms: f64,
    /// Root mean square that the uncertainties alone give on average; `None` of exact cameras.
    pub expected_rms: Option<f64>,
    /// p-value of the mean square under the uncertainties alone.
    pub p_value: Option<f64>,
}

impl Propagated {
    fn new(pair: [&UncertainCamera; 2], quantity: impl Fn([&Camera; 2]) -> Vec<f64> + Sync) -> Self {
        let [first, second] = pair;
        let values = quantity([&first.camera, &second.camera]);
        let of_first = first.changed().into_iter().map(|changed| (true, changed));
        let of_second = second.changed().into_iter().map(|changed| (false, changed));
        let all: Vec<_> = of_first.chain(of_second).collect();
        let changes = all.par_iter().map(|(is_first, changed)| {
            let [plus, minus] = changed
                .each_ref()
                .map(|camera| quantity(if *is_first { [camera, &second.camera] } else { [&first.camera, camera] }));
            plus.iter().zip(minus).map(|(plus, minus)| (plus - minus) / (2.0 * STEP)).collect()
        });
        Self { values, changes: changes.collect() }
    }

    /// The value of every entry; `None` where it or its uncertainty cannot be computed.
    pub fn values(&self) -> Vec<Option<f64>> {
        (0..self.values.len()).map(|i| self.variance(i).map(|_| self.values[i])).collect()
    }

    /// Variance of an entry.
    fn variance(&self, i: usize) -> Option<f64> {
        let variance: f64 = self.changes.iter().map(|change| change[i] * change[i]).sum();
        (self.values[i].is_finite() && variance.is_finite()).then_some(variance)
    }

    /// Standard deviation of every cell, whose `N` entries follow each other.
    pub fn std_devs<const N: usize>(&self) -> Vec<Option<f64>> {
        let cell = |c: usize| (N * c..N * c + N).map(|i| self.variance(i)).sum::<Option<f64>>().map(f64::sqrt);
        (0..self.values.len() / N).map(cell).collect()
    }

    /// Entries `range` alone.
    fn part(&self, range: std::ops::Range<usize>) -> Self {
        let changes = self.changes.iter().map(|change| change[range.clone()].to_vec()).collect();
        Self { values: self.values[range].to_vec(), changes }
    }

    /// Whether a cell is a part of the size: it can be computed, and is not much less certain than most others.
    pub fn is_certain<const N: usize>(&self) -> Vec<bool> {
        let std_devs = self.std_devs::<N>();
        let widest = WIDEST * quantile(std_devs.iter().flatten().copied(), 0.5);
        std_devs.iter().map(|std| std.is_some_and(|std| std <= widest)).collect()
    }

    /// Size over the cells that are certain enough, whose `N` entries follow each other.
    ///
    /// Under noise alone the mean square is Σ λ χ²₁ with the eigenvalues λ of the entries' covariance over the number of cells;
    /// its tail is that of the gamma distribution of the same first three moments, which are traces.
    pub fn size<const N: usize>(&self) -> Size {
        let certain = self.is_certain::<N>();
        let valid: Vec<usize> = (0..self.values.len()).filter(|i| certain[*i / N]).collect();
        let cells = valid.len() as f64 / N as f64;
        let product = |a: &[f64], b: &[f64]| valid.iter().map(|i| a[*i] * b[*i]).sum::<f64>() / cells;
        let mean_square = product(&self.values, &self.values);
        let n = self.changes.len();
        let mut gram = DMatrix::zeros(n, n);
        for row in 0..n {
            for column in row..n {
                gram[(row, column)] = product(&self.changes[row], &self.changes[column]);
                gram[(column, row)] = gram[(row, column)];
            }
        }
        let (square, mean) = (&gram * &gram, gram.trace());
        let uncertain = mean > 0.0 && !valid.is_empty();
        let traces = [mean, square.trace(), square.dot(&gram)];
        let p_value = uncertain.then(|| weighted_chi_squared_tail(mean_square, traces));
        Size { rms: mean_square.sqrt(), expected_rms: uncertain.then(|| mean.sqrt()), p_value }
    }
}

/// Difference of projection.
#[derive(Debug, Clone)]
pub struct OfProjection {
    /// Second minus first pixel of every cell, u and v, px.
    pub difference: Propagated,
    /// The rotation that was removed: it maps the rays of the first camera to those of the second.
    pub rotation: Rotation3<f64>,
}

/// Unit vectors along the rays of pixels at inverse depth `rho`, 1/mm.
fn rays(camera: &Camera, pixels: &[[f64; 2]], rho: f64) -> Vec<Option<Vector3<f64>>> {
    pixels.iter().map(|p| camera.ray(*p, rho).ok().map(|[x, y]| Vector3::new(x, y, 1.0).normalize())).collect()
}

/// The rotation that maps the first rays to the second best, in weighted least squares (Kabsch 1976).
fn best_rotation([first, second]: [&[Option<Vector3<f64>>]; 2], weights: &[f64]) -> Rotation3<f64> {
    let mut moments = Matrix3::zeros();
    for ((first, second), weight) in first.iter().zip(second).zip(weights) {
        if let (Some(first), Some(second)) = (first, second) {
            moments += second * first.transpose() * *weight;
        }
    }
    let svd = moments.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Rotation3::identity() };
    let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
    Rotation3::from_matrix_unchecked(u * mirror * v_t)
}

/// Second minus first pixel of every cell for the best rotation under `weights`, and that rotation.
fn displaced(
    [first, second]: [&Camera; 2],
    pixels: &[[f64; 2]],
    distance_mm: f64,
    weights: &[f64],
) -> (Vec<f64>, Rotation3<f64>) {
    let [from, to] = [first, second].map(|camera| rays(camera, pixels, 1.0 / distance_mm));
    let rotation = best_rotation([&from, &to], weights);
    let displacement = |(pixel, ray): (&[f64; 2], &Option<Vector3<f64>>)| {
        let rotated = ray.map(|ray| rotation * ray);
        let projected = rotated.and_then(|ray| second.project(&(ray * (distance_mm / ray.z))));
        projected.map_or([f64::NAN; 2], |p| [p[0] - pixel[0], p[1] - pixel[1]])
    };
    (pixels.iter().zip(&from).flat_map(displacement).collect(), rotation)
}

/// Difference of projection at pixels and a distance. The rotation is found with equal weights first, then with the inverse
/// variances that these give.
pub fn projection_difference(pair: [&UncertainCamera; 2], pixels: &[[f64; 2]], distance_mm: f64) -> OfProjection {
    let under = |weights: &[f64]| Propagated::new(pair, |cameras| displaced(cameras, pixels, distance_mm, weights).0);
    let equal = vec![1.0; pixels.len()];
    let mut weights = equal.clone();
    if !pair.iter().all(|camera| camera.is_exact()) {
        let weight = |std: Option<f64>| std.filter(|std| *std > 0.0).map_or(0.0, |std| std.powi(-2));
        weights = under(&equal).std_devs::<2>().into_iter().map(weight).collect();
    }
    let cameras = pair.map(|camera| &camera.camera);
    OfProjection { difference: under(&weights), rotation: displaced(cameras, pixels, distance_mm, &weights).1 }
}

/// Whether a lens has other rays at other distances: its focal length changes with distance.
pub fn depends_on_distance(camera: &Camera, pixels: &[[f64; 2]], [near_mm, far_mm]: [f64; 2]) -> bool {
    let [near, far] = [near_mm, far_mm].map(|distance| rays(camera, pixels, 1.0 / distance));
    near.iter().zip(&far).any(|pair| matches!(pair, (Some(a), Some(b)) if (a - b).norm() > SAME_RAY))
}

/// Difference of corrected depth, mm, at pixels under their conditions, for every measured depth.
pub fn depth_differences(pair: [&UncertainCamera; 2], contexts: &[Context], distances_mm: &[f64]) -> Vec<Propagated> {
    let all = Propagated::new(pair, |cameras| {
        let corrected = |camera: &Camera, context: &Context, depth_mm: f64| {
            camera.correct(context, 1.0, 1.0 / depth_mm).map_or(f64::NAN, |(_, rho)| 1.0 / rho)
        };
        let difference = |depth_mm: f64, context: &Context| {
            let [first, second] = cameras.map(|camera| corrected(camera, context, depth_mm));
            second - first
        };
        distances_mm
            .iter()
            .flat_map(|depth| contexts.iter().map(move |context| (*depth, context)))
            .map(|(depth, context)| difference(depth, context))
            .collect()
    });
    let cells = contexts.len();
    (0..distances_mm.len()).map(|i| all.part(i * cells..(i + 1) * cells)).collect()
}
