//! Depth beyond the distances at which a calibration has seen boards: there the correction extrapolates, or the unit is another.

use std::ops::Add;

use depthcal_calibration::depth_uncertainty::support_of;
use depthcal_calibration::observe::PlacedCamera;
use depthcal_io::{Calibration, DepthFrame};
use depthcal_report::format::{interval, percent, quantity};

use super::job::Job;
use crate::failure::Failure;

/// Factor by which depth differs from the boards' from which on its unit is another.
const OTHER_UNIT: f64 = 20.0;
/// Units of files, mm.
const UNITS_MM: [f64; 7] = [1.0, 1000.0, 10.0, 0.1, 0.25, 0.125, 0.001];
/// Factor beyond the boards' distances within which a unit is plausible.
const PLAUSIBLE: f64 = 3.0;
/// Share of pixels beyond, per cent, from which on it is told.
const LEAST_PERCENT: f64 = 1.0;
/// Share from which on the unit is doubted.
const DOUBTED_PERCENT: f64 = 95.0;

/// The distances at which boards were seen, and a little beyond, mm.
pub(super) struct Reach([f64; 2]);

/// Numbers of pixels with depth, and of those whose depth is beyond the boards'.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Beyond {
    measured: usize,
    pub nearer: usize,
    pub farther: usize,
}

impl Add for Beyond {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            measured: self.measured + other.measured,
            nearer: self.nearer + other.nearer,
            farther: self.farther + other.farther,
        }
    }
}

impl Reach {
    /// Of a camera of a calibration; `None` where it knows no boards.
    pub fn of(calibration: &Calibration, placed: &PlacedCamera) -> Option<Self> {
        Some(Self(support_of(calibration, placed)?.supported_mm()))
    }

    /// Counts the pixels of a frame, as measured.
    pub fn beyond(&self, depth: &DepthFrame, unit_mm: f64) -> Beyond {
        let Self([near, far]) = self;
        let mut beyond = Beyond::default();
        for raw in (0..depth.len()).filter_map(|i| depth.measurement(i)) {
            let mm = raw * unit_mm;
            beyond.measured += 1;
            beyond.nearer += usize::from(mm < *near);
            beyond.farther += usize::from(mm > *far);
        }
        beyond
    }

    /// Refuses depth of a frame that cannot be in its unit: most of it is many times nearer or farther than all boards.
    pub fn check_unit(&self, depth: &DepthFrame, job: &Job) -> Result<(), Failure> {
        let Self([near, far]) = self;
        let mut values: Vec<f64> = (0..depth.len()).step_by(7).filter_map(|i| depth.measurement(i)).collect();
        values.sort_by(f64::total_cmp);
        let Some(median) = values.get(values.len() / 2) else { return Ok(()) };
        let mm = median * job.unit_mm;
        if mm >= near / OTHER_UNIT && mm <= far * OTHER_UNIT {
            return Ok(());
        }
        let is_plausible = |unit: &&f64| (near / PLAUSIBLE..=far * PLAUSIBLE).contains(&(median * **unit));
        let remedy = UNITS_MM.iter().find(is_plausible).map_or_else(
            || "give the millimetres of a step as --unit-mm, or as unit_mm under [depth] of dataset.toml".to_owned(),
            |unit| format!("--unit-mm {unit}, or unit_mm = {unit:?} under [depth] of dataset.toml, would fit"),
        );
        Err(Failure::Input(format!(
            "{}: its median depth is {} where a step is {} mm, but the boards of the calibration were at {}: {remedy}",
            job.depth.display(),
            quantity(mm, "mm"),
            job.unit_mm,
            interval(*near, *far, "mm")
        )))
    }

    /// A warning about all frames; `None` where nearly all depth is within reach.
    pub fn warning(&self, beyond: Beyond) -> Option<String> {
        let Self([near, far]) = self;
        let share = |count: usize| 100.0 * count as f64 / beyond.measured.max(1) as f64;
        let all = share(beyond.nearer + beyond.farther);
        let doubt = if all > DOUBTED_PERCENT { ", or --unit-mm is not that of these images" } else { "" };
        (all > LEAST_PERCENT).then(|| {
            format!(
                "the calibration has seen boards at {}; {} of the pixels with depth are nearer ({}) or farther ({}): there the correction \
                 extrapolates{doubt}; --mask tells these pixels apart, boards at such distances calibrate them",
                interval(*near, *far, "mm"),
                percent(all),
                percent(share(beyond.nearer)),
                percent(share(beyond.farther))
            )
        })
    }
}
