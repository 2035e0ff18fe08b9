//! Powell's dog-leg step.

/// The dog-leg step within a trust region ‖D δ‖ ≤ Δ (Powell 1970; Nocedal & Wright 2006, section 4.1).
///
/// The dog-leg path goes from 0 along the scaled gradient −D⁻² g to the Cauchy point, the model's minimum on that line, and
/// from there straight to the Gauss–Newton step. The step ends where the path leaves the region.
pub(crate) struct DogLeg<'a> {
    pub gradient: &'a [f64],
    /// Diagonal of D².
    pub d2: &'a [f64],
    /// The Gauss–Newton step.
    pub newton: &'a [f64],
    /// sᵀ H s for the scaled gradient s = −D⁻² g.
    pub curvature: f64,
    /// Δ.
    pub radius: f64,
}

impl DogLeg<'_> {
    /// Writes the step δ; returns the decrease of the cost that the model predicts, and ‖D δ‖.
    pub fn step(&self, step: &mut [f64]) -> (f64, f64) {
        let scaled = |i: usize| -self.gradient[i] / self.d2[i];
        let n = self.gradient.len();
        let norm = |f: &dyn Fn(usize) -> f64| (0..n).map(|i| f(i) * f(i) * self.d2[i]).sum::<f64>();
        // ‖s‖², ‖n‖² and s·n in the metric D², with n the Gauss–Newton step.
        let ss = norm(&scaled);
        let nn = norm(&|i| self.newton[i]);
        let sn: f64 = (0..n).map(|i| scaled(i) * self.newton[i] * self.d2[i]).sum();
        let slope: f64 = (0..n).map(|i| -self.gradient[i] * self.newton[i]).sum();
        let radius2 = self.radius * self.radius;
        // δ = a s + b n.
        let cauchy = if self.curvature > 0.0 { ss / self.curvature } else { f64::INFINITY };
        let (a, b) = if nn <= radius2 {
            (0.0, 1.0)
        } else if cauchy * cauchy * ss >= radius2 {
            (self.radius / ss.sqrt(), 0.0)
        } else {
            // ‖c + t (n − c)‖² = Δ² with c the Cauchy point.
            let (cc, cn) = (cauchy * cauchy * ss, cauchy * sn);
            let (p, q, r) = (cc - 2.0 * cn + nn, cn - cc, cc - radius2);
            // The positive root, in the form without cancellation; r < 0.
            let root = (q * q - p * r).sqrt();
            let t = if q > 0.0 { -r / (q + root) } else { (root - q) / p };
            (cauchy * (1.0 - t), t)
        };
        for (i, step) in step.iter_mut().enumerate() {
            *step = a * scaled(i) + b * self.newton[i];
        }
        // H n = −g, gᵀ s = −ss, sᵀ H n = −gᵀ s = ss.
        let linear = a * ss + b * slope;
        let quadratic = a * a * self.curvature + 2.0 * a * b * ss + b * b * slope;
        let length = a * a * ss + 2.0 * a * b * sn + b * b * nn;
        (linear - 0.5 * quadratic, length.max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_is_the_best_on_the_path_within_the_region() {
        // H = [4 1; 1 3], g = (1, 2), D² = diag(H).
        let h = [[4.0, 1.0], [1.0, 3.0]];
        let gradient = [1.0, 2.0];
        let d2 = [4.0, 3.0];
        let newton = [-1.0 / 11.0, -7.0 / 11.0];
        let s = [-0.25, -2.0 / 3.0];
        let form = |x: [f64; 2]| (0..2).map(|i| (0..2).map(|j| x[i] * h[i][j] * x[j]).sum::<f64>()).sum::<f64>();
        let model = |x: [f64; 2]| gradient[0] * x[0] + gradient[1] * x[1] + 0.5 * form(x);
        let mut last = 0.0;
        for radius in [0.01, 0.3, 0.9, 0.95, 1.0, 1.1, 1.2, 5.0] {
            let dog_leg = DogLeg { gradient: &gradient, d2: &d2, newton: &newton, curvature: form(s), radius };
            let mut step = [0.0; 2];
            let (predicted, length) = dog_leg.step(&mut step);
            let expected = (4.0 * step[0] * step[0] + 3.0 * step[1] * step[1]).sqrt();
            assert!((length - expected).abs() < 1e-14, "{length} {expected}");
            assert!(length <= radius * (1.0 + 1e-14));
            assert!((predicted + model(step)).abs() < 1e-14);
            assert!(predicted >= last, "a larger region cannot be worse");
            last = predicted;
        }
        assert!((last + model(newton)).abs() < 1e-14);
    }
}
