//! The thesis' three estimators of D, with camera, lens and poses given by the images: linear least squares, iteratively
//! reweighted least squares, and nonlinear least squares on distances in space. The joint adjustment is the fourth.

mod linear;
mod nonlinear;

use depthcal_model::{Block, Camera, Target};
use nalgebra::{Isometry3, Vector3, Vector4};
use thiserror::Error;

use crate::board_region::{BoardPixel, BoardRegion, board_pixels};
use crate::calibrate::{Calibrated, Estimator, rms};
use crate::marker_depth::marker_inverse_depths;
use crate::observations::Frame;

pub use linear::{irls, linear};
pub use nonlinear::nonlinear;

/// Why an estimator gives no D.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EstimatorError {
    /// The estimator knows the projective model only.
    #[error(
        "the estimator '{estimator}' fits the model 'projective' and its subsets only, not '{model}': use --estimator joint"
    )]
    NotProjective {
        /// The estimator.
        estimator: &'static str,
        /// The model asked for.
        model: String,
    },
    /// Too few markers have depth.
    #[error("only {found} markers have valid depth around them, but {needed} are needed")]
    TooFewPoints {
        /// Markers with depth.
        found: usize,
        /// Markers needed.
        needed: usize,
    },
    /// All points in one plane, or otherwise degenerate.
    #[error(
        "the markers do not determine D (free: {free}): capture the board at several distances and tilts, or use a subset \
         such as projective:xw"
    )]
    Degenerate {
        /// The free parameters.
        free: String,
    },
}

/// A marker with depth: everything that the thesis' estimators use of it.
#[derive(Debug, Clone, Copy)]
pub struct MarkerPoint {
    /// Its defined position in the camera frame, mm.
    pub point_in_camera: Vector3<f64>,
    /// Ray of its image, undistorted (X/Z, Y/Z).
    pub ray: [f64; 2],
    /// Measured inverse depth there, 1/mm.
    pub inverse_depth: f64,
}

/// Markers of a frame with the depth measured at them, from the board pixels around (see [`board_pixels`]) under a camera
/// and a pose from the image. `None` where the depth around a marker is missing.
pub fn marker_points(
    frame: &Frame,
    pixels: &[BoardPixel],
    camera: &Camera,
    target: &Target,
    camera_from_board: &Isometry3<f64>,
) -> Vec<Option<MarkerPoint>> {
    let rays: Vec<(usize, [f64; 2])> =
        frame.markers.iter().map(|m| (m.index, camera.ray(m.pixel, 1e-3).unwrap_or([f64::NAN; 2]))).collect();
    let depths = marker_inverse_depths(target, &rays, pixels);
    rays.iter()
        .zip(depths)
        .map(|((index, ray), depth)| {
            let p = camera.board_point(target.point(*index));
            let point_in_camera = (camera_from_board * nalgebra::Point3::from(p)).coords;
            depth.map(|inverse_depth| MarkerPoint { point_in_camera, ray: *ray, inverse_depth })
        })
        .collect()
}

/// D = (dx, dy, dz, dw), held entries at their nominal values.
pub(crate) fn nominal() -> Vector4<f64> {
    Vector4::new(0.0, 0.0, 0.0, 1.0)
}

/// Fits D by one of the thesis' estimators, on top of a calibration from the images alone.
///
/// # Errors
///
/// [`EstimatorError`].
pub fn estimate(
    from_image: Calibrated,
    depth_blocks: Vec<Block>,
    estimator: Estimator,
) -> Result<Calibrated, EstimatorError> {
    let mut result = from_image;
    result.estimator = estimator;
    let model = depth_blocks.iter().map(|b| b.name()).collect::<Vec<_>>().join("+");
    let mut blocks = depth_blocks.into_iter();
    let block = match (blocks.next(), blocks.next()) {
        (None, _) => return Ok(result),
        (Some(block), None) if block.name() == "projective" => block,
        _ => return Err(EstimatorError::NotProjective { estimator: estimator.name(), model }),
    };
    let unit_mm = result.capture.depth_unit_mm.unwrap_or(1.0);
    let region = BoardRegion::new(&result.capture.target);
    let points: Vec<MarkerPoint> = result
        .capture
        .frames
        .iter()
        .zip(&result.poses)
        .flat_map(|(f, pose)| {
            let pixels = board_pixels(f, unit_mm, &result.camera, &region, pose, 1);
            marker_points(f, &pixels, &result.camera, &result.capture.target, pose)
        })
        .flatten()
        .collect();
    let free: [bool; 4] = std::array::from_fn(|i| block.free[i]);
    let d = match estimator {
        Estimator::Irls => irls(&points, free)?,
        Estimator::Nonlinear => nonlinear(&points, free)?,
        Estimator::Linear | Estimator::Joint => linear(&points, free)?,
    };
    let mut block = block;
    block.theta.copy_from_slice(d.as_slice());
    result.camera = result.camera.with_block(block);
    // No covariance of D here: these estimators treat poses and depth as if they were exact.
    result.covariance = result.covariance.map(|c| {
        let n = c.nrows() + 4;
        c.resize(n, n, 0.0)
    });
    result.with_depth = true;
    let errors: Vec<f64> = points
        .iter()
        .map(|p| {
            let predicted = d.dot(&Vector4::new(p.ray[0], p.ray[1], 1.0, 1.0 / p.point_in_camera.z));
            1.0 / p.inverse_depth - 1.0 / predicted
        })
        .collect();
    result.depth_rms_mm = Some(rms(&errors));
    Ok(result)
}

fn free_names(free: [bool; 4]) -> String {
    ["dx", "dy", "dz", "dw"].iter().zip(free).filter(|(_, f)| *f).map(|(n, _)| *n).collect::<Vec<_>>().join(", ")
}
