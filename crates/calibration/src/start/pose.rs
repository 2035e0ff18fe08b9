//! Pose of a board from its markers in one image.

use depthcal_model::chain::{POSE, Workspace};
use depthcal_model::{Camera, Target};
use nalgebra::{Isometry3, Matrix3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};

use super::error::StartError;
use super::frame_markers::FrameMarkers;
use super::homography::homography;
use crate::observe::MarkerObservation;

/// Relative fall of the squared reprojection error in a step below which a pose has settled: it is then within some
/// hundred-thousandth of its standard deviation.
const SETTLED: f64 = 1e-10;

/// A pose with its reprojection error.
#[derive(Debug, Clone)]
pub struct PoseFit {
    /// The pose: maps board coordinates to camera coordinates, mm.
    pub camera_from_board: Isometry3<f64>,
    /// Reprojection error: root mean square distance, px.
    pub rms_px: f64,
}

/// The pose that minimises the reprojection error under a given camera: the best of [`local_poses`].
///
/// # Errors
///
/// [`StartError`], where the markers are too few, collinear or outside the lens model, or no pose is in front of the camera.
pub fn estimate_pose(camera: &Camera, target: &Target, frame: &FrameMarkers<'_>) -> Result<PoseFit, StartError> {
    let best = local_poses(camera, target, frame)?.into_iter().next();
    best.ok_or_else(|| StartError::NoPose { frame: frame.name.to_owned() })
}

/// The poses at which the reprojection error has a minimum under a given camera, one or two, the best first.
///
/// The search starts from the homography of the undistorted markers and from the pose mirrored about the line of sight, which
/// is the other local minimum of a plane's pose (Schweighofer, Pinz 2006).
///
/// # Errors
///
/// As [`estimate_pose`].
pub fn local_poses(camera: &Camera, target: &Target, frame: &FrameMarkers<'_>) -> Result<Vec<PoseFit>, StartError> {
    let no_pose = || StartError::NoPose { frame: frame.name.to_owned() };
    let undistorted: Vec<MarkerObservation> = frame
        .markers
        .iter()
        .filter_map(|m| camera.ray(m.pixel, 1e-3).ok().map(|ray| MarkerObservation { pixel: ray, ..*m }))
        .collect();
    let h = homography(target, &FrameMarkers { name: frame.name, markers: &undistorted })?;
    let n = undistorted.len().max(1) as f64;
    let middle =
        undistorted.iter().map(|m| target.point(m.index)).fold([0.0; 2], |s, p| [s[0] + p[0] / n, s[1] + p[1] / n]);
    let first = from_homography(&h, middle).ok_or_else(no_pose)?;
    let mirrored = undistorted.first().and_then(|m| mirror(&first, target, m.index));
    let starts = [Some(first), mirrored].into_iter().flatten();
    let fits = starts.filter_map(|pose| refine_pose(camera, target, frame.markers, &pose));
    let mut fits: Vec<PoseFit> = fits.collect();
    fits.sort_by(|a, b| a.rms_px.total_cmp(&b.rms_px));
    if fits.is_empty() { Err(no_pose()) } else { Ok(fits) }
}

/// K⁻¹H = λ (r₁ r₂ t), with the nearest rotation to (r₁, r₂, r₁ × r₂). The board's point `middle` (mm) lies in front of the
/// camera; in wide images the board's origin need not.
fn from_homography(h: &Matrix3<f64>, middle: [f64; 2]) -> Option<Isometry3<f64>> {
    let scale = 2.0 / (h.column(0).norm() + h.column(1).norm());
    let depth = h.m31 * middle[0] + h.m32 * middle[1] + h.m33;
    let sign = if depth < 0.0 { -scale } else { scale };
    let (r1, r2, t) = (h.column(0) * sign, h.column(1) * sign, h.column(2) * sign);
    let svd = Matrix3::from_columns(&[r1, r2, r1.cross(&r2)]).svd(true, true);
    let rotation = svd.u? * svd.v_t?;
    if !(depth.abs() > 0.0) || rotation.determinant() < 0.0 {
        return None;
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Some(Isometry3::from_parts(Translation3::from(t), rotation))
}

/// The pose with the board's plane mirrored about the line of sight to the middle of the board that has this marker; `None` where
/// the board is seen edge-on.
fn mirror(pose: &Isometry3<f64>, target: &Target, marker: usize) -> Option<Isometry3<f64>> {
    let parts = target.parts();
    let points = parts.iter().find(|part| part.markers.contains(&marker))?.board.points();
    let n = points.len() as f64;
    let centre = points.iter().fold(Vector3::zeros(), |c, p| c + Vector3::new(p[0], p[1], 0.0) / n);
    let middle = pose * nalgebra::Point3::from(centre);
    let sight = middle.coords.normalize();
    let normal = pose.rotation * Vector3::z();
    let mirrored = sight * (2.0 * sight.dot(&normal)) - normal;
    let turn = UnitQuaternion::rotation_between(&normal, &mirrored)?;
    let rotation = turn * pose.rotation;
    Some(Isometry3::from_parts(Translation3::from(middle.coords - rotation * centre), rotation))
}

/// The other minimum of the reprojection error: the pose that is found from the mirrored one; `None` where there is none.
pub(crate) fn mirrored_pose(
    camera: &Camera,
    target: &Target,
    markers: &[MarkerObservation],
    pose: &Isometry3<f64>,
) -> Option<PoseFit> {
    refine_pose(camera, target, markers, &mirror(pose, target, markers.first()?.index)?)
}

/// Minimises the reprojection error over the pose alone, by the Levenberg–Marquardt method from `start`. `None` where the camera
/// does not image the board in the start pose, or where the markers do not determine the pose.
pub fn refine_pose(
    camera: &Camera,
    target: &Target,
    markers: &[MarkerObservation],
    start: &Isometry3<f64>,
) -> Option<PoseFit> {
    let (chain, theta) = (camera.chain(), camera.theta());
    let points: Vec<[f64; 2]> = markers.iter().map(|m| target.point(m.index)).collect();
    let mut work = Workspace::default();
    let mut pixels = vec![[0.0; 2]; points.len()];
    let mut jacobian = vec![0.0; 2 * points.len() * POSE];
    let cost = |pixels: &[[f64; 2]]| -> f64 {
        let squares =
            pixels.iter().zip(markers).map(|(p, m)| (p[0] - m.pixel[0]).powi(2) + (p[1] - m.pixel[1]).powi(2));
        squares.sum()
    };
    let mut pose = *start;
    let mut lambda = 1e-4;
    chain.image_by_pose(&mut work, &theta, &pose, &points, &mut pixels, &mut jacobian).ok()?;
    let mut best = cost(&pixels);
    for _ in 0..50 {
        let (mut normal, mut rhs) = (SMatrix::<f64, 6, 6>::zeros(), SVector::<f64, 6>::zeros());
        for (k, marker) in markers.iter().enumerate() {
            for r in 0..2 {
                let row = SVector::<f64, 6>::from_column_slice(&jacobian[(2 * k + r) * POSE..][..POSE]);
                normal += row * row.transpose();
                rhs += row * (marker.pixel[r] - pixels[k][r]);
            }
        }
        let mut improved = false;
        while lambda < 1e12 {
            let mut damped = normal;
            for i in 0..6 {
                damped[(i, i)] *= 1.0 + lambda;
            }
            let step = damped.cholesky()?.solve(&rhs);
            let moved = Isometry3::from_parts(
                Translation3::from(pose.translation.vector + step.fixed_rows::<3>(3)),
                pose.rotation * UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(0).into_owned()),
            );
            let valid = chain.image_by_pose(&mut work, &theta, &moved, &points, &mut pixels, &mut jacobian).is_ok();
            let trial = if valid { cost(&pixels) } else { f64::INFINITY };
            if trial <= best {
                improved = best - trial > SETTLED * best;
                (pose, best) = (moved, trial);
                lambda = (lambda * 0.1).max(1e-12);
                break;
            }
            lambda *= 10.0;
        }
        if !improved {
            break;
        }
    }
    best.is_finite().then(|| PoseFit { camera_from_board: pose, rms_px: (best / markers.len() as f64).sqrt() })
}
