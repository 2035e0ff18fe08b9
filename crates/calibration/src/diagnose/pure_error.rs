//! Pure error: what the residuals of different frames do not share, and the structure that they do.
//!
//! The noise of a camera is learnt from its residuals, and a pattern in these then counts as noise. Here no model of the noise is
//! needed: residuals of different frames at the same pixel, board point, depth and so on are correlated where something depends
//! on it, at any scale from a pixel or 2 mm upwards, whatever its form ([`shared_structure`]).

use depthcal_statistics::{PlacedValue, SharedOctave, family_p_values, shared_structure};
use rayon::prelude::*;

use super::free_functions::Along;
use super::pure_noise::{PureNoise, pure_noise};
use super::residual_cells::{COVERS, Cells, Cover, LARGEST_SHARE, cells_of};
use super::thresholds::Thresholds;
use crate::calibrate::CalibratedCamera;
use crate::judge::camera::residual_pixels;

/// Fewest and most frames that are compared: pairs grow with their square.
const FRAMES: [usize; 2] = [12, 64];
/// Most image pixels of these frames together, which bounds memory. Frames are left out whole: fine structure needs neighbouring
/// pixels.
const MOST_PIXELS: usize = 12_000_000;

/// The depth residuals, the part of them that frames share, and the rest.
#[derive(Debug, Clone)]
pub struct PureError {
    /// Root mean square of the depth residuals over the board pixels of all frames, mm.
    pub residual_mm: f64,
    /// Root mean square without what frames certainly share: the error that no function of the covariates could take away, mm.
    pub pure_mm: f64,
    /// Structure that frames certainly share, by falling size: one entry for each covariate or pair.
    pub shared: Vec<Shared>,
    /// The law of the pure error over depth, and how far it is correlated; `None` where residuals are too few to tell.
    pub noise: Option<PureNoise>,
}

impl PureError {
    /// Residual over pure error, from 1.
    pub fn ratio(&self) -> f64 {
        self.residual_mm / self.pure_mm
    }
}

/// Structure that residuals of different frames share at the same value of a covariate.
#[derive(Debug, Clone, PartialEq)]
pub struct Shared {
    /// The covariate, or two that it depends on together.
    pub along: Vec<Along>,
    /// Scale at which it is most certain, in the covariate's unit.
    pub scale: f64,
    /// Root mean square over all scales, mm.
    pub size_mm: f64,
    /// Statistic at that scale, in standard deviations of what chance gives.
    pub z: f64,
    /// Probability by chance, corrected for the number of scales and covariates.
    pub p_value: f64,
}

/// The pure error of a fit; `None` without depth in six frames or more, from which it could be told.
pub fn pure_error(fit: &CalibratedCamera, thresholds: &Thresholds) -> Option<PureError> {
    let frames = &fit.capture.frames;
    let with_depth: Vec<usize> = (0..frames.len()).filter(|i| !frames[*i].samples.is_empty()).collect();
    let most = (MOST_PIXELS / (fit.capture.width * fit.capture.height).max(1)).clamp(FRAMES[0], FRAMES[1]);
    let count = with_depth.len().min(most);
    // Evenly over all frames.
    let chosen: Vec<usize> = (0..count).map(|k| with_depth[k * with_depth.len() / count]).collect();
    let capture = fit.capture.subset(|i, _| chosen.binary_search(&i).is_ok());
    let cells: Vec<(Vec<Cells>, [f64; 2])> = residual_pixels(&fit.camera, &capture, |errors| cells_of(fit, &errors));
    let numbers: f64 = cells.iter().map(|c| c.0.len() as f64).sum();
    let residual_mm = (cells.iter().map(|c| c.1[0]).sum::<f64>() / numbers).sqrt();
    // Noise of the mean weight: what is shared, in standard deviations of the noise, times this is its size.
    let noise_mm = (cells.iter().map(|c| c.1[1]).sum::<f64>() / numbers).sqrt().recip();
    if !(residual_mm > 0.0 && noise_mm.is_finite()) {
        return None;
    }
    let of_cover = |cover: &Cover| -> Vec<SharedOctave> {
        let size = cover.size(cells.iter().map(|c| c.0.as_slice()));
        let value = |c: &Cells| PlacedValue { cell: (cover.place)(c).map(u32::from), value: c.value.into() };
        shared_structure(cells.len(), size, |group| cells[group].0.iter().map(value))
    };
    let octaves: Vec<Vec<SharedOctave>> = COVERS.par_iter().map(of_cover).collect();
    if octaves.iter().all(Vec::is_empty) {
        return None;
    }
    let mut p_values = family_p_values(&octaves.concat()).into_iter();
    let mut shared: Vec<Shared> = Vec::new();
    let mut largest: Option<(&Cover, f64)> = None;
    for (cover, octaves) in COVERS.iter().zip(&octaves) {
        let certain: Vec<(&SharedOctave, f64)> =
            octaves.iter().zip(p_values.by_ref()).filter(|(o, p)| *p < thresholds.level && o.variance > 0.0).collect();
        let size_mm = noise_mm * certain.iter().map(|(o, _)| o.variance).sum::<f64>().sqrt();
        let Some((best, p_value)) = certain.iter().max_by(|a, b| a.0.z.total_cmp(&b.0.z)) else { continue };
        let share = (size_mm / residual_mm).powi(2).min(LARGEST_SHARE);
        if largest.is_none_or(|(_, most)| share > most) {
            largest = Some((cover, share));
        }
        shared.push(Shared {
            along: cover.along.to_vec(),
            scale: cover.cell * f64::from(best.side),
            size_mm,
            z: best.z,
            p_value: *p_value,
        });
    }
    shared.sort_by(|a, b| b.size_mm.total_cmp(&a.size_mm));
    let pure_mm = residual_mm * (1.0 - largest.map_or(0.0, |(_, share)| share)).sqrt();
    let frames: Vec<&[Cells]> = cells.iter().map(|c| c.0.as_slice()).collect();
    let noise = pure_noise(fit, &frames, largest.map(|(cover, _)| cover));
    Some(PureError { residual_mm, pure_mm, shared, noise })
}

#[cfg(test)]
mod tests {
    use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

    use super::*;
    use crate::calibrate::{CameraOptions, calibrate_camera};
    use crate::observe::RawFrame;
    use crate::simulated;

    /// Every second column of the depth image is too far by this much, the others too near.
    fn striped(stripes_mm: f64, seed: u64) -> PureError {
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], seed);
        let mut capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        for frame in &mut capture.frames {
            let raw: &mut RawFrame = &mut frame.raw;
            for pixel in raw.depth_pixels_mut() {
                let is_even = (pixel.context.pixel[0] + 0.5) as i64 % 2 == 0;
                pixel.depth_mm += if is_even { stripes_mm } else { -stripes_mm };
            }
        }
        let fit = calibrate_camera(&capture, &CameraOptions::default()).unwrap();
        pure_error(&fit, &Thresholds::default()).unwrap()
    }

    #[test]
    fn noise_is_not_shared() {
        for seed in 0..4 {
            let pure = striped(0.0, seed);
            assert!(pure.shared.is_empty() && pure.ratio() == 1.0, "seed {seed}: {:?}", pure.shared);
        }
    }

    /// Stripes as fine as a column that are half of the noise, which no smooth function shows.
    #[test]
    fn fine_stripes_are_shared() {
        let noise_mm = striped(0.0, 7).residual_mm;
        let pure = striped(0.5 * noise_mm, 7);
        let first = &pure.shared[0];
        assert_eq!((first.along.as_slice(), first.scale), ([Along::Column].as_slice(), 1.0), "{:?}", pure.shared);
        assert!((first.size_mm / (0.5 * noise_mm) - 1.0).abs() < 0.3, "{first:?}, noise {noise_mm} mm");
        assert!(pure.ratio() > 1.05, "{}", pure.ratio());
        // The noise is that of the capture without the stripes, but for these being the same in mm and not in standard
        // deviations: with them in the noise it would be 12 % more.
        let std_mm = |pure: &PureError| pure.noise.as_ref().unwrap().at[1].std_mm;
        let (with, without) = (std_mm(&pure), std_mm(&striped(0.0, 7)));
        assert!((with / without - 1.0).abs() < 0.07, "{with} mm, without stripes {without} mm");
    }
}
