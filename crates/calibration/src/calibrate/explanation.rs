//! The explanation of a rank-deficient adjustment: what the captures lack for the parameters that take part.

use depthcal_model::{Block, Camera};
use depthcal_solver::{CovarianceError, NullDirection};
use nalgebra::{Point3, Vector3};

use super::error::CalibrateError;
use super::undetermined::UndeterminedModel;
use crate::adjust::blocks::is_depth_only;
use crate::observe::{AdjustableFrame, Capture};

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

/// The error of a covariance; undetermined combinations with their explanation.
pub(super) fn explained<F: AdjustableFrame>(
    error: CovarianceError,
    camera: &Camera,
    capture: &Capture<F>,
    with_depth: bool,
) -> CalibrateError {
    let CovarianceError::RankDeficient { directions } = error else { return error.into() };
    let named = Named::of(&directions, camera);
    let facts = Facts::of(camera, capture);
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
    parameters: Vec<String>,
    frames: Vec<String>,
    /// Whether parameters of lens or pinhole, or of depth, are among them.
    in_image: bool,
    in_depth: bool,
}

impl Named {
    fn of(directions: &[NullDirection], camera: &Camera) -> Self {
        let mut named = Self::default();
        for direction in directions {
            // Of the parameters of one direction those count that move by a considerable part of what is usual for them.
            let found = direction.components.iter().filter_map(|c| {
                let block = camera.blocks().iter().find(|b| belongs(&c.label, b))?;
                let parameter = block.parameters().get(c.component)?;
                Some((block, parameter, c.value.abs() / parameter.scale))
            });
            let found: Vec<_> = found.collect();
            let largest = found.iter().map(|f| f.2).fold(0.0, f64::max);
            for (block, parameter, _) in found.iter().filter(|f| f.2 > NAMED_SHARE * largest) {
                let is_field = block.piece().is_some_and(|p| p.field().is_some());
                let name =
                    if is_field { block.name().to_owned() } else { format!("{}.{}", block.name(), parameter.name) };
                named.in_depth |= is_depth_only(block);
                named.in_image |= !is_depth_only(block);
                if !named.parameters.contains(&name) {
                    named.parameters.push(name);
                }
            }
            if found.is_empty() {
                let poses = direction.components.iter().filter_map(|c| c.label.strip_prefix("pose of "));
                for frame in poses {
                    if !named.frames.iter().any(|f| f == frame) {
                        named.frames.push(frame.to_owned());
                    }
                }
            }
        }
        named
    }
}

/// Whether a variable's label is that of a block or of one of its nodes, as the adjustment labels them.
fn belongs(label: &str, block: &Block) -> bool {
    label == block.name() || label.starts_with("node ") && label.ends_with(&format!(" of {}", block.name()))
}

/// What captures offer.
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
    fn of<F: AdjustableFrame>(camera: &Camera, capture: &Capture<F>) -> Self {
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
