//! The region that a pixel integrates: its square convolved with the lens' blur.

/// Weighted samples of the region from which light reaches a pixel.
pub(crate) struct Spread {
    /// Half the side of the region, px.
    pub reach: f64,
    /// Distance between samples, px.
    pub step: f64,
    /// Offset from the pixel's centre, px, and weight; the weights add up to 1.
    pub samples: Vec<([f64; 2], f64)>,
}

impl Spread {
    /// For a Gaussian blur of `sigma` px.
    pub fn new(sigma: f64) -> Self {
        let reach = 0.5 + 2.4 * sigma;
        let count = ((2.0 * reach / 0.5).ceil() as usize).clamp(8, 40);
        let step = 2.0 * reach / count as f64;
        let line: Vec<(f64, f64)> = (0..count)
            .map(|i| {
                let offset = (i as f64 + 0.5) * step - reach;
                (offset, density(offset, sigma))
            })
            .collect();
        let sum: f64 = line.iter().map(|(_, weight)| weight).sum();
        let samples =
            line.iter().flat_map(|&(v, b)| line.iter().map(move |&(u, a)| ([u, v], a * b / (sum * sum)))).collect();
        Self { reach, step, samples }
    }
}

/// A box of one pixel convolved with a Gaussian, at `x`, up to a factor.
fn density(x: f64, sigma: f64) -> f64 {
    if sigma == 0.0 {
        return 1.0;
    }
    (0..20).map(|i| (f64::from(i) + 0.5) / 20.0 - 0.5).map(|t| (-0.5 * ((x - t) / sigma).powi(2)).exp()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variance_is_that_of_box_and_blur() {
        for sigma in [0.0, 0.5, 0.7, 1.5] {
            let spread = Spread::new(sigma);
            let sum = |f: &dyn Fn([f64; 2]) -> f64| spread.samples.iter().map(|(p, w)| w * f(*p)).sum::<f64>();
            assert!((sum(&|_| 1.0) - 1.0).abs() < 1e-12);
            assert!(sum(&|[u, _]| u).abs() < 1e-12);
            let variance = sum(&|[u, _]| u * u) + spread.step * spread.step / 12.0;
            assert!((variance - sigma * sigma - 1.0 / 12.0).abs() < 0.05 * (sigma * sigma + 1.0 / 12.0), "{variance}");
        }
    }
}
