//! The infrared amplitude at and around points of an image.

use depthcal_io::GrayImage;
use depthcal_model::frame_covariates::mean_and_slope;

/// The amplitude at the pixel nearest to (u, v); NaN outside the image.
pub fn amplitude(image: &GrayImage, [u, v]: [f64; 2]) -> f64 {
    nearest(image, [u, v]).map_or(f64::NAN, |[u, v]| f64::from(image.data[v * image.width + u]))
}

/// Mean around the pixel nearest to (u, v), and the slope of its logarithm, 1/px; NaN outside the image.
pub fn surround(image: &GrayImage, [u, v]: [f64; 2]) -> (f64, [f64; 2]) {
    let outside = (f64::NAN, [f64::NAN; 2]);
    nearest(image, [u, v]).map_or(outside, |pixel| mean_and_slope(&image.data, [image.width, image.height], pixel))
}

fn nearest(image: &GrayImage, [u, v]: [f64; 2]) -> Option<[usize; 2]> {
    let (u, v) = (u.round(), v.round());
    let inside = u >= 0.0 && v >= 0.0 && u < image.width as f64 && v < image.height as f64;
    inside.then_some([u as usize, v as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_have_the_nearest_pixel() {
        let image = GrayImage { width: 4, height: 3, data: (0..12).map(|i| 100 + i).collect(), bits: 8 };
        assert_eq!((amplitude(&image, [2.4, 0.6]), amplitude(&image, [-0.4, 2.4])), (106.0, 108.0));
        assert_eq!(surround(&image, [2.4, 0.6]), mean_and_slope(&image.data, [4, 3], [2, 1]));
        for outside in [[-0.6, 1.0], [1.0, 2.6], [f64::NAN, 1.0]] {
            assert!(amplitude(&image, outside).is_nan() && surround(&image, outside).0.is_nan());
        }
    }
}
