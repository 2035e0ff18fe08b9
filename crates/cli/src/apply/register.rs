//! `apply --register`: depth and colour of a rig's cameras on each other's pixels, and coloured clouds in the frame of the rig.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use depthcal_calibration::observe::PlacedCamera;
use depthcal_calibration::observe::Taken;
use depthcal_correction::{Corrector, FrameContext, colours_of, depth_into};
use depthcal_io::{
    Calibration, Cloud, Dataset, DatasetCamera, DepthImage, Frame, RgbImage, read_gray, read_rgb, write_depth,
    write_rgb,
};
use depthcal_report::format::{count, percent};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::written::{CloudFormat, points_of};
use crate::common::read_cameras;
use crate::failure::{Failure, input};
use crate::progress::Progress;
use crate::session::Session;
use crate::voice::say;

/// The request of `apply --register`.
pub(super) struct RigRegister<'a> {
    pub(super) calibration: &'a Path,
    pub(super) record: &'a Calibration,
    /// Folders of datasets of the rig.
    pub(super) datasets: &'a [PathBuf],
    /// The camera in whose image depth is resampled, and whose colours depth pixels get.
    pub(super) target: &'a str,
    pub(super) cloud: Option<CloudFormat>,
    pub(super) out: &'a Path,
}

/// Counts of what was written.
#[derive(Debug, Default, Clone, Copy)]
struct Counts {
    frames: usize,
    holes: usize,
    pixels: usize,
    hidden: usize,
    points: usize,
}

impl Counts {
    fn add(&mut self, other: Self) {
        self.frames += other.frames;
        self.holes += other.holes;
        self.pixels += other.pixels;
        self.hidden += other.hidden;
        self.points += other.points;
    }
}

/// A camera with depth of the calibration and of the dataset.
struct DepthCamera<'a> {
    placed: &'a PlacedCamera,
    corrector: Corrector,
    unit_mm: f64,
    captured: &'a DatasetCamera,
    /// Time of its first frame, s: its pieces count from there, as they did when the calibration was fitted.
    first_s: f64,
}

/// Resamples the depth of every frame of every camera.
pub(super) fn register(asked: &RigRegister<'_>, session: &Session) -> Result<Value, Failure> {
    let cameras = read_cameras(asked.calibration, asked.record, &session.register)?;
    let known = || cameras.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
    let target = cameras.iter().find(|c| c.name == asked.target).ok_or_else(|| {
        let (file, name) = (asked.calibration.display(), asked.target);
        Failure::Input(format!("--register {name}: {file} has no such camera; it has {}", known()))
    })?;
    let mut total = Counts::default();
    for path in asked.datasets {
        let dataset = Dataset::open(path).map_err(input)?;
        if dataset.cameras.iter().all(DatasetCamera::is_unnamed) {
            return Err(Failure::Input(format!(
                "{}: --register takes datasets of the rig: folders whose dataset.toml has sections [cameras.NAME]",
                path.display()
            )));
        }
        let images: BTreeMap<&str, &Path> = dataset
            .cameras
            .iter()
            .filter(|camera| camera.name == target.name)
            .flat_map(|camera| &camera.frames)
            .filter_map(|frame| Some((frame.name.as_str(), frame.image.as_deref()?)))
            .collect();
        let with_depth = depth_cameras(asked, &dataset, &cameras)?;
        if with_depth.is_empty() {
            return Err(Failure::Input(format!(
                "{}: no camera of the calibration ({}) has depth here, so there is nothing to register",
                path.display(),
                known()
            )));
        }
        for camera in &with_depth {
            total.add(register_camera(asked, camera, target, &images)?);
        }
    }
    say!("written: {}", asked.out.display());
    Ok(json!({
        "frames": total.frames, "pixels": total.pixels, "without_depth": total.holes, "written": [asked.out],
    }))
}

/// The cameras of a dataset that have depth and are calibrated.
fn depth_cameras<'a>(
    asked: &RigRegister<'_>,
    dataset: &'a Dataset,
    cameras: &'a [PlacedCamera],
) -> Result<Vec<DepthCamera<'a>>, Failure> {
    let mut with_depth = Vec::new();
    for camera in &dataset.cameras {
        let placed = cameras.iter().find(|c| c.name == camera.name);
        if let (true, Some(placed), Some(unit_mm)) = (camera.has_depth(), placed, camera.unit_mm()) {
            let corrector = Corrector::new(&placed.camera)
                .map_err(|error| Failure::Input(format!("{}: {error}", asked.calibration.display())))?;
            let first_s = camera.frames.iter().filter_map(|f| f.metadata.timestamp_s).fold(f64::INFINITY, f64::min);
            with_depth.push(DepthCamera { placed, corrector, unit_mm, captured: camera, first_s });
        }
    }
    Ok(with_depth)
}

/// Resamples the depth of every frame of a camera; `images` are those of the target by the names of frames.
fn register_camera(
    asked: &RigRegister<'_>,
    camera: &DepthCamera<'_>,
    target: &PlacedCamera,
    images: &BTreeMap<&str, &Path>,
) -> Result<Counts, Failure> {
    let progress = Progress::new("registering", camera.captured.frames.len());
    let of_frames: Vec<Result<Counts, Failure>> = camera
        .captured
        .frames
        .par_iter()
        .map(|frame| {
            let counts = register_frame(asked, camera, target, frame, images.get(frame.name.as_str()).copied());
            progress.advance();
            counts
        })
        .collect();
    drop(progress);
    let mut counts = Counts::default();
    for of_frame in of_frames {
        counts.add(of_frame?);
    }
    let share = |part: usize, all: usize| percent(100.0 * part as f64 / all.max(1) as f64);
    say!(
        "{} in {}: {}; {} of the pixels without depth; {} of the points without colour",
        camera.placed.name,
        target.name,
        count(counts.frames, "frame"),
        share(counts.holes, counts.pixels),
        share(counts.hidden, counts.points)
    );
    Ok(counts)
}

fn register_frame(
    asked: &RigRegister<'_>,
    camera: &DepthCamera<'_>,
    target: &PlacedCamera,
    frame: &Frame,
    colour: Option<&Path>,
) -> Result<Counts, Failure> {
    let Some(path) = &frame.depth else { return Ok(Counts::default()) };
    let of_frame = |error: &dyn std::fmt::Display| Failure::Input(format!("{}: {error}", path.display()));
    let depth = camera.captured.read_depth(path).map_err(input)?;
    let amplitude = frame.image.as_deref().map(read_gray).transpose().map_err(input)?;
    let context = FrameContext {
        time_s: frame.metadata.timestamp_s.map_or(0.0, |t| t - camera.first_s),
        temperature_c: frame.metadata.temperature_c.unwrap_or(f64::NAN),
        quantities: frame.metadata.quantities(),
        amplitude: amplitude.as_ref().map(Into::into),
    };
    let points = points_of(&depth, camera.unit_mm, &camera.corrector, &context).map_err(|e| of_frame(&e))?;
    let taken = Taken {
        time_s: frame.metadata.timestamp_s.unwrap_or(f64::NAN),
        temperature_c: frame.metadata.temperature_c.unwrap_or(f64::NAN),
    };
    let placed = camera.placed.at(&taken);
    let target_from_camera = target.at(&taken).from(&placed);
    let registered = depth_into(&points, depth.width, &target.camera, &target_from_camera);
    let name = &camera.placed.name;
    let file = |folder: String| asked.out.join(folder).join(format!("{}.png", frame.name));
    let depth_mm = points.iter().map(|p| p[2]).collect::<Vec<f32>>();
    write_depth(file(name.clone()), &steps(&depth_mm, depth.width, camera.unit_mm)).map_err(input)?;
    let resampled = steps(&registered.depth_mm, registered.width, camera.unit_mm);
    write_depth(file(format!("{name}_in_{}", target.name)), &resampled).map_err(input)?;
    let measured = points.iter().filter(|p| !p[2].is_nan()).count();
    let mut counts =
        Counts { frames: 1, holes: registered.holes, pixels: registered.depth_mm.len(), hidden: 0, points: measured };
    let colours = match colour {
        Some(path) => {
            let image = read_rgb(path).map_err(input)?;
            if [image.width, image.height] != [target.camera.width, target.camera.height] {
                return Err(Failure::Input(format!(
                    "{}: the image has {}×{} px, but the calibration of {} is for {}×{} px",
                    path.display(),
                    image.width,
                    image.height,
                    target.name,
                    target.camera.width,
                    target.camera.height
                )));
            }
            let colours = colours_of(&points, &target.camera, &target_from_camera, &registered, &image);
            counts.hidden = measured - colours.iter().filter(|c| c.is_some()).count();
            let data = colours.iter().map(|c| c.unwrap_or_default()).collect();
            let on_depth = RgbImage { width: depth.width, height: depth.height, data };
            write_rgb(file(format!("{}_in_{name}", target.name)), &on_depth).map_err(input)?;
            Some(colours)
        }
        None => None,
    };
    if let Some(format) = asked.cloud {
        let seen = || (0..points.len()).filter(|i| !points[*i][2].is_nan());
        let in_rig = |i: usize| placed.in_rig(points[i].map(f64::from)).map(|c| c as f32);
        let cloud = Cloud {
            points: seen().map(in_rig).collect(),
            intensity: None,
            color: colours.map(|colours| seen().map(|i| colours[i].unwrap_or_default()).collect()),
        };
        let path = asked.out.join(name).join(format!("{}.{}", frame.name, format.extension()));
        format.write(&path, &cloud).map_err(input)?;
    }
    Ok(counts)
}

/// Depth in steps of a unit; 0 where there is none or where it does not fit.
fn steps(depth_mm: &[f32], width: usize, unit_mm: f64) -> DepthImage {
    let step = |z: &f32| {
        let steps = (f64::from(*z) / unit_mm).round();
        if steps > 0.0 && steps < 65535.0 { steps as u16 } else { 0 }
    };
    DepthImage { width, height: depth_mm.len() / width.max(1), data: depth_mm.iter().map(step).collect() }
}
