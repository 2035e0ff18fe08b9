//! Robust losses.

/// A loss ρ(s) of the squared norm s = ‖r‖² of a whitened residual; the cost is ½ Σ ρ(s).
///
/// All losses satisfy ρ(s) ≈ s for small s, so that scales are in units of the residual's standard deviation. The solver
/// uses iteratively reweighted least squares: it multiplies rows by √ρ′(s). For these losses (ρ″ ≤ 0) that is the corrector
/// of Triggs et al. 2000 without its indefinite second-order term.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Loss {
    /// ρ = s: least squares.
    #[default]
    Trivial,
    /// Quadratic up to ‖r‖ = `delta`, linear beyond (Huber 1964).
    Huber {
        /// ‖r‖ beyond which ρ is linear.
        delta: f64,
    },
    /// ρ = c² ln(1 + s/c²).
    Cauchy {
        /// c, the ‖r‖ at which the weight ρ′ has fallen to 1/2.
        scale: f64,
    },
    /// ρ = c²/3 · (1 − (1 − s/c²)³) up to ‖r‖ = c, constant beyond: outliers have no influence (Beaton & Tukey 1974).
    Tukey {
        /// c, the ‖r‖ beyond which the weight ρ′ is zero.
        scale: f64,
    },
    /// ρ = s c²/(c² + s) (Geman & McClure 1985).
    GemanMcClure {
        /// c, the ‖r‖ at which the weight ρ′ has fallen to 1/4.
        scale: f64,
    },
    /// Barron's general loss (Barron 2019, eq. 13): least squares for α = 2, Charbonnier for 1, Cauchy for 0,
    /// Geman–McClure for −2 and Welsch for −∞.
    Barron {
        /// Shape α ≤ 2, −∞ allowed.
        alpha: f64,
        /// Scale c, the ‖r‖ beyond which the loss departs from least squares.
        scale: f64,
    },
    /// `weight` · ρ(s).
    Scaled {
        /// The factor, positive.
        weight: f64,
        /// ρ.
        loss: Box<Loss>,
    },
}

impl Loss {
    /// `weight` · `self`.
    #[must_use]
    pub fn scaled(self, weight: f64) -> Self {
        Loss::Scaled { weight, loss: Box::new(self) }
    }

    /// ρ(s), ρ′(s) and ρ″(s) for s ≥ 0.
    pub fn evaluate(&self, s: f64) -> [f64; 3] {
        match *self {
            Loss::Trivial => [s, 1.0, 0.0],
            Loss::Huber { delta } => {
                if s <= delta * delta {
                    [s, 1.0, 0.0]
                } else {
                    let r = s.sqrt();
                    [2.0 * delta * r - delta * delta, delta / r, -0.5 * delta / (s * r)]
                }
            }
            Loss::Cauchy { scale } => {
                let c2 = scale * scale;
                let w = 1.0 / (1.0 + s / c2);
                [c2 * (s / c2).ln_1p(), w, -w * w / c2]
            }
            Loss::Tukey { scale } => {
                let c2 = scale * scale;
                if s >= c2 {
                    return [c2 / 3.0, 0.0, 0.0];
                }
                let (u, k) = (s / c2, 1.0 - s / c2);
                // 1 − (1 − u)³ without cancellation.
                [c2 / 3.0 * u * (3.0 - 3.0 * u + u * u), k * k, -2.0 * k / c2]
            }
            Loss::GemanMcClure { scale } => {
                let c2 = scale * scale;
                let k = c2 / (c2 + s);
                [s * k, k * k, -2.0 * k * k / (c2 + s)]
            }
            Loss::Barron { alpha, scale } => barron(s, alpha, scale),
            Loss::Scaled { weight, ref loss } => loss.evaluate(s).map(|v| weight * v),
        }
    }

    /// Whether the loss is ρ = s, so that rows need no weights.
    pub fn is_trivial(&self) -> bool {
        *self == Loss::Trivial
    }

    /// The reason why the parameters are out of range, if they are.
    pub(crate) fn invalid(&self) -> Option<&'static str> {
        let bad = |scale: f64| !(scale > 0.0 && scale.is_finite());
        match *self {
            Loss::Trivial => None,
            Loss::Huber { delta: scale }
            | Loss::Cauchy { scale }
            | Loss::Tukey { scale }
            | Loss::GemanMcClure { scale } => bad(scale).then_some("the scale of the loss is not positive"),
            Loss::Barron { alpha, scale } => {
                if alpha > 2.0 || alpha.is_nan() {
                    Some("the shape of Barron's loss exceeds 2")
                } else {
                    bad(scale).then_some("the scale of the loss is not positive")
                }
            }
            Loss::Scaled { weight, ref loss } => {
                if bad(weight) {
                    Some("the weight of the loss is not positive")
                } else {
                    loss.invalid()
                }
            }
        }
    }
}

/// Twice Barron's ρ(x, α, c) times c², as a function of s = x², so that ρ(s) ≈ s for small s.
fn barron(s: f64, alpha: f64, scale: f64) -> [f64; 3] {
    let c2 = scale * scale;
    if alpha == 2.0 {
        return [s, 1.0, 0.0];
    }
    if alpha == f64::NEG_INFINITY {
        let e = (-0.5 * s / c2).exp();
        return [-2.0 * c2 * (-0.5 * s / c2).exp_m1(), e, -0.5 * e / c2];
    }
    let b = 2.0 - alpha;
    let u = s / (c2 * b);
    let first = ((0.5 * alpha - 1.0) * u.ln_1p()).exp();
    let second = first * (0.5 * alpha - 1.0) / ((1.0 + u) * c2 * b);
    // (b/α) ((1 + u)^(α/2) − 1), whose limit for α → 0 is (b/2) ln(1 + u).
    let exponent = 0.5 * alpha * u.ln_1p();
    let value = if exponent.abs() < 1e-300 { 0.5 * u.ln_1p() } else { exponent.exp_m1() / alpha };
    [2.0 * c2 * b * value, first, second]
}
