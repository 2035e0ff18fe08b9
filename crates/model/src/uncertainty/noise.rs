//! The noise of measured depth.

/// Standard deviation of measured inverse depth: σ_ρ² = a² + (b ρ²)².
///
/// a is constant in inverse depth (structured light, stereo), b in depth (time of flight).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthNoise {
    /// 1/mm.
    pub a_per_mm: f64,
    /// mm.
    pub b_mm: f64,
}

impl DepthNoise {
    /// σ_ρ at an inverse depth, 1/mm.
    pub fn sigma(&self, inverse_depth: f64) -> f64 {
        self.a_per_mm.hypot(self.b_mm * inverse_depth * inverse_depth)
    }
}
