//! The place of a depth camera, and its focal length where none is declared, from planes in two frames.

use depthcal_statistics::upper_median;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::planes::ImagePlane;

/// The board's plane in a frame: as the depth camera measures it, and the board's pose by the other cameras.
#[derive(Debug, Clone, Copy)]
pub struct BoardPlaneSeen {
    /// In the depth image.
    pub image: ImagePlane,
    /// Pose of the board in the rig's frame.
    pub rig_from_board: Isometry3<f64>,
}

/// A place with how well it fits.
#[derive(Debug, Clone)]
pub struct PlaceFit {
    /// Maps the rig's frame to the camera's.
    pub camera_from_rig: Isometry3<f64>,
    /// Focal length, px.
    pub focal_px: f64,
    /// Median angle between measured and expected normals, rad.
    pub angle_rad: f64,
    /// Planes that agree.
    pub agreeing: Vec<bool>,
}

/// Planes whose normals are farther off than this many times the median, and this angle, do not count.
const FAR: f64 = 4.0;
const FAR_RAD: f64 = 0.02;
/// Focal lengths that are tried, in image widths, and the ratio of neighbours.
const FOCAL_LENGTHS: [f64; 2] = [0.35, 2.2];
const RATIO: f64 = 1.04;

/// The place under which the planes' normals and distances agree best: with the focal length `declared`, px, or with the best
/// of those that depth cameras have. `None` where normals do not determine a rotation: fewer than three planes, or parallel
/// ones.
pub fn place_from_planes(planes: &[BoardPlaneSeen], width: usize, declared: Option<f64>) -> Option<PlaceFit> {
    if let Some(focal_px) = declared {
        return fit(planes, focal_px);
    }
    let [low, high] = FOCAL_LENGTHS.map(|f| f * width as f64);
    let tried = std::iter::successors(Some(low), |f| Some(f * RATIO)).take_while(|f| *f <= high);
    tried.filter_map(|f| fit(planes, f)).min_by(|a, b| a.angle_rad.total_cmp(&b.angle_rad))
}

/// Plane vectors m with m · X = 1: of inverse depth a x + b y + c on a plane, m = (a, b, c).
fn in_camera(image: &ImagePlane, focal_px: f64) -> Vector3<f64> {
    let [alpha, beta, gamma] = image.coefficients;
    Vector3::new(focal_px * alpha, focal_px * beta, gamma)
}

fn in_rig(pose: &Isometry3<f64>) -> Option<Vector3<f64>> {
    let normal = pose.rotation * Vector3::z();
    let distance = normal.dot(&(pose * Point3::origin()).coords);
    (distance.abs() > 1.0).then(|| normal / distance)
}

fn fit(planes: &[BoardPlaneSeen], focal_px: f64) -> Option<PlaceFit> {
    let pairs: Vec<(Vector3<f64>, Vector3<f64>)> =
        planes.iter().filter_map(|p| Some((in_camera(&p.image, focal_px), in_rig(&p.rig_from_board)?))).collect();
    if pairs.len() != planes.len() || pairs.len() < 3 {
        return None;
    }
    let mut agreeing = vec![true; pairs.len()];
    let mut rotation = Rotation3::identity();
    let mut angle_rad = f64::INFINITY;
    for _ in 0..6 {
        rotation = kabsch(pairs.iter().zip(&agreeing).filter(|(_, used)| **used).map(|(pair, _)| *pair))?;
        let angles: Vec<f64> = pairs.iter().map(|(c, r)| (rotation * r).angle(c)).collect();
        angle_rad = upper_median(&mut angles.clone())?;
        let next: Vec<bool> = angles.iter().map(|a| *a <= (FAR * angle_rad).max(FAR_RAD)).collect();
        if next == agreeing {
            break;
        }
        agreeing = next;
    }
    // n · t = d_camera − d_rig, with unit normals in the camera.
    let (mut normal, mut rhs) = (Matrix3::zeros(), Vector3::zeros());
    for ((c, r), _) in pairs.iter().zip(&agreeing).filter(|(_, used)| **used) {
        let n = c.normalize();
        normal += n * n.transpose();
        rhs += n * (1.0 / c.norm() - 1.0 / r.norm());
    }
    let eigen = normal.symmetric_eigen();
    // Parallel boards leave the translation along them open.
    if eigen.eigenvalues.min() < 1e-3 * eigen.eigenvalues.max() {
        return None;
    }
    let translation = normal.cholesky()?.solve(&rhs);
    let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
    let camera_from_rig = Isometry3::from_parts(Translation3::from(translation), rotation);
    Some(PlaceFit { camera_from_rig, focal_px, angle_rad, agreeing })
}

/// The rotation that turns the second vectors' directions to the first's best (Kabsch 1976).
fn kabsch(pairs: impl Iterator<Item = (Vector3<f64>, Vector3<f64>)>) -> Option<Rotation3<f64>> {
    let sum = pairs.fold(Matrix3::zeros(), |sum, (c, r)| sum + c.normalize() * r.normalize().transpose());
    let svd = sum.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    // Two directions are needed; the third follows.
    let mut values: Vec<f64> = svd.singular_values.iter().copied().collect();
    values.sort_by(|a, b| b.total_cmp(a));
    if values[1] < 1e-4 * values[0] {
        return None;
    }
    let sign = (u * v_t).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    Some(Rotation3::from_matrix_unchecked(rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact planes give place and focal length back, one wrong plane among them or not.
    #[test]
    fn place_and_focal_length_come_back() {
        let truth = Isometry3::new(Vector3::new(-70.0, 5.0, 12.0), Vector3::new(0.05, -0.1, 0.02));
        let focal = 365.0;
        let seen = |turn: [f64; 3], shift: [f64; 3]| {
            let rig_from_board = Isometry3::new(Vector3::from(shift), Vector3::from(turn));
            let m = in_rig(&(truth * rig_from_board)).unwrap();
            let coefficients = [m.x / focal, m.y / focal, m.z];
            BoardPlaneSeen { image: ImagePlane { coefficients, pixels: 100, middle: [0.0; 2] }, rig_from_board }
        };
        let mut planes: Vec<BoardPlaneSeen> = (0..12)
            .map(|i| {
                let a = f64::from(i);
                seen([0.5 * a.sin(), 0.5 * (1.7 * a).cos(), 0.1 * a], [40.0 * a.cos(), -30.0, 500.0 + 70.0 * a])
            })
            .collect();
        planes[3].image.coefficients[0] *= -1.0;
        let fit = place_from_planes(&planes, 512, None).unwrap();
        assert!((fit.focal_px / focal - 1.0).abs() < 0.03, "{}", fit.focal_px);
        assert!(!fit.agreeing[3]);
        let fit = place_from_planes(&planes, 512, Some(focal)).unwrap();
        let error = fit.camera_from_rig * truth.inverse();
        assert!(error.rotation.angle() < 1e-6 && error.translation.vector.norm() < 1e-3, "{error}");
        assert!(place_from_planes(&[planes[0]; 5], 512, Some(focal)).is_none(), "parallel boards");
    }
}
