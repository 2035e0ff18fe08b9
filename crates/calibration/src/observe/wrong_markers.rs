//! Markers that were found in the wrong place: on a speck, on a reflection, on the neighbour.
//!
//! Most markers are detected to a tenth of a pixel, but a few among thousands are a pixel or more off. A robust loss reduces
//! their influence on the fit, but not on the reprojection error that is reported.

use depthcal_statistics::upper_median;

use depthcal_io::MarkerObservation;

/// A marker that is nearer to where the fit has it is none that was found wrongly, px.
const LEAST_PX: f64 = 1.0;
/// … nor is one within so many standard deviations of a coordinate: Gaussian noise leaves these once in 3000 markers.
const SIGMAS: f64 = 4.0;
/// Where more than this share of all markers, and more than one, is so far off it is not the markers that are wrong but the
/// model.
const LARGEST_SHARE: f64 = 0.02;

/// Distance from the fit from which on a marker is wrong, px, given those of all markers; `None` where too many are.
pub(crate) fn limit_px(distances_px: &[f64]) -> Option<f64> {
    // The median of a Rayleigh distribution is 1.18 standard deviations of a coordinate.
    let sigma = upper_median(&mut distances_px.to_vec())? / (2.0 * std::f64::consts::LN_2).sqrt();
    let limit = LEAST_PX.max(SIGMAS * sigma);
    let beyond = distances_px.iter().filter(|d| **d > limit).count() as f64;
    (beyond <= (LARGEST_SHARE * distances_px.len() as f64).max(1.0)).then_some(limit)
}

/// Takes out the markers that are farther than `limit_px` from the fit and returns them; `distances_px` has one entry per marker.
pub(crate) fn take_wrong(
    markers: &mut Vec<MarkerObservation>,
    distances_px: &[f64],
    limit_px: f64,
) -> Vec<MarkerObservation> {
    let mut distances = distances_px.iter();
    markers.extract_if(.., |_| distances.next().is_some_and(|d| *d > limit_px)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_far_markers_are_wrong_and_many_are_not() {
        let mut distances: Vec<f64> = (0..200).map(|i| 0.05 + 0.001 * f64::from(i)).collect();
        assert_eq!(limit_px(&distances), Some(1.0), "noise far below a pixel");
        distances[17] = 1.3;
        distances[90] = 40.0;
        let limit = limit_px(&distances).unwrap();
        let mut markers: Vec<MarkerObservation> =
            (0..200).map(|index| MarkerObservation { index, pixel: [0.0; 2], std_px: 1.0 }).collect();
        let wrong = take_wrong(&mut markers, &distances, limit);
        assert_eq!(wrong.iter().map(|m| m.index).collect::<Vec<_>>(), [17, 90]);
        assert_eq!(markers.len(), 198);
        // A lens that does not fit leaves a tenth of the markers far off.
        distances[180..].fill(3.0);
        assert_eq!(limit_px(&distances), None);
        // Noise of a pixel is no reason to leave markers out.
        let noisy: Vec<f64> = (0..200).map(|i| 0.02 * f64::from(i)).collect();
        assert!(limit_px(&noisy).unwrap() > 4.0);
        assert_eq!(limit_px(&[]), None);
    }
}
