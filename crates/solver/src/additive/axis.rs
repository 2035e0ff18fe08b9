//! B-splines along one covariate, and the roughness of functions of one or two.

use nalgebra::DMatrix;

/// Degree of piecewise linear splines.
pub const LINEAR: usize = 1;
/// Degree of cubic splines.
pub const CUBIC: usize = 3;
/// Most basis functions that are not zero at a value.
pub const SUPPORT: usize = CUBIC + 1;

/// Uniform B-splines along one covariate: one dimension of a tensor product (de Boor, *A Practical Guide to Splines*, 1978).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Lower end of the range.
    pub low: f64,
    /// Upper end, above `low`.
    pub high: f64,
    /// Number of basis functions, more than the degree.
    pub count: usize,
    /// [`LINEAR`] or [`CUBIC`].
    pub degree: usize,
}

impl Axis {
    /// Number of the first basis function that is not zero at `x`, and the values of it and of the next ones. Beyond the ends
    /// of the axis the functions are constant.
    #[inline]
    pub fn basis(&self, x: f64) -> (usize, [f64; SUPPORT]) {
        let spans = self.count - self.degree;
        let t = ((x - self.low) / (self.high - self.low)).clamp(0.0, 1.0) * spans as f64;
        let span = (t as usize).min(spans - 1);
        let u = t - span as f64;
        let values = if self.degree == LINEAR { [1.0 - u, u, 0.0, 0.0] } else { cubic(u) };
        (span, values)
    }
}

/// The four cubic B-splines that are not zero in a span, at the share `u` of it.
#[inline]
fn cubic(u: f64) -> [f64; SUPPORT] {
    let v = 1.0 - u;
    [v * v * v, (3.0 * u - 6.0) * u * u + 4.0, (3.0 * v - 6.0) * v * v + 4.0, u * u * u].map(|b| b / 6.0)
}

/// Weight of the ridge relative to squared second differences.
const RIDGE: f64 = 1e-2;

/// Precision matrix of second differences along one axis or two, the first one's coefficients following each other, and a weak
/// ridge (Eilers, Marx, *Flexible smoothing with B-splines and penalties*, Statistical Science 11, 1996).
pub fn smoothness_precision(axes: &[Axis]) -> DMatrix<f64> {
    let counts: Vec<usize> = axes.iter().map(|a| a.count).chain([1, 1]).take(2).collect();
    let (nu, nv) = (counts[0], counts[1]);
    let n = nu * nv;
    let mut p = DMatrix::identity(n, n) * RIDGE;
    let mut add = |cells: [usize; 3]| {
        let weights = [1.0, -2.0, 1.0];
        for (a, wa) in cells.iter().zip(weights) {
            for (b, wb) in cells.iter().zip(weights) {
                p[(*a, *b)] += wa * wb;
            }
        }
    };
    for v in 0..nv {
        (1..nu.saturating_sub(1)).for_each(|u| add([v * nu + u - 1, v * nu + u, v * nu + u + 1]));
    }
    for u in 0..nu {
        (1..nv.saturating_sub(1)).for_each(|v| add([(v - 1) * nu + u, v * nu + u, (v + 1) * nu + u]));
    }
    p
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn basis_functions_add_up_to_one_and_reproduce_a_straight_line() {
        for degree in [LINEAR, CUBIC] {
            let axis = Axis { low: -2.0, high: 5.0, count: 9, degree };
            let spans = (axis.count - degree) as f64;
            for i in 0..=70 {
                let x = -2.0 + 0.1 * f64::from(i);
                let (first, values) = axis.basis(x);
                let sum: f64 = values.iter().sum();
                assert!((sum - 1.0).abs() < 1e-12, "degree {degree} at {x}: {sum}");
                // The coefficient of a basis function is the value at its middle (Marsden's identity).
                let middle = |k: usize| -2.0 + 7.0 * ((first + k) as f64 - 0.5 * (degree as f64 - 1.0)) / spans;
                let line: f64 = values.iter().enumerate().map(|(k, value)| value * middle(k)).sum();
                assert!((line - x).abs() < 1e-12, "degree {degree} at {x}: {line}");
            }
        }
    }

    /// Planes have no second differences.
    #[test]
    fn planes_are_smooth() {
        let axis = |count| Axis { low: 0.0, high: 1.0, count, degree: CUBIC };
        let p = smoothness_precision(&[axis(5), axis(4)]) - DMatrix::identity(20, 20) * RIDGE;
        let plane = DMatrix::from_fn(20, 1, |i, _| 2.0 + 3.0 * (i % 5) as f64 - 0.5 * (i / 5) as f64);
        assert!((p * plane).norm() < 1e-12);
    }
}
