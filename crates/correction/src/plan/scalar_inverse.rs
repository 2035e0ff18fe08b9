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

    /// A function of ten digits: steps never fall below the limit, and the place is as good as it can be.
    #[test]
    fn steps_of_the_function_are_no_failure() {
        let stepped = |rho: f64| (1.02 * rho * 1e14).round() / 1e14;
        let rho = inverse_depth(&stepped, 1.000_000_000_003_7e-3).unwrap();
        assert!((1.02 * rho - 1e-3).abs() < 2e-14);
        // Coarser than what counts as found.
        let coarse = |rho: f64| (1.02 * rho * 1e12).round() / 1e12;
        assert_eq!(inverse_depth(&coarse, 1.000_000_000_37e-3), None);
    }

    #[test]
    fn finds_the_root_or_none() {
        let offset = |rho: f64| 1.02 * rho + 1e-5;
        let rho = inverse_depth(&offset, 1e-3).unwrap();
        assert!((offset(rho) - 1e-3).abs() < 1e-16);
        assert_eq!(inverse_depth(&|rho: f64| -rho, 1e-3), None);
        assert_eq!(inverse_depth(&|rho: f64| rho + 5e-3, 1e-3), None);
    }
}
