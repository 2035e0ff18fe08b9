//! The explanation of a rank-deficient adjustment: what the captures lack for the parameters that take part.

use depthcal_model::Camera;
use depthcal_solver::{CovarianceError, NullDirection};
use nalgebra::{Point3, Vector3};

use super::error::CalibrateError;
use super::undetermined::UndeterminedModel;
use crate::adjust::adjustment::Adjustment;
use crate::adjust::blocks::is_depth_only;
use crate::adjust::state::State;
use crate::observe::{AdjustableFrame, CameraFrames};

/// Fewer frames than this are too few to blame anything else, as a rule.
const FEW_FRAMES: usize = 6;
/// Largest angle between two boards below which they hardly show the focal length, degrees.
const HARDLY_TILTED_DEG: f64 = 15.0;
/// Farthest over nearest board below which offset and scale of depth look alike.
const NARROW_RANGE: f64 = 1.3;
/// Share of the way from the image's middle to its corner that markers have to reach for the lens.
const COVERED: f64 = 0.7;
/// Share of a combination's largest parameter, in parameters' typical deviations, from which on a parameter is named.
const NAMED_SHARE: f64 = 0.03;
/// A camera's extrinsics, as they are named.
const EXTRINSICS: &str = "camera_from_rig";

/// The error of a covariance; undetermined combinations with their explanation.
pub(super) fn explained<F: AdjustableFrame>(
    error: CovarianceError,
    state: &State<F>,
    adjustment: &Adjustment,
    with_depth: bool,
) -> CalibrateError {
    let CovarianceError::RankDeficient { directions } = error else { return error.into() };
    let named = Named::of(&directions, state, adjustment);
    let Some(concerned) = state.cameras.get(named.camera) else {
        return CovarianceError::RankDeficient { directions }.into();
    };
    let facts = Facts::of(&concerned.camera, &concerned.capture);
    let mut lacking: Vec<(String, &str)> = Vec::new();
    if facts.frames < FEW_FRAMES {
        lacking.push((format!("there are only {} usable frames", facts.frames), "ten frames or more"));
    }
    if named.in_image && facts.tilt_deg < HARDLY_TILTED_DEG {
        let reason = format!("the boards are parallel within {:.0}°", facts.tilt_deg);
        lacking.push((reason, "boards tilted by 20° to 45° about both axes"));
    }
    if named.in_image && facts.reach < COVERED {
        let percent = 100.0 * facts.reach;
        let reason = format!("markers reach only {percent:.0} % of the way to the image's corners");
        lacking.push((reason, "boards at all borders of the image"));
    }
    let [near, far] = facts.range_mm;
    if named.in_depth && with_depth && far < NARROW_RANGE * near {
        let reason = format!("all boards are {near:.0} mm to {far:.0} mm away");
        lacking.push((reason, "boards at the nearest and the farthest distance of use"));
    }
    if lacking.is_empty() {
        lacking.push(if named.parameters.is_empty() {
            ("their markers do not determine the board's pose".to_owned(), "images that show more of the board")
        } else {
            (
                "these parameters do the same to everything that was captured".to_owned(),
                "other distances, tilts and places",
            )
        });
    }
    let (reasons, captures) = lacking.into_iter().map(|(reason, remedy)| (reason, remedy.to_owned())).unzip();
    let Named { parameters, frames, .. } = named;
    let combinations = directions.len();
    CalibrateError::Undetermined(Box::new(UndeterminedModel { combinations, parameters, frames, reasons, captures }))
}

/// The names of what takes part in undetermined combinations.
#[derive(Default)]
struct Named {
    /// Number of the first camera whose parameters take part.
    camera: usize,
    parameters: Vec<String>,
    frames: Vec<String>,
    /// Whether parameters of lens or pinhole, or of depth, are among them.
    in_image: bool,
    in_depth: bool,
}

impl Named {
    fn of<F>(directions: &[NullDirection], state: &State<F>, adjustment: &Adjustment) -> Self {
        let mut named = Self::default();
        let prefix = |camera: usize| match state.cameras.len() {
            1 => String::new(),
            _ => format!("{}/", state.cameras[camera].name),
        };
        for direction in directions {
            // Of the parameters of one direction those count that move by a considerable part of what is usual for them.
            let moved = direction.components.iter().filter_map(|c| {
                let (camera, block) = adjustment.block_of(c.variable)?;
                let block = &state.cameras[camera].camera.blocks()[block];
                let parameter = block.parameters().get(c.component)?;
                Some((camera, block, parameter, c.value.abs() / parameter.scale))
            });
            let moved: Vec<_> = moved.collect();
            let largest = moved.iter().map(|m| m.3).fold(0.0, f64::max);
            for (camera, block, parameter, _) in moved.iter().filter(|m| m.3 > NAMED_SHARE * largest) {
                let is_field = block.piece().is_some_and(|p| p.field().is_some());
                let name =
                    if is_field { block.name().to_owned() } else { format!("{}.{}", block.name(), parameter.name) };
                if named.parameters.is_empty() {
                    named.camera = *camera;
                }
                named.in_depth |= is_depth_only(block);
                named.in_image |= !is_depth_only(block);
                add_once(&mut named.parameters, prefix(*camera) + &name);
            }
            if moved.is_empty() {
                for c in &direction.components {
                    if let Some(frame) = adjustment.frame_of(c.variable) {
                        add_once(&mut named.frames, state.frames[frame].name.clone());
                    } else if let Some(camera) = adjustment.extrinsics_of(c.variable) {
                        add_once(&mut named.parameters, prefix(camera) + EXTRINSICS);
                    }
                }
            }
        }
        named
    }
}

fn add_once(names: &mut Vec<String>, name: String) {
    if !names.contains(&name) {
        names.push(name);
    }
}

/// Extent of a capture: frames, tilts, distances and reach in the image.
struct Facts {
    frames: usize,
    /// Largest angle between two boards.
    tilt_deg: f64,
    /// Nearest and farthest board.
    range_mm: [f64; 2],
    /// How far from the image's middle the markers reach, as a share of the corners' distance.
    reach: f64,
}

impl Facts {
    fn of<F: AdjustableFrame>(camera: &Camera, capture: &CameraFrames<F>) -> Self {
        let normals: Vec<Vector3<f64>> = capture.poses().map(|p| p.rotation * Vector3::z()).collect();
        let pairs = normals.iter().enumerate().flat_map(|(i, a)| normals[..i].iter().map(move |b| a.angle(b)));
        let middle =
            capture.target.points().iter().fold(Vector3::zeros(), |m, p| {
                m + Vector3::new(p[0], p[1], 0.0) / capture.target.points().len() as f64
            });
        let depths = || capture.poses().map(|pose| (pose * Point3::from(middle)).z);
        let half = [camera.width, camera.height].map(|n| (n as f64 - 1.0) / 2.0);
        let markers = capture.frames.iter().flat_map(|f| f.posed().markers.iter());
        let reach = markers.map(|m| (m.pixel[0] - half[0]).hypot(m.pixel[1] - half[1])).fold(0.0, f64::max);
        Self {
            frames: capture.frames.len(),
            tilt_deg: pairs.fold(0.0, f64::max).to_degrees(),
            range_mm: [depths().fold(f64::INFINITY, f64::min), depths().fold(0.0, f64::max)],
            reach: reach / half[0].hypot(half[1]),
        }
    }
}
