//! The search over all alternatives to declared depth.

use depthcal_io::ImageError;
use depthcal_model::Camera;
use rayon::prelude::*;

use super::depth_alternative::{DepthAlternative, Turn};
use super::depth_cause::DepthCause;
use super::depth_points::{Deviation, FramePoints, deviation, trivial};
use super::registration::registration;
use crate::observe::{CameraFrames, PosedFrame};

/// Frames that are looked at, spread over the capture.
const FRAMES: usize = 16;
/// Declared depth within this relative deviation of the boards is not doubted.
const UNDOUBTED: f64 = 0.005;
/// An alternative is clearly better with this share of a deviation …
const CLEARLY: f64 = 1.0 / 3.0;
/// … and leaves at most this one: depth cameras before their calibration.
const MOST: f64 = 0.04;
/// Alternatives within this factor of each other fit alike.
const ALIKE: f64 = 1.5;
/// Least share of the points with a measurement.
const LEAST_COVERAGE: f64 = 0.15;
/// Relative deviation from which on depth contradicts the boards, whatever its scale.
const CONTRADICTS: f64 = 0.08;

/// Depth as declared, held against the boards that the images show.
#[derive(Debug, Clone, PartialEq)]
pub enum DepthFinding {
    /// There is nothing to say against it.
    Fits,
    /// It contradicts the boards, and this is why.
    Cause(DepthCause),
    /// It contradicts the boards by this relative deviation, and no alternative fits.
    Unexplained(f64),
}

/// Holds depth as it is declared against the boards that the images show and, where it deviates, tries all alternatives.
///
/// # Errors
///
/// [`ImageError`] where a depth image has become unreadable.
pub fn examine_depth(capture: &CameraFrames<PosedFrame>, camera: &Camera) -> Result<DepthFinding, ImageError> {
    let with_depth: Vec<usize> =
        (0..capture.frames.len()).filter(|i| capture.frames[*i].depth_image().is_some()).collect();
    let step = with_depth.len().div_ceil(FRAMES).max(1);
    let chosen: Vec<usize> = with_depth.into_iter().step_by(step).collect();
    if chosen.is_empty() {
        return Ok(DepthFinding::Fits);
    }
    let points = |frames: &[isize], turns: &[Turn]| -> Result<Vec<FramePoints>, ImageError> {
        chosen.par_iter().map(|number| FramePoints::of(capture, camera, *number, frames, turns)).collect()
    };
    let unit_mm = capture.depth_unit_mm.unwrap_or(1.0);
    let declared = deviation(&points(&[0], &[Turn::Upright])?, unit_mm, DepthAlternative::DECLARED);
    if declared.is_some_and(|declared| declared.relative <= UNDOUBTED) {
        return Ok(DepthFinding::Fits);
    }
    let frames = points(&DepthAlternative::FRAMES, &Turn::ALL)?;
    let limit = declared.map_or(f64::INFINITY, |declared| declared.relative);
    let spacing_mm = capture.target.spacing_mm;
    if let Some((alternative, deviation)) = best(&frames, unit_mm, limit) {
        return Ok(DepthFinding::Cause(DepthCause::Other { alternative, declared, deviation, unit_mm, spacing_mm }));
    }
    if let Some(registration) = registration(capture, camera, &chosen, unit_mm, limit)? {
        return Ok(DepthFinding::Cause(DepthCause::OtherGrid { registration, declared }));
    }
    let in_scale = declared.map_or(f64::INFINITY, |declared| declared.relative_in_scale);
    Ok(if in_scale > CONTRADICTS { DepthFinding::Unexplained(in_scale) } else { DepthFinding::Fits })
}

/// The alternative that fits clearly better than the declaration, whose deviation is given, and than all others.
fn best(frames: &[FramePoints], unit_mm: f64, declared: f64) -> Option<(DepthAlternative, Deviation)> {
    let limit = MOST.min(CLEARLY * declared).min(CLEARLY * trivial(frames));
    let fitted: Vec<(DepthAlternative, Deviation)> = DepthAlternative::all()
        .filter(|alternative| *alternative != DepthAlternative::DECLARED)
        .filter_map(|alternative| Some((alternative, deviation(frames, unit_mm, alternative)?)))
        .filter(|(_, deviation)| deviation.relative <= limit && deviation.coverage >= LEAST_COVERAGE)
        .collect();
    let least = fitted.iter().map(|(_, deviation)| deviation.relative).fold(f64::INFINITY, f64::min);
    let alike: Vec<_> = fitted.into_iter().filter(|(_, d)| d.relative <= ALIKE * least).collect();
    let faults = alike.iter().map(|(alternative, _)| alternative.faults()).min()?;
    let mut simplest = alike.into_iter().filter(|(alternative, _)| alternative.faults() == faults);
    match (simplest.next(), simplest.next()) {
        (Some(only), None) => Some(only),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use depthcal_io::{DepthFrame, DepthValues, MarkerObservation};
    use depthcal_model::{Pattern, Target};
    use nalgebra::{Isometry3, Point3, Vector3};

    use super::super::depth_alternative::Quantity;
    use super::*;
    use crate::observe::{DetectedFrame, MeasuredDepth, RawFrame};

    const SIDE: usize = 320;
    const FOCAL_PX: f64 = 300.0;
    const FRAMES: usize = 8;

    fn camera() -> Camera {
        let centre = (SIDE as f64 - 1.0) / 2.0;
        Camera::new(SIDE, SIDE, [FOCAL_PX, FOCAL_PX, centre, centre, 0.0], Vec::new())
    }

    fn pose(i: usize) -> Isometry3<f64> {
        let wave = |k: f64| (k * (i as f64 + 1.0)).sin();
        let tilt = Vector3::new(0.5 * wave(2.3), 0.5 * wave(3.1), 0.2 * wave(1.7));
        Isometry3::new(Vector3::new(60.0 * wave(4.0) - 80.0, 60.0 * wave(5.0) - 60.0, 450.0 + 250.0 * wave(1.3)), tilt)
    }

    /// Depth of the boards in whole millimetres, before a wall; `spoil` gives the value of a pixel (u, v) of frame i from the
    /// depth of all pixels of all frames.
    fn capture(
        spoil: impl Fn(&dyn Fn(usize, usize, usize) -> f64, usize, usize, usize) -> f64,
    ) -> CameraFrames<PosedFrame> {
        let target = Target { pattern: Pattern::Chessboard, columns: 9, rows: 7, spacing_mm: 20.0 };
        let camera = camera();
        let depth_mm = |i: usize, u: usize, v: usize| {
            let ray = camera.ray([u as f64, v as f64], 0.0).expect("a pinhole");
            let board_from_camera = pose(i).inverse();
            let (origin, through) =
                (board_from_camera * Point3::origin(), board_from_camera * Point3::new(ray[0], ray[1], 1.0));
            let z = origin.z / (origin.z - through.z);
            let p = origin + (through - origin) * z;
            let is_board = z > 0.0 && (-30.0..190.0).contains(&p.x) && (-30.0..150.0).contains(&p.y);
            if is_board { z } else { 2000.0 }
        };
        let frame = |i: usize| {
            let steps =
                (0..SIDE * SIDE).map(|k| spoil(&depth_mm, i, k % SIDE, k / SIDE).round().clamp(0.0, 65535.0) as u16);
            let depth = DepthFrame { width: SIDE, height: SIDE, values: DepthValues::Steps(steps.collect()) };
            let marker = |index: usize| {
                let [x, y] = target.point(index);
                let pixel = camera.project(&(pose(i) * Point3::new(x, y, 0.0)).coords).expect("in front");
                MarkerObservation { index, pixel, std_px: 1.0 }
            };
            let raw =
                RawFrame { name: i.to_string(), depth: MeasuredDepth::Image(depth.into()), ..RawFrame::default() };
            let markers = (0..target.len()).map(marker).collect();
            let detected = DetectedFrame { raw, markers, ..DetectedFrame::default() };
            PosedFrame { detected, camera_from_board: pose(i) }
        };
        CameraFrames {
            name: "spoiled".to_owned(),
            target: target.clone(),
            width: SIDE,
            height: SIDE,
            depth_unit_mm: Some(1.0),
            disparity: None,
            technology: None,
            frames: (0..FRAMES).map(frame).collect(),
            dropped: Vec::new(),
        }
    }

    fn finding(spoil: impl Fn(&dyn Fn(usize, usize, usize) -> f64, usize, usize, usize) -> f64) -> DepthFinding {
        examine_depth(&capture(spoil), &camera()).expect("images in memory")
    }

    fn alternative(finding: &DepthFinding) -> Option<(DepthAlternative, f64)> {
        match finding {
            DepthFinding::Cause(DepthCause::Other { alternative, deviation, .. }) => {
                Some((*alternative, deviation.scale))
            }
            _ => None,
        }
    }

    #[test]
    fn every_turn_is_named() {
        let last = SIDE - 1;
        for turn in Turn::ALL {
            let spoiled = finding(|depth, i, u, v| match turn {
                Turn::Upright => depth(i, u, v),
                Turn::LeftRight => depth(i, last - u, v),
                Turn::UpDown => depth(i, u, last - v),
                Turn::HalfTurn => depth(i, last - u, last - v),
                Turn::Clockwise => depth(i, v, last - u),
                Turn::Anticlockwise => depth(i, last - v, u),
                Turn::Transposed => depth(i, v, u),
                Turn::TransposedHalfTurn => depth(i, last - v, last - u),
            });
            let expected = (turn != Turn::Upright).then_some(DepthAlternative { turn, ..DepthAlternative::DECLARED });
            assert_eq!(alternative(&spoiled).map(|(alternative, _)| alternative), expected, "{spoiled:?}");
        }
    }

    #[test]
    fn every_quantity_is_named() {
        let centre = (SIDE as f64 - 1.0) / 2.0;
        for quantity in Quantity::ALL {
            let spoiled = finding(|depth, i, u, v| {
                let z = depth(i, u, v);
                let [x, y] = [u, v].map(|c| (c as f64 - centre) / FOCAL_PX);
                match quantity {
                    Quantity::Depth => z,
                    Quantity::Range => z * (1.0 + x * x + y * y).sqrt(),
                    Quantity::ExchangedBytes => f64::from((z.round() as u16).swap_bytes()),
                    Quantity::Disparity => 1090.0 - 348_000.0 / z,
                }
            });
            let expected =
                (quantity != Quantity::Depth).then_some(DepthAlternative { quantity, ..DepthAlternative::DECLARED });
            assert_eq!(alternative(&spoiled).map(|(alternative, _)| alternative), expected, "{spoiled:?}");
        }
    }

    #[test]
    fn depth_of_the_frame_before_or_after_is_named() {
        for frame in [-1, 1] {
            let spoiled = finding(|depth, i, u, v| {
                let shown = (i as isize + frame).clamp(0, FRAMES as isize - 1) as usize;
                depth(shown, u, v)
            });
            let expected = DepthAlternative { frame, ..DepthAlternative::DECLARED };
            assert_eq!(alternative(&spoiled).map(|(alternative, _)| alternative), Some(expected), "{spoiled:?}");
            let text = expected.to_string();
            assert_eq!(text.contains("frame before"), frame < 0, "{text}");
        }
    }

    #[test]
    fn two_faults_and_a_unit_are_named_together() {
        let spoiled = finding(|depth, i, u, v| {
            let shown = (i + 1).min(FRAMES - 1);
            4.0 * depth(shown, SIDE - 1 - u, v)
        });
        let (alternative, scale) = alternative(&spoiled).expect("a cause");
        assert_eq!((alternative.turn, alternative.frame), (Turn::LeftRight, 1));
        assert!((scale - 4.0).abs() < 0.05, "{scale}");
        let DepthFinding::Cause(cause) = spoiled else { unreachable!("an alternative has a cause") };
        let text = cause.to_string();
        assert!(text.contains("unit_mm") && text.contains("0.25"), "{text}");
    }

    #[test]
    fn another_grid_is_named() {
        let centre = (SIDE as f64 - 1.0) / 2.0;
        let spoiled = finding(|depth, i, u, v| {
            let [x, y] = [(u, 28.0), (v, -20.0)].map(|(c, shift)| centre + (c as f64 - shift - centre) / 0.55);
            let is_inside = [x, y].iter().all(|c| (0.0..SIDE as f64 - 1.0).contains(c));
            if is_inside { depth(i, x.round() as usize, y.round() as usize) } else { 0.0 }
        });
        let DepthFinding::Cause(DepthCause::OtherGrid { registration, .. }) = spoiled else { panic!("{spoiled:?}") };
        assert!((registration.ratio - 0.55).abs() < 0.03, "{registration:?}");
    }

    /// Tilted boards show 0.5 to 1 % of such grids. A grid that is off by some pixels only is an error of the camera.
    #[test]
    fn a_grid_of_nearly_the_same_size_is_named() {
        let centre = (SIDE as f64 - 1.0) / 2.0;
        let with = |ratio: f64, shift: f64| {
            finding(|depth, i, u, v| {
                let [x, y] = [(u, shift), (v, 0.0)].map(|(c, shift)| centre + (c as f64 - shift - centre) / ratio);
                let is_inside = [x, y].iter().all(|c| (0.0..SIDE as f64 - 1.0).contains(c));
                if is_inside { depth(i, x.round() as usize, y.round() as usize) } else { 0.0 }
            })
        };
        for ratio in [0.8, 0.85, 1.15, 1.25] {
            let DepthFinding::Cause(DepthCause::OtherGrid { registration, .. }) = with(ratio, 0.0) else {
                panic!("{ratio}: {:?}", with(ratio, 0.0))
            };
            assert!((registration.ratio / ratio - 1.0).abs() < 0.04, "{ratio}: {registration:?}");
        }
        assert_eq!(with(1.0, 4.0), DepthFinding::Fits);
    }

    /// Right depth, errors of a camera, units, and depth of nothing: none of them has another cause.
    #[test]
    fn no_cause_is_named_where_there_is_none() {
        for scale in [1.0, 0.25, 25.4] {
            assert_eq!(finding(|depth, i, u, v| scale * depth(i, u, v)), DepthFinding::Fits);
        }
        let inverse_error = finding(|depth, i, u, v| 1.0 / (1.03 / depth(i, u, v) - 1e-4));
        let ripple = finding(|depth, i, u, v| depth(i, u, v) + 15.0 * (depth(i, u, v) / 40.0).sin());
        assert_eq!((inverse_error, ripple), (DepthFinding::Fits, DepthFinding::Fits));
        let noise = finding(|_, i, u, v| 400.0 + ((i * 7919 + u * 104_729 + v * 1_299_709) % 997) as f64);
        assert!(matches!(noise, DepthFinding::Unexplained(_)), "{noise:?}");
    }
}
