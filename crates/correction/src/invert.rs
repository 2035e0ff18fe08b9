//! The inverse of a scalar function that is known by its values alone.

/// The inverse depth ρ (1/mm) whose measured value is `measured_rho`, for functions that change it by a part only; `None`
/// where there is no such ρ near it or the function falls there.
///
/// Newton's method with slopes from symmetric differences: these change the path, not the root.
pub(super) fn inverse_depth(measured: &impl Fn(f64) -> f64, measured_rho: f64) -> Option<f64> {
    let mut rho = measured_rho;
    for _ in 0..60 {
        let h = 1e-6 * rho;
        let slope = (measured(rho + h) - measured(rho - h)) / (2.0 * h);
        if !(slope > 0.0) {
            return None;
        }
        let step = (measured_rho - measured(rho)) / slope;
        rho += step;
        if !(rho > 0.0) {
            return None;
        }
        if step.abs() <= 1e-13 * rho {
            return Some(rho);
        }
    }
    let settled = (measured(rho) - measured_rho).abs() <= 1e-10 * measured_rho;
    settled.then_some(rho)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_root_or_none() {
        let offset = |rho: f64| 1.02 * rho + 1e-5;
        let rho = inverse_depth(&offset, 1e-3).unwrap();
        assert!((offset(rho) - 1e-3).abs() < 1e-16);
        assert_eq!(inverse_depth(&|rho: f64| -rho, 1e-3), None);
        assert_eq!(inverse_depth(&|rho: f64| rho + 5e-3, 1e-3), None);
    }
}
