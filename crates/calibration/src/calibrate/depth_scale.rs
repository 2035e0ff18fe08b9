//! The scale of measured depth against that of the images: a wrong `spacing_mm` or `unit_mm` in `dataset.toml` scales depth as a
//! whole. The depth model's parameter dw takes a small scale up, so that residuals do not show it; a large one bends the model
//! until it folds.

use depthcal_io::{DeclaredValue, DiagnosisDeclaration};
use depthcal_model::Pattern;
use depthcal_statistics::upper_median;
use nalgebra::Point3;
use thiserror::Error;

use crate::observe::{CameraFrames, SampledFrame};

/// Deviation of the scale from one that a depth camera may have: measured ones are off by up to 2.7 %.
pub const PLAUSIBLE_SCALE_DEVIATION: f64 = 0.08;
/// Scale, or its inverse, beyond which nothing is fitted.
const MOST_SCALE: f64 = 1.5;
const MM_PER_INCH: f64 = 25.4;
/// Relative difference of two ratios within which they count as equal: depth cameras are off by as much.
const EQUAL: f64 = 0.02;

/// Units in which depth is stored.
const USUAL_UNITS: [(f64, &str); 6] = [
    (1000.0, "metres"),
    (10.0, "centimetres"),
    (1.0, "millimetres"),
    (0.25, "quarters of a millimetre"),
    (0.2, "5000 steps to a metre"),
    (0.1, "tenths of a millimetre"),
];

/// Depth and image disagree in scale by more than a depth camera's error.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error(
    "measured depth is {scale:.3} times the depth at which the images see the board, far more than any depth camera is off: check \
     depth.unit_mm (declared {unit_mm}, {:.4} would fit{}) and board.spacing_mm (declared {spacing_mm}, {:.4} would fit{}) in dataset.toml",
    self.fitting_unit_mm(),
    self.usual_unit().map_or_else(String::new, |(unit, what)| format!("; depth in {what} has unit_mm = {unit}")),
    self.fitting_spacing_mm(),
    if self.is_in_inches() { "; the declared one is in inches" } else { "" }
)]
pub struct ImplausibleScale {
    /// Median of measured depth over the depth at which the image sees the board.
    pub scale: f64,
    /// The declared distance between the board's markers, `spacing_mm` under `[board]`.
    pub spacing_mm: f64,
    /// The declared unit of depth, `unit_mm` under `[depth]`.
    pub unit_mm: f64,
}

impl ImplausibleScale {
    /// The `spacing_mm` with which depth and image would agree.
    pub fn fitting_spacing_mm(&self) -> f64 {
        self.spacing_mm * self.scale
    }

    /// The `unit_mm` with which depth and image would agree.
    pub fn fitting_unit_mm(&self) -> f64 {
        self.unit_mm / self.scale
    }

    /// The usual unit with which depth and image would agree, as closely as a depth camera measures.
    fn usual_unit(&self) -> Option<(f64, &'static str)> {
        USUAL_UNITS
            .into_iter()
            .find(|(unit, _)| (self.fitting_unit_mm() / unit - 1.0).abs() < PLAUSIBLE_SCALE_DEVIATION)
    }

    /// Whether the board's size is declared in inches.
    fn is_in_inches(&self) -> bool {
        (self.scale / MM_PER_INCH - 1.0).abs() < EQUAL
    }

    /// The finding for files.
    pub fn record(&self) -> DiagnosisDeclaration {
        DiagnosisDeclaration::DepthScale {
            scale: self.scale,
            spacing_mm: DeclaredValue { declared: self.spacing_mm, fitting: self.fitting_spacing_mm() },
            unit_mm: DeclaredValue { declared: self.unit_mm, fitting: self.fitting_unit_mm() },
        }
    }
}

/// Depth is off by one length at all distances, which no unit explains.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error(
    "measured depth is {:.0} mm {} than the depth at which the images see the board, at near and far boards alike: it is not counted from the camera's \
     centre, or a constant was {}; correct every value of the depth images by it (D has no such constant; diagnose describes it as a function of z)",
    self.offset_mm.abs(),
    if self.offset_mm < 0.0 { "less" } else { "more" },
    if self.offset_mm < 0.0 { "subtracted" } else { "added" }
)]
pub struct DepthOffset {
    /// Median of measured depth less the depth at which the image sees the board, mm.
    pub offset_mm: f64,
}

/// Depth of some frames is many times that of the others.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "depth of {higher} of {frames} frames, such as {first_higher}, is {factor:.4} times that of the others, such as {first_lower}, against the boards that \
     the images show: they are in different units, or of different recordings; convert the depth of one kind, or make a dataset of each with its own depth.unit_mm"
)]
pub struct SeveralUnits {
    /// How many times.
    pub factor: f64,
    /// The number of frames with the larger values.
    pub higher: usize,
    /// The number of all frames with depth.
    pub frames: usize,
    /// The first of the frames with the larger values.
    pub first_higher: String,
    /// The first of the others.
    pub first_lower: String,
}

/// Refuses depth in two units: the scales of frames make two groups, each as narrow as a depth camera's error, far apart.
pub(super) fn check_one_unit(capture: &CameraFrames<SampledFrame>) -> Result<(), SeveralUnits> {
    /// Ratio of the scales of two frames of one group at most, and of neighbouring ones of different groups at least.
    const WITHIN: f64 = 1.3;
    const BETWEEN: f64 = 1.8;
    /// Fewer frames of a group may be those of other images.
    const FEWEST: usize = 3;
    let of_frame = |frame: &SampledFrame| Some((upper_median(&mut ratios(frame))?, frame.name.clone()));
    let mut scales: Vec<(f64, String)> = capture.frames.iter().filter_map(of_frame).filter(|s| s.0 > 0.0).collect();
    scales.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ratio = |low: usize, high: usize| scales[high].0 / scales[low].0;
    let Some(split) = (1..scales.len()).max_by(|a, b| ratio(a - 1, *a).total_cmp(&ratio(b - 1, *b))) else {
        return Ok(());
    };
    let last = scales.len() - 1;
    let are_groups = split >= FEWEST && scales.len() - split >= FEWEST;
    if !are_groups || ratio(split - 1, split) < BETWEEN || ratio(0, split - 1).max(ratio(split, last)) > WITHIN {
        return Ok(());
    }
    let (lower, higher) = scales.split_at(split);
    let middle = |group: &[(f64, String)]| group[group.len() / 2].0;
    let first = |group: &[(f64, String)]| group.iter().map(|(_, name)| name.clone()).min().unwrap_or_default();
    Err(SeveralUnits {
        factor: middle(higher) / middle(lower),
        higher: higher.len(),
        frames: scales.len(),
        first_higher: first(higher),
        first_lower: first(lower),
    })
}

/// The scale where it deviates from one by more than `most_deviation`, unless that is an offset.
pub fn implausible_scale(capture: &CameraFrames<SampledFrame>, most_deviation: f64) -> Option<ImplausibleScale> {
    let scale = depth_scale(capture).filter(|scale| (scale - 1.0).abs() > most_deviation)?;
    let unit_mm = capture.depth_unit_mm.unwrap_or(1.0);
    let implausible = ImplausibleScale { scale, spacing_mm: capture.target.spacing_mm, unit_mm };
    depth_offset(capture).is_none().then_some(implausible)
}

/// The offset of depth, where the scale is implausible and depth deviates far less from the boards with an offset instead.
pub(super) fn depth_offset(capture: &CameraFrames<SampledFrame>) -> Option<DepthOffset> {
    /// Deviation with an offset over that with a scale.
    const FAR_LESS: f64 = 1.0 / 3.0;
    let scale = depth_scale(capture).filter(|scale| (scale - 1.0).abs() > PLAUSIBLE_SCALE_DEVIATION)?;
    let pairs: Vec<[f64; 2]> = capture.frames.iter().flat_map(depths).collect();
    let offset_mm = upper_median(&mut pairs.iter().map(|[measured, board]| measured - board).collect::<Vec<_>>())?;
    let deviation = |expected: &dyn Fn(f64) -> f64| {
        upper_median(&mut pairs.iter().map(|[measured, board]| (measured - expected(*board)).abs()).collect::<Vec<_>>())
    };
    let [with_offset, with_scale] = [deviation(&|z| z + offset_mm)?, deviation(&|z| z * scale)?];
    (with_offset < FAR_LESS * with_scale).then_some(DepthOffset { offset_mm })
}

/// Whether nothing but a wrong declaration explains the scale.
pub(super) fn is_beyond_any_camera(capture: &CameraFrames<SampledFrame>) -> bool {
    depth_scale(capture).is_some_and(|scale| scale.max(1.0 / scale) > MOST_SCALE)
}

/// The cause of an implausible scale where the boards tell it, an offset, or a ratio of the declared lengths: the side of a tag
/// declared as the pitch.
pub(super) fn scale_hint(capture: &CameraFrames<SampledFrame>) -> Option<String> {
    if let Some(offset) = depth_offset(capture) {
        return Some(offset.to_string());
    }
    let ImplausibleScale { scale, .. } = implausible_scale(capture, PLAUSIBLE_SCALE_DEVIATION)?;
    let parts = capture.target.parts();
    let [part] = parts.as_slice() else { return None };
    let (Pattern::Aprilgrid { marker_mm } | Pattern::Charuco { marker_mm, .. }) = &part.board.pattern else {
        return None;
    };
    let spacing_mm = part.board.spacing_mm;
    let ratio = spacing_mm / marker_mm;
    ((scale / ratio - 1.0).abs() < EQUAL).then(|| {
        format!(
            "depth is {scale:.2} times what the images show, which is the ratio of spacing_mm and marker_mm: {spacing_mm} mm seems to be the side of a \
             tag; then write spacing_mm = {:.4}, marker_mm = {spacing_mm} under [board] in dataset.toml",
            spacing_mm * ratio
        )
    })
}

/// Median of measured depth over the depth of the board point that a sample sees; `None` without samples.
fn depth_scale(capture: &CameraFrames<SampledFrame>) -> Option<f64> {
    upper_median(&mut capture.frames.iter().flat_map(ratios).collect::<Vec<_>>())
}

/// Measured depth over the depth of the board point that a sample sees, of every sample of a frame.
fn ratios(frame: &SampledFrame) -> Vec<f64> {
    depths(frame).map(|[measured, board]| measured / board).filter(|ratio| ratio.is_finite()).collect()
}

/// Measured depth and the depth of the board point that a sample sees, mm, of every sample of a frame.
pub(super) fn depths(frame: &SampledFrame) -> impl Iterator<Item = [f64; 2]> {
    let board_depth_mm = |[x, y]: [f64; 2]| (frame.camera_from_board * Point3::new(x, y, 0.0)).z;
    frame.samples.iter().map(move |sample| [sample.depth_mm, board_depth_mm(sample.board_seed)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_usual_unit_is_named_where_it_fits() {
        let message = |scale: f64, unit_mm: f64| ImplausibleScale { scale, spacing_mm: 17.0, unit_mm }.to_string();
        // Depth in metres that was declared as millimetres, by a camera that measures 1 % too little.
        assert!(message(0.00099, 1.0).contains("metres has unit_mm = 1000"), "{}", message(0.00099, 1.0));
        assert!(message(5.03, 1.0).contains("5000 steps to a metre has unit_mm = 0.2"));
        assert!(!message(3.0, 1.0).contains("has unit_mm"));
    }

    #[cfg(feature = "simulate")]
    #[test]
    fn depth_in_two_units_is_told_from_frames_that_are_off() {
        use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

        use crate::calibrate::{CalibrateError, CameraOptions, calibrate_camera};
        let scaled = |factor: f64, count: usize| {
            let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 4);
            let mut capture = crate::simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
            for frame in capture.frames.iter_mut().rev().take(count) {
                frame.raw.depth_pixels_mut().iter_mut().for_each(|pixel| pixel.depth_mm *= factor);
            }
            calibrate_camera(&capture, &CameraOptions::default())
        };
        match scaled(5.0, 10) {
            Err(CalibrateError::Units(units)) => {
                assert!((units.factor - 5.0).abs() < 0.1 && units.higher == 10, "{units}");
            }
            other => panic!("{:?}", other.map(|_| ()).map_err(|e| e.to_string())),
        }
        // Of two frames it may be depth of other images, which are dropped.
        assert_eq!(scaled(5.0, 2).expect("a fit").foreign_depth.len(), 2);
    }

    #[cfg(feature = "simulate")]
    #[test]
    fn an_offset_is_told_from_a_scale() {
        use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

        use crate::calibrate::{CalibrateError, CameraOptions, calibrate_camera};
        let with = |change: fn(f64) -> f64| {
            let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 5);
            let mut capture = crate::simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
            let pixels = capture.frames.iter_mut().flat_map(|frame| frame.raw.depth_pixels_mut());
            pixels.for_each(|pixel| pixel.depth_mm = change(pixel.depth_mm));
            calibrate_camera(&capture, &CameraOptions::default())
        };
        let nearer = with(|mm| mm - 150.0).expect("a fit").capture;
        let offset_mm = depth_offset(&nearer).expect("an offset").offset_mm;
        assert!((offset_mm + 150.0).abs() < 10.0, "{offset_mm}");
        assert_eq!(implausible_scale(&nearer, PLAUSIBLE_SCALE_DEVIATION), None);
        assert!(matches!(with(|mm| mm + 700.0), Err(CalibrateError::Offset(_))));
        let scaled = with(|mm| 0.8 * mm).expect("a fit").capture;
        assert!(depth_offset(&scaled).is_none() && implausible_scale(&scaled, PLAUSIBLE_SCALE_DEVIATION).is_some());
    }
}
