//! Differences of calibrations whose truth is known.

use std::path::PathBuf;

use depthcal_io::{CAMERA, Calibration, CameraDifference, Difference, FileReference};
use depthcal_model::{Context, Register};
use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};
use depthcal_statistics::rms;
use rayon::prelude::*;

use super::{DiffSide, Differed, GivenCamera, TaskError};
use crate::calibrate::{Calibrated, CameraOptions, calibrate_camera};
use crate::calibration_record::calibration_record;
use crate::camera_record::camera_from_record;
use crate::judge::evaluate::evaluate_fitted;
use crate::simulated;

/// A calibration of a simulated capture of `camera`.
fn calibration(camera: CameraTruth, seed: u64) -> Calibration {
    let options = PointOptions { depth_samples: 150, ..PointOptions::default() };
    let simulation = Simulation::new(camera, Kind::General(1), &[], seed).frames(16);
    let capture = simulated::capture(&simulation.observe_points(&options).unwrap());
    let full = CameraOptions { lens: "brown-conrady:full".to_owned(), ..CameraOptions::default() };
    let fit = Calibrated::of_camera(CAMERA, calibrate_camera(&capture, &full).unwrap());
    let dataset = FileReference { path: format!("capture{seed}"), digest: format!("{seed:x}") };
    calibration_record(&fit, &evaluate_fitted(&fit), dataset, None)
}

fn side(name: &str, calibration: &Calibration) -> DiffSide {
    let given = GivenCamera::Calibration(PathBuf::from(name), Box::new(calibration.clone()));
    DiffSide { name: name.to_owned(), given, register: Register::builtin() }
}

fn diff(first: &Calibration, second: &Calibration) -> Result<Difference, TaskError> {
    Ok(Differed::new(&[side("first", first), side("second", second)], None, "--size")?.record)
}

fn only_camera(difference: &Difference) -> &CameraDifference {
    assert_eq!(difference.cameras.len(), 1);
    &difference.cameras[0]
}

/// True difference of corrected depth in every cell, mm; NaN beyond the region in which the true lens is one-to-one.
fn true_difference([first, second]: [CameraTruth; 2], like: &Calibration, d: &CameraDifference, z: f64) -> Vec<f64> {
    let cameras = [first, second].map(|truth| {
        camera_from_record(&like.camera, &Register::builtin()).unwrap().with_theta(&simulated::true_theta(&truth))
    });
    let cell = |i: usize| {
        let context = Context { pixel: d.pixel(i), ..Context::default() };
        let [a, b] = cameras
            .each_ref()
            .map(|camera| camera.correct(&context, 1.0, 1.0 / z).map_or(f64::NAN, |(_, rho)| 1.0 / rho));
        b - a
    };
    (0..d.columns * d.rows).map(cell).collect()
}

/// Pairs of captures of one camera, or of two that differ by 1.5·10⁻⁵/mm of inverse depth: differences scatter about the true
/// ones as their standard deviations say, equal cameras agree, and the planted offset is seen from some distance on.
#[test]
fn differences_are_the_true_ones_within_their_uncertainties() {
    let camera = CameraTruth::published(1).unwrap();
    let mut shifted = camera;
    shifted.depth[2] += 1.5e-5;
    let pairs: Vec<(Calibration, Calibration, Calibration)> = (0..10)
        .into_par_iter()
        .map(|i| {
            let [a, b] = [2 * i, 2 * i + 1].map(|seed| calibration(camera, 300 + seed));
            (a, b, calibration(shifted, 400 + i))
        })
        .collect();
    let (mut agreeing, mut disagreements) = (0, Vec::new());
    let (mut deviations, mut p_values) = (Vec::new(), Vec::new());
    for (a, b, of_shifted) in &pairs {
        let same = diff(a, b).unwrap();
        let d = only_camera(&same);
        let sizes = d.depth.iter().map(|d| ("depth", &d.size)).chain(d.projection.iter().map(|p| ("image", &p.size)));
        let differing: Vec<_> = sizes.filter(|(_, size)| size.differs).collect();
        agreeing += usize::from(differing.is_empty());
        disagreements.extend(differing.into_iter().map(|(name, size)| format!("{name}: {size:?}")));
        p_values.extend([d.depth[d.depth.len() / 2].size.p_value.unwrap(), d.projection[0].size.p_value.unwrap()]);
        assert!(same.common_frames == 0 && d.first.has_covariance && d.second.corrects_depth);

        let planted = diff(a, of_shifted).unwrap();
        let d = only_camera(&planted);
        let differing: Vec<bool> = d.depth.iter().map(|d| d.size.differs).collect();
        assert!(differing.is_sorted() && differing.last() == Some(&true), "seen beyond a distance: {differing:?}");
        for at in &d.depth {
            let truth = true_difference([camera, shifted], a, d, at.distance_mm);
            let cells = at.difference_mm.iter().zip(&at.std_dev_mm).zip(truth);
            let deviation =
                |((value, std), truth): ((&Option<f64>, &Option<f64>), f64)| Some(((*value)? - truth) / (*std)?);
            deviations.extend(cells.filter_map(deviation).filter(|d| d.is_finite()));
        }
    }
    assert!(deviations.len() > 20_000, "{}", deviations.len());
    // Ten pairs of some ten parameters: the mean square scatters by a quarter.
    let scatter = rms(deviations.iter().copied());
    // Chance makes one in a hundred disagree; standard deviations of 16 frames are a little too small.
    assert!(agreeing >= 9, "{agreeing} of 10 agree; {scatter}; {p_values:?}: {disagreements:#?}");
    assert!((0.6..1.5).contains(&scatter), "{scatter} standard deviations");
    let mean = p_values.iter().sum::<f64>() / p_values.len() as f64;
    assert!((0.25..0.75).contains(&mean), "mean p-value {mean}");
}

fn changed(calibration: &Calibration, piece: &str, parameter: &str, by: impl Fn(f64) -> f64) -> Calibration {
    let mut changed = calibration.clone();
    let piece = changed.camera.pieces.iter_mut().find(|p| p.name == piece).unwrap();
    let parameter = piece.parameters.iter_mut().find(|p| p.name == parameter).unwrap();
    parameter.value += by(parameter.std_dev.unwrap());
    changed
}

#[test]
fn what_was_changed_is_seen_where_it_acts() {
    let a = calibration(CameraTruth::published(1).unwrap(), 7);
    let none = diff(&a, &a).unwrap();
    assert_eq!(none.common_frames, 16);
    let d = only_camera(&none);
    assert!(d.depth.iter().all(|d| d.size.rms < 1e-9) && d.projection[0].size.rms < 1e-6);
    assert!(d.projection[0].rotation_rad.iter().all(|r| r.abs() < 1e-6), "{:?}", d.projection[0].rotation_rad);

    // A shift of the principal point is a rotation of all rays, but for its second order.
    let turned = diff(&a, &changed(&a, "pinhole", "cx", |_| 2.0)).unwrap();
    let p = &only_camera(&turned).projection[0];
    assert!((p.rotation_rad[1].abs() * 476.9 - 2.0).abs() < 0.2, "{:?}", p.rotation_rad);
    assert!(p.size.rms < 0.4, "{}", p.size.rms);

    // Radial distortion shows in the corners, and leaves corrected depth as it was but for the ray that D takes.
    let bent = diff(&a, &changed(&a, "brown_conrady", "k1", |std| 30.0 * std)).unwrap();
    let d = only_camera(&bent);
    let p = &d.projection[0];
    assert!(p.size.differs && p.distance_mm.is_none());
    let corner = p.du_px[0].unwrap().hypot(p.dv_px[0].unwrap());
    let middle = d.columns * (d.rows / 2) + d.columns / 2;
    assert!(corner > 5.0 * p.du_px[middle].unwrap().hypot(p.dv_px[middle].unwrap()), "{corner}");

    // A tilt of inverse depth along x: nearer on one side, farther on the other.
    let tilted = diff(&a, &changed(&a, "projective", "dx", |std| 20.0 * std)).unwrap();
    let d = only_camera(&tilted);
    let far = d.depth.last().unwrap();
    let row = d.columns * (d.rows / 2);
    let [left, right] = [row, row + d.columns - 1].map(|cell| far.difference_mm[cell].unwrap());
    assert!(far.size.differs && left * right < 0.0 && left.abs() > 1.0, "{left} and {right}");
    assert!(d.parameters.iter().any(|p| p.name == "projective.dx" && (p.second - p.first).abs() > 0.0));
}

#[test]
fn images_of_different_sizes_are_refused() {
    let a = calibration(CameraTruth::published(1).unwrap(), 8);
    let mut b = a.clone();
    b.camera.width = 320;
    let message = diff(&a, &b).unwrap_err().to_string();
    assert!(message.contains("640x480 px in first") && message.contains("320x480 px in second"), "{message}");
}
