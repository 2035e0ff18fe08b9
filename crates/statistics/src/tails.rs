//! Tails and quantiles of distributions.

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor, Gamma, Normal, StudentsT};

/// P(N(0, 1) > z).
pub fn normal_tail(z: f64) -> f64 {
    Normal::standard().sf(z)
}

/// P(X > z) of a gamma distribution of mean 0, variance 1 and this skewness (Pearson's type III); the normal distribution
/// without skewness, or with a negative one, whose upper tail is lighter.
pub fn gamma_tail(z: f64, skewness: f64) -> f64 {
    if !(skewness > 1e-3) {
        return normal_tail(z);
    }
    let shape = 4.0 / (skewness * skewness);
    let x = shape + z * shape.sqrt();
    if x <= 0.0 { 1.0 } else { Gamma::new(shape, 1.0).map_or(f64::NAN, |d| d.sf(x)) }
}

/// P(Σ λ χ²₁ > x), given the sums of the λ, of their squares and of their cubes: the tail of the gamma distribution of the same
/// first three moments.
pub fn weighted_chi_squared_tail(x: f64, [sum, of_squares, of_cubes]: [f64; 3]) -> f64 {
    let variance = 2.0 * of_squares;
    gamma_tail((x - sum) / variance.sqrt(), 8.0 * of_cubes / variance.powf(1.5))
}

/// The quantile `q` in (0, 1) of Student's t; NaN of no degrees of freedom.
pub fn student_quantile(q: f64, degrees: usize) -> f64 {
    StudentsT::new(0.0, 1.0, degrees as f64).map_or(f64::NAN, |d| d.inverse_cdf(q))
}

/// P(χ²_k > x), the upper tail of the χ² distribution with k degrees of freedom; 1 for k = 0.
pub fn chi_squared_tail(x: f64, k: usize) -> f64 {
    if k == 0 || !(x > 0.0) {
        return 1.0;
    }
    ChiSquared::new(k as f64).map_or(f64::NAN, |d| d.sf(x))
}

/// P(F_{a,b} > x), the upper tail of the F distribution with a and b degrees of freedom; 1 if one of them is 0.
pub fn f_tail(x: f64, a: usize, b: usize) -> f64 {
    if a == 0 || b == 0 || !(x > 0.0) {
        return 1.0;
    }
    if x.is_infinite() {
        return 0.0;
    }
    FisherSnedecor::new(a as f64, b as f64).map_or(f64::NAN, |d| d.sf(x))
}

/// P(χ'²_k(λ) > x), the upper tail of the noncentral χ² distribution with k degrees of freedom and noncentrality λ, as a
/// Poisson mixture of central distributions (Patnaik 1949); 0 for k = 0. It is the power of a χ² test with threshold x.
pub fn noncentral_chi_squared_tail(x: f64, k: usize, lambda: f64) -> f64 {
    if k == 0 {
        return 0.0;
    }
    if !(lambda > 0.0) {
        return chi_squared_tail(x, k);
    }
    let half = lambda / 2.0;
    // Weights beyond ten standard deviations of the Poisson distribution are below rounding errors.
    let spread = 10.0 * half.sqrt() + 20.0;
    let (first, last) = ((half - spread).max(0.0) as usize, (half + spread) as usize);
    let mut log_weight = -half + first as f64 * half.ln() - statrs::function::gamma::ln_gamma(first as f64 + 1.0);
    let mut sum = 0.0;
    for j in first..=last {
        sum += log_weight.exp() * chi_squared_tail(x, k + 2 * j);
        log_weight += half.ln() - ((j + 1) as f64).ln();
    }
    sum.min(1.0)
}

/// The x with P(χ²_k > x) = `alpha`, for k > 0.
pub fn chi_squared_upper_quantile(alpha: f64, k: usize) -> f64 {
    // By bisection on the upper tail: the inverse of the lower tail at 1 − α loses all digits for small α.
    ChiSquared::new(k as f64).map_or(f64::NAN, |d| bisect(|x| d.sf(x) - alpha, 0.0, 1e4))
}

/// The noncentrality λ at which a χ²_k test at level `alpha` rejects with probability `power`; infinite for k = 0.
pub fn noncentrality(k: usize, alpha: f64, power: f64) -> f64 {
    if k == 0 {
        return f64::INFINITY;
    }
    let threshold = chi_squared_upper_quantile(alpha, k);
    bisect(|lambda| power - noncentral_chi_squared_tail(threshold, k, lambda), 0.0, 1e4)
}

/// The root of a decreasing function between `low` and `high`, by bisection.
fn bisect(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if f(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
        if high - low <= 1e-12 * high {
            break;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of scipy.stats: chi2.sf, f.sf, ncx2.sf, norm.sf and t.ppf.
    #[test]
    fn tails_are_those_of_an_independent_implementation() {
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-8, "{a} against {b}");
        close(chi_squared_tail(3.841458820694124, 1), 0.05);
        close(chi_squared_tail(100.0, 4), 9.836624224615988e-21);
        close(f_tail(4.0, 3, 20), 0.022076999662362404);
        close(noncentral_chi_squared_tail(10.0, 2, 5.0), 0.2313084493401366);
        close(normal_tail(3.0), 0.0013498980316300933);
        close(student_quantile(0.975, 1), 12.706204736432095);
        close(student_quantile(0.975, 7), 2.3646242515927844);
    }

    /// One degree of freedom: the two-sided normal test has λ = (z_{1−α/2} + z_{power})², here (1.959964 + 0.841621)²,
    /// up to the other tail's share of 1e-6.
    #[test]
    fn noncentrality_of_one_degree_of_freedom_is_the_normal_tests() {
        assert!((noncentrality(1, 0.05, 0.8) - 7.8489).abs() < 1e-3);
        assert!((noncentral_chi_squared_tail(3.841458820694124, 1, 7.8489) - 0.8).abs() < 1e-4);
    }
}
