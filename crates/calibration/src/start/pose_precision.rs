//! How well the markers of a frame determine the pose of its board.

use std::fmt;

use depthcal_model::chain::{POSE, Workspace};
use depthcal_model::{Camera, Target};
use nalgebra::{Cholesky, Const, Isometry3, SMatrix, SVector, Vector3};

use super::frame_markers::FrameMarkers;
use super::pose::{PoseFit, mirrored_pose};
use crate::observe::MarkerObservation;

/// Largest standard deviation of the board's depth within the hull of its markers, as a share of the depth, with which the
/// markers count as determining a pose. A whole board leaves some 0.01 %; depth cameras err by up to some per cent, which a
/// pose has to be able to show.
pub const MOST_UNCERTAIN_DEPTH: f64 = 0.01;
/// Difference of squared residuals, in variances, below which the better of two poses may be the wrong one: three standard
/// deviations.
const SAME_FIT: f64 = 9.0;

/// Why the markers of a frame do not determine its pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PoseDoubt {
    /// The depth of the board within the hull of its markers is uncertain.
    Uncertain {
        /// Number of markers.
        markers: usize,
        /// Largest standard deviation of depth over depth at a marker; infinite where the pose is undetermined.
        share: f64,
    },
    /// A pose that is mirrored about the line of sight fits as well.
    Ambiguous {
        /// Number of markers.
        markers: usize,
        /// Largest difference of depth over depth at a marker between the two poses.
        share: f64,
    },
}

impl fmt::Display for PoseDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let limit = 100.0 * MOST_UNCERTAIN_DEPTH;
        match self {
            Self::Uncertain { markers, share } if share.is_finite() => write!(
                f,
                "its {markers} markers leave the board's depth uncertain by {:.1} % (limit {limit} %): they are too few, \
                 too close together or nearly on a line",
                100.0 * share
            ),
            Self::Uncertain { markers, .. } => write!(f, "its {markers} markers do not determine the board's pose"),
            Self::Ambiguous { markers, share } => write!(
                f,
                "its {markers} markers fit two poses of the board alike, whose depths differ by {:.1} % (limit {limit} %): \
                 they are too few or too close together",
                100.0 * share
            ),
        }
    }
}

/// Whether the markers of a frame leave the pose `camera_from_board` undetermined, where they have a standard deviation of
/// `sigma_px` times their own [`std_px`](crate::observe::MarkerObservation::std_px) under the given camera; `None` where they
/// determine it.
///
/// The variance of depth is a convex function of the place on the board, so that its largest value within the hull of the
/// markers is at one of them.
pub fn pose_doubt(
    camera: &Camera,
    target: &Target,
    frame: &FrameMarkers<'_>,
    camera_from_board: &Isometry3<f64>,
    sigma_px: f64,
) -> Option<PoseDoubt> {
    let other = mirrored_pose(camera, target, frame.markers, camera_from_board);
    doubt_between(camera, target, frame, camera_from_board, other.as_ref(), sigma_px)
}

/// [`pose_doubt`], given the mirrored pose, which a frame may not have.
pub(crate) fn doubt_between(
    camera: &Camera,
    target: &Target,
    frame: &FrameMarkers<'_>,
    camera_from_board: &Isometry3<f64>,
    other: Option<&PoseFit>,
    sigma_px: f64,
) -> Option<PoseDoubt> {
    let markers = frame.markers.len();
    let share = depth_deviation(camera, target, frame, camera_from_board).map_or(f64::INFINITY, |d| d * sigma_px);
    if !(share <= MOST_UNCERTAIN_DEPTH) {
        return Some(PoseDoubt::Uncertain { markers, share });
    }
    let other = other?;
    let own_px = squared_distances(camera, target, frame, camera_from_board)?;
    let difference = other.rms_px * other.rms_px * markers as f64 - own_px;
    if difference.abs() > SAME_FIT * sigma_px * sigma_px {
        return None;
    }
    let depth = |pose: &Isometry3<f64>, p: &Vector3<f64>| (pose * nalgebra::Point3::from(*p)).z;
    let other = &other.camera_from_board;
    let differences = places(target, frame).map(|p| (depth(other, &p) / depth(camera_from_board, &p) - 1.0).abs());
    let share = differences.fold(0.0, f64::max);
    (share > MOST_UNCERTAIN_DEPTH).then_some(PoseDoubt::Ambiguous { markers, share })
}

/// The markers' places on the nominal board, mm.
fn places<'a>(target: &'a Target, frame: &FrameMarkers<'a>) -> impl Iterator<Item = Vector3<f64>> + 'a {
    frame.markers.iter().map(|m| {
        let [x, y] = target.point(m.index);
        Vector3::new(x, y, 0.0)
    })
}

/// Sum of the squared distances between the markers and their projections, px²; `None` where one has none.
fn squared_distances(
    camera: &Camera,
    target: &Target,
    frame: &FrameMarkers<'_>,
    camera_from_board: &Isometry3<f64>,
) -> Option<f64> {
    let square = |m: &MarkerObservation| {
        let p = camera.board_point(target.point(m.index));
        let [u, v] = camera.project(&(camera_from_board * nalgebra::Point3::from(p)).coords)?;
        Some((u - m.pixel[0]).powi(2) + (v - m.pixel[1]).powi(2))
    };
    frame.markers.iter().map(square).sum()
}

/// The information of points of a board in an image on its pose, factorised.
pub(crate) struct PoseInformation {
    /// Angles and lengths differ in size: the information is scaled to a unit diagonal.
    scale: SVector<f64, POSE>,
    factor: Cholesky<f64, Const<POSE>>,
}

impl PoseInformation {
    /// Of points of the board, mm, each with the standard deviation of its pixel; `None` where they leave the pose undetermined,
    /// or have no projection.
    pub fn of(
        camera: &Camera,
        camera_from_board: &Isometry3<f64>,
        points: &[[f64; 2]],
        std_px: &[f64],
    ) -> Option<Self> {
        let mut pixels = vec![[0.0; 2]; points.len()];
        let mut jacobian = vec![0.0; 2 * points.len() * POSE];
        let (chain, mut work) = (camera.chain(), Workspace::default());
        chain.image_by_pose(&mut work, &camera.theta(), camera_from_board, points, &mut pixels, &mut jacobian).ok()?;
        let mut normal = SMatrix::<f64, POSE, POSE>::zeros();
        for (rows, std_px) in jacobian.chunks_exact(2 * POSE).zip(std_px) {
            for row in rows.chunks_exact(POSE) {
                let row = SVector::<f64, POSE>::from_column_slice(row) / *std_px;
                normal += row * row.transpose();
            }
        }
        let scale = normal.diagonal().map(|n| 1.0 / n.max(f64::MIN_POSITIVE).sqrt());
        let scaled = SMatrix::<f64, POSE, POSE>::from_fn(|i, j| normal[(i, j)] * scale[i] * scale[j]);
        Some(Self { scale, factor: scaled.cholesky()? })
    }

    /// Standard deviation of a quantity with this gradient by the pose's tangent (ω, τ).
    pub fn std_dev(&self, gradient: SVector<f64, POSE>) -> f64 {
        let scaled = gradient.component_mul(&self.scale);
        scaled.dot(&self.factor.solve(&scaled)).max(0.0).sqrt()
    }
}

/// Largest standard deviation of depth over depth at the markers, per pixel of the markers' standard deviation; `None` where
/// they leave the pose undetermined. With the pose's tangent (ω, τ) the depth of the board point P is
/// z = e₃ᵀ(R Exp(ω) P + t + τ), whose derivative is (P × Rᵀe₃, e₃).
fn depth_deviation(
    camera: &Camera,
    target: &Target,
    frame: &FrameMarkers<'_>,
    camera_from_board: &Isometry3<f64>,
) -> Option<f64> {
    let points: Vec<[f64; 2]> = frame.markers.iter().map(|m| target.point(m.index)).collect();
    let std_px: Vec<f64> = frame.markers.iter().map(|m| m.std_px).collect();
    let information = PoseInformation::of(camera, camera_from_board, &points, &std_px)?;
    let sight = camera_from_board.rotation.inverse() * Vector3::z();
    let shares = places(target, frame).map(|p| {
        let turn = p.cross(&sight);
        let mut gradient = SVector::<f64, POSE>::zeros();
        gradient.fixed_rows_mut::<3>(0).copy_from(&turn);
        gradient[5] = 1.0;
        let z = (camera_from_board * nalgebra::Point3::from(p)).z;
        information.std_dev(gradient) / z
    });
    let largest = shares.fold(0.0, |a: f64, b| {
        if b >= a {
            b
        } else if b.is_nan() {
            f64::NAN
        } else {
            a
        }
    });
    largest.is_finite().then_some(largest)
}
