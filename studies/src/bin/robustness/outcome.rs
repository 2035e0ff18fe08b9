//! A spoiled capture as a dataset, and what becomes of it.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use depthcal::calibration::calibrate::{
    CalibratedCamera, CameraOptions, PLAUSIBLE_SCALE_DEVIATION, calibrate_camera, implausible_scale,
};
use depthcal::calibration::diagnose::{CameraDiagnoseOptions, diagnose_camera};
use depthcal::calibration::judge::camera::evaluate_camera;
use depthcal::calibration::load::{LoadOptions, Loaded, declared_camera, load};
use depthcal::calibration::observe::CameraFrames;
use depthcal::calibration::simulated;
use depthcal::io::{DepthImage, GrayImage, Verdict, write_depth, write_gray};
use depthcal_simulate::{PointOptions, RenderedFrame};
use depthcal_statistics::{chi_squared_tail, median};
use nalgebra::{DMatrix, DVector};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::Failure;
use crate::case::{Case, Declared, Fault, Spoiled};
use crate::rendered::Rendered;
use crate::spoil;

/// Tail of three standard deviations.
const LEVEL: f64 = 0.0027;
/// Errors of markers, px.
const MARKER_PX: std::ops::Range<f64> = 2.0..20.0;
/// Unit of the rendered depth, mm.
const DEPTH_UNIT_MM: f64 = 0.125;
/// Depth at random, mm.
const DEPTH_MM: std::ops::Range<f64> = 300.0..3000.0;

/// Results of the commands on a capture.
#[derive(Debug, Default)]
pub struct Outcome {
    /// An error instead of a calibration.
    pub refused: bool,
    pub right: bool,
    pub calibrate_warns: bool,
    pub diagnose_warns: bool,
    /// Frames that were left out.
    pub dropped: usize,
    /// Markers that were left out as wrong.
    pub wrong_markers: usize,
    /// Depth error on other frames, mm.
    pub depth_rms_mm: Option<f64>,
}

impl Outcome {
    /// `usual` is what becomes of the capture where nothing is wrong: a frame or a marker more that is left out, with words, is a
    /// warning.
    pub fn of(rendered: &Rendered, case: &Case, usual: &Self) -> Result<Self, Failure> {
        let folder = tempfile::tempdir()?;
        let mut rng = ChaCha8Rng::seed_from_u64(rendered.seed);
        write(rendered, case.fault, folder.path(), &mut rng)?;
        let refused = |error: &dyn std::fmt::Display| {
            eprintln!("{}, {}: refused: {error}", case.name, rendered.seed);
            Self { refused: true, calibrate_warns: true, diagnose_warns: true, ..Self::default() }
        };
        let loaded = load(folder.path(), &LoadOptions { cache: None, ..LoadOptions::default() });
        let mut loaded = match loaded.and_then(Loaded::into_only_camera) {
            Ok(loaded) => loaded,
            Err(error) => return Ok(refused(&error)),
        };
        if let Fault::Markers(share) = case.fault {
            move_markers(&mut loaded.capture, share, &mut rng);
        }
        let capture = &loaded.capture;
        let options = CameraOptions::default();
        let start = declared_camera(&loaded.declared, capture.width, capture.height, None, &options.register);
        let start = match start {
            Ok(start) => start,
            Err(error) => return Ok(refused(&error)),
        };
        let options = CameraOptions { camera: start, ..options };
        let fit = match calibrate_camera(capture, &options) {
            Ok(fit) => fit,
            Err(error) => return Ok(refused(&error)),
        };
        let contradicts = loaded.circle_diameter.is_some_and(|measured| measured.contradicts_declaration());
        let dropped = fit.capture.dropped.len();
        let wrong_markers = fit.capture.frames.iter().map(|frame| frame.wrong_markers.len()).sum();
        let truth = Truth::of(rendered, case.fault)?;
        let is_off = implausible_scale(&fit.capture, PLAUSIBLE_SCALE_DEVIATION).is_some();
        let mut outcome = Self {
            right: truth.is_hit_by(&fit),
            calibrate_warns: contradicts || is_off || dropped > usual.dropped || wrong_markers > usual.wrong_markers,
            dropped,
            wrong_markers,
            depth_rms_mm: evaluate_camera(&fit.camera, &truth.other).record().depth_rms_mm.map(|error| error.after),
            ..Self::default()
        };
        let defaults = CameraDiagnoseOptions::default();
        let options = CameraOptions { camera: options.camera, ..defaults.calibrate.clone() };
        let options = CameraDiagnoseOptions { formulas: false, calibrate: options, ..defaults };
        let words = match diagnose_camera(capture, None, &options) {
            Err(error) => {
                outcome.diagnose_warns = true;
                error.to_string()
            }
            Ok(d) => {
                let (bad, wrong) = (d.bad_frames.len(), d.declarations.len());
                outcome.diagnose_warns =
                    outcome.calibrate_warns || bad > 0 || wrong > 0 || d.verdict != Verdict::Adequate;
                format!("{:?}, {bad} bad frames, {wrong} declarations", d.verdict)
            }
        };
        eprintln!("{}, {}: {outcome:?}, {words}", case.name, rendered.seed);
        Ok(outcome)
    }

    fn is_silent(&self, warns: bool) -> bool {
        !self.right && !warns
    }
}

/// A row of the table.
pub fn row(name: &str, outcomes: &[Outcome], plain: &[Outcome]) -> String {
    let count = |what: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| what(o)).count();
    let of_plain = |(o, plain): (&Outcome, &Outcome)| Some(o.depth_rms_mm? / plain.depth_rms_mm?);
    let mut ratios: Vec<f64> = outcomes.iter().zip(plain).filter_map(of_plain).collect();
    let worst = ratios.iter().copied().fold(f64::NAN, f64::max);
    let middle = median(&mut ratios);
    format!(
        "| {name} | {} | {} | {} | {} | {} | {} | {} | {middle:.3}, {worst:.3} |",
        outcomes.len(),
        count(&|o| o.refused),
        count(&|o| o.right),
        count(&|o| o.calibrate_warns),
        count(&|o| o.diagnose_warns),
        count(&|o| o.is_silent(o.calibrate_warns)),
        count(&|o| o.is_silent(o.calibrate_warns || o.diagnose_warns)),
    )
}

/// Writes the spoiled frames as a dataset.
fn write(rendered: &Rendered, fault: Fault, folder: &Path, rng: &mut ChaCha8Rng) -> Result<(), Failure> {
    for name in ["image", "depth"] {
        fs::create_dir_all(folder.join(name))?;
    }
    for frame in spoiled(rendered, fault, rng) {
        let file = format!("{}.png", frame.name);
        let RenderedFrame { width, height, image, depth, .. } = frame;
        write_gray(folder.join("image").join(&file), &GrayImage { width, height, data: image, bits: 8 })?;
        write_depth(folder.join("depth").join(&file), &DepthImage { width, height, data: depth })?;
    }
    fs::write(folder.join("dataset.toml"), declaration(rendered, fault))?;
    Ok(())
}

/// The frames with what is wrong with them.
fn spoiled(rendered: &Rendered, fault: Fault, rng: &mut ChaCha8Rng) -> Vec<RenderedFrame> {
    let mut frames = rendered.frames.clone();
    match fault {
        Fault::Frames(spoiled, share) => {
            let mut places: Vec<usize> = (0..frames.len()).collect();
            places.shuffle(rng);
            places.truncate((share * frames.len() as f64).round() as usize);
            for (k, &i) in places.iter().enumerate() {
                let (camera, pose) = (&rendered.truth.camera, &rendered.truth.frames[i].pose);
                let name = frames[i].name.clone();
                match spoiled {
                    Spoiled::WrongBoard => frames[i] = rendered.larger[i].clone(),
                    Spoiled::PartlyOutside => frames[i] = rendered.outside[i].clone(),
                    Spoiled::Glare => {
                        let place = [rng.random_range(20.0..80.0), rng.random_range(20.0..150.0)];
                        spoil::glare(&mut frames[i], camera, pose, place);
                    }
                    Spoiled::MotionBlur => spoil::blur(&mut frames[i]),
                    Spoiled::Saturation => spoil::saturate(&mut frames[i]),
                    Spoiled::SwappedDepth => {
                        frames[i].depth = rendered.frames[places[(k + 1) % places.len()]].depth.clone();
                    }
                    Spoiled::RollingExposure => spoil::roll(&mut frames[i]),
                }
                frames[i].name = name;
            }
        }
        Fault::Depth(share) => {
            for value in frames.iter_mut().flat_map(|frame| &mut frame.depth) {
                if rng.random_bool(share) {
                    *value = (rng.random_range(DEPTH_MM) / DEPTH_UNIT_MM) as u16;
                }
            }
        }
        Fault::Holes(share) => {
            for value in frames.iter_mut().flat_map(|frame| &mut frame.depth) {
                if rng.random_bool(share) {
                    *value = 0;
                }
            }
        }
        Fault::Mirrored => frames.iter_mut().for_each(spoil::mirror),
        Fault::Nothing | Fault::Markers(_) | Fault::Declared(_) => {}
    }
    frames
}

/// The text of `dataset.toml`.
fn declaration(rendered: &Rendered, fault: Fault) -> String {
    let (mut spacing, mut diameter, mut unit, mut kind) = (1.0, 1.0, 1.0, "asymmetric-circles");
    let mut start = String::new();
    match fault {
        Fault::Declared(Declared::Spacing(factor)) => spacing = factor,
        Fault::Declared(Declared::Diameter(factor)) => diameter = factor,
        Fault::Declared(Declared::Unit(factor)) => unit = factor,
        Fault::Declared(Declared::Kind) => kind = "symmetric-circles",
        Fault::Declared(Declared::Start(factor)) => {
            let camera = &rendered.truth.camera;
            let [fx, fy] = camera.focal_px.map(|f| factor * f);
            let [cx, cy] = camera.centre_px.map(|c| factor * c);
            let _ = write!(start, "\n[camera]\nfx = {fx:?}\nfy = {fy:?}\ncx = {cx:?}\ncy = {cy:?}\n");
        }
        _ => {}
    }
    let board = &rendered.truth.board;
    format!(
        "[board]\nkind = \"{kind}\"\ncolumns = {}\nrows = {}\nspacing_mm = {:?}\ncircle_diameter_mm = {:?}\n\n\
         [frames]\nimage = \"image/*.png\"\ndepth = \"depth/*.png\"\n\n[depth]\nunit_mm = {:?}\n{start}",
        board.columns,
        board.rows,
        spacing * board.spacing_mm,
        diameter * board.circle_diameter_mm().unwrap_or_default(),
        unit * DEPTH_UNIT_MM,
    )
}

/// A share of the markers is wrong.
fn move_markers(capture: &mut CameraFrames, share: f64, rng: &mut ChaCha8Rng) {
    for marker in capture.frames.iter_mut().flat_map(|frame| &mut frame.markers) {
        if rng.random_bool(share) {
            let (sine, cosine) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
            let distance = rng.random_range(MARKER_PX);
            marker.pixel = [marker.pixel[0] + distance * cosine, marker.pixel[1] + distance * sine];
        }
    }
}

/// The truth that a fit is held against.
struct Truth {
    /// The parameters.
    theta: Vec<f64>,
    /// Other frames.
    other: CameraFrames,
}

impl Truth {
    fn of(rendered: &Rendered, fault: Fault) -> Result<Self, Failure> {
        let camera = &rendered.truth.camera;
        let mut other = simulated::capture(&rendered.other.observe_points(&PointOptions::default())?);
        if fault != Fault::Mirrored {
            return Ok(Self { theta: simulated::true_theta(camera), other });
        }
        // A mirrored image is that of a mirrored camera.
        let last = camera.width as f64 - 1.0;
        let mut mirrored = *camera;
        mirrored.centre_px[0] = last - camera.centre_px[0];
        mirrored.skew_px = -camera.skew_px;
        mirrored.lens[3] = -camera.lens[3];
        mirrored.depth[0] = -camera.depth[0];
        for frame in &mut other.frames {
            frame.markers.iter_mut().for_each(|marker| marker.pixel[0] = last - marker.pixel[0]);
            let pixels = frame.raw.depth_pixels_mut();
            pixels.iter_mut().for_each(|pixel| pixel.context.pixel[0] = last - pixel.context.pixel[0]);
        }
        Ok(Self { theta: simulated::true_theta(&mirrored), other })
    }

    /// Whether all free parameters together are within three standard deviations of it.
    fn is_hit_by(&self, fit: &CalibratedCamera) -> bool {
        let theta = fit.camera.theta();
        let Some(covariance) = fit.covariance.as_ref().filter(|_| theta.len() == self.theta.len()) else {
            return false;
        };
        let free: Vec<usize> = (0..theta.len()).filter(|i| covariance[(*i, *i)] > 0.0).collect();
        let error = DVector::from_iterator(free.len(), free.iter().map(|i| theta[*i] - self.theta[*i]));
        let of_free = DMatrix::from_fn(free.len(), free.len(), |i, j| covariance[(free[i], free[j])]);
        let squared = of_free.cholesky().map(|factor| error.dot(&factor.solve(&error)));
        squared.is_some_and(|squared| chi_squared_tail(squared, free.len()) > LEVEL)
    }
}
