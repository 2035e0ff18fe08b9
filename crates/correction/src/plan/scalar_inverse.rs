//! The inverse of a function of inverse depth that is given by its values alone.

/// The true inverse depth ρ (1/mm) at which `measured` is `measured_rho`. `None` where there is none near
/// `measured_rho`, or `measured` falls on the way there.
///
/// Newton's method, started at `measured_rho`, with slopes from symmetric differences; their error slows the iteration
/// but does not move the root.
pub(crate) fn inverse_depth(measured: &impl Fn(f64) -> f64, measured_rho: f64) -> Option<f64> {
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
    let converged = (measured(rho) - measured_rho).abs() <= 1e-10 * measured_rho;
    converged.then_some(rho)
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
