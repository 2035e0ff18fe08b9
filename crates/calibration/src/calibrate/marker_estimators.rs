//! D by one of the thesis' estimators, on top of a calibration from the images alone.

use depthcal_model::Block;
use depthcal_statistics::{Thinning, rms};
use nalgebra::Vector4;

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::Estimator;
use super::error::CalibrateError;
use crate::estimators::{EstimatorError, MarkerPoint, irls, linear, marker_points, nonlinear};
use crate::observe::board_pixels::board_pixels;
use crate::observe::board_region::BoardRegion;
use crate::observe::outliers::remove_outliers;
use crate::observe::{PixelRays, PosedFrame};

/// Fits D by one of the thesis' estimators, on top of a calibration from the images alone.
///
/// # Errors
///
/// [`CalibrateError`] of the estimator, or where a depth image has become unreadable.
pub(super) fn estimate(
    from_image: CalibratedCamera<PosedFrame>,
    depth_blocks: Vec<Block>,
    estimator: Estimator,
) -> Result<CalibratedCamera, CalibrateError> {
    let mut result = from_image.without_samples();
    result.estimator = estimator;
    let model = depth_blocks.iter().map(|b| b.name()).collect::<Vec<_>>().join("+");
    let mut blocks = depth_blocks.into_iter();
    let block = match (blocks.next(), blocks.next()) {
        (None, _) => return Ok(result),
        (Some(block), None) if block.name() == "projective" => block,
        _ => return Err(EstimatorError::NotProjective { estimator: estimator.name(), model }.into()),
    };
    let unit_mm = result.capture.depth_unit_mm.unwrap_or(1.0);
    let rays = PixelRays::new(&result.camera, &result.capture.target);
    let mut points: Vec<MarkerPoint> = Vec::new();
    for frame in &result.capture.frames {
        let pose = &frame.camera_from_board;
        let region = BoardRegion::within_markers(&result.capture.target, &frame.markers);
        let mut pixels = board_pixels(&frame.open()?, unit_mm, &rays, &region, pose, Thinning::ALL).pixels;
        remove_outliers(&mut pixels);
        let of_frame = marker_points(frame, &pixels, &result.camera, &result.capture.target, pose);
        points.extend(of_frame.into_iter().flatten());
    }
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
    result.depth_rms_mm = Some(rms(errors));
    Ok(result)
}
