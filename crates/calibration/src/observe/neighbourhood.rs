//! The infrared amplitude at a pixel and around it, a covariate of some effects.

use depthcal_io::GrayImage;
use depthcal_model::SURROUND_PX;

/// Infrared amplitude at a pixel and around it.
#[derive(Debug, Clone, Copy)]
pub struct Neighbourhood {
    /// At the pixel.
    pub amplitude: f64,
    /// Gaussian mean around it, see [`depthcal_model::Context::surround`].
    pub surround: f64,
    /// See [`depthcal_model::Context::slope`].
    pub slope: [f64; 2],
}

impl Neighbourhood {
    /// Reach of the Gaussian window to either side, px.
    const REACH: i64 = 4;

    /// The neighbourhood of the pixel nearest to (u, v); `None` outside the image.
    pub fn at(image: &GrayImage, [u, v]: [f64; 2]) -> Option<Self> {
        let (u, v) = (u.round(), v.round());
        let inside = u >= 0.0 && v >= 0.0 && u < image.width as f64 && v < image.height as f64;
        inside.then(|| Self::around(image, u as i64, v as i64))
    }

    fn around(image: &GrayImage, u: i64, v: i64) -> Self {
        const SPREAD: f64 = 1.0 / (2.0 * SURROUND_PX * SURROUND_PX);
        let weights: [f64; 2 * Self::REACH as usize + 1] =
            std::array::from_fn(|i| (-((i as i64 - Self::REACH) as f64).powi(2) * SPREAD).exp());
        let (mut total, mut sum, mut moment) = (0.0, 0.0, [0.0; 2]);
        for (dv, wv) in (-Self::REACH..).zip(weights) {
            let row = v + dv;
            if row < 0 || row >= image.height as i64 {
                continue;
            }
            for (du, wu) in (-Self::REACH..).zip(weights) {
                let column = u + du;
                if column < 0 || column >= image.width as i64 {
                    continue;
                }
                let weighted = wu * wv * f64::from(image.data[row as usize * image.width + column as usize]);
                total += wu * wv;
                sum += weighted;
                moment[0] += weighted * du as f64;
                moment[1] += weighted * dv as f64;
            }
        }
        // The derivative of a Gaussian mean is its first moment over the variance.
        let slope = moment.map(|m| if sum > 0.0 { m / (sum * SURROUND_PX * SURROUND_PX) } else { 0.0 });
        let amplitude = f64::from(image.data[v as usize * image.width + u as usize]);
        Self { amplitude, surround: sum / total, slope }
    }
}
