//! Rays to pixels and back: OpenCV's full lens model, sensor tilt, and focus breathing.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use crate::camera::CameraTruth;

/// The optical path from ray to pixel: pinhole and Brown–Conrady from a [`CameraTruth`], the rest set by effects.
#[derive(Debug, Clone)]
pub(crate) struct Optics {
    pub focal: [f64; 2],
    pub skew: f64,
    pub centre: [f64; 2],
    /// k1 to k4 of a fisheye lens, instead of all but tilt and breathing.
    pub fisheye: Option<[f64; 4]>,
    /// k1 k2 k3 of the numerator.
    pub radial: [f64; 3],
    /// p1 p2.
    pub tangential: [f64; 2],
    /// k4 k5 k6 of the denominator.
    pub denominator: [f64; 3],
    /// s1 s2 s3 s4.
    pub prism: [f64; 4],
    /// Homography of the tilted sensor plane, and its inverse.
    pub tilt: Option<(Matrix3<f64>, Matrix3<f64>)>,
    /// Relative growth of the focal length per unit of inverse depth beyond [`FOCUSED_AT`], mm.
    pub breathing_mm: f64,
}

/// Inverse depth at which the focal lengths are exact, 1/mm.
pub(crate) const FOCUSED_AT: f64 = 1.0 / 700.0;

impl Optics {
    pub fn new(camera: &CameraTruth) -> Self {
        let [k1, k2, p1, p2, k3] = camera.lens;
        Self {
            focal: camera.focal_px,
            skew: camera.skew_px,
            centre: camera.centre_px,
            fisheye: camera.fisheye,
            radial: [k1, k2, k3],
            tangential: [p1, p2],
            denominator: [0.0; 3],
            prism: [0.0; 4],
            tilt: None,
            breathing_mm: 0.0,
        }
    }

    /// Tilts the sensor by (τx, τy), radians (Scheimpflug).
    pub fn set_tilt(&mut self, [tau_x, tau_y]: [f64; 2]) {
        let (sx, cx) = tau_x.sin_cos();
        let (sy, cy) = tau_y.sin_cos();
        let about_x = Matrix3::new(1.0, 0.0, 0.0, 0.0, cx, sx, 0.0, -sx, cx);
        let about_y = Matrix3::new(cy, 0.0, -sy, 0.0, 1.0, 0.0, sy, 0.0, cy);
        let r = about_y * about_x;
        let onto_plane = Matrix3::new(r[(2, 2)], 0.0, -r[(0, 2)], 0.0, r[(2, 2)], -r[(1, 2)], 0.0, 0.0, 1.0);
        let tilt = onto_plane * r;
        self.tilt = tilt.try_inverse().map(|inverse| (tilt, inverse));
    }

    /// Pixel of the point X (camera frame, mm); `None` when it lies behind the camera or beyond the radius at which the
    /// lens folds.
    pub fn project(&self, [x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
        if z <= 0.0 {
            return None;
        }
        let ray = [x / z, y / z];
        self.is_monotone(ray).then(|| self.pixel(self.distort(ray), 1.0 / z))
    }

    /// Ray (x, y, 1) to `pixel` (px) of a point at inverse depth `rho` (1/mm); `None` when the lens has no such ray.
    pub fn ray(&self, pixel: [f64; 2], rho: f64) -> Option<[f64; 2]> {
        let sharp = self.in_focus(pixel, rho);
        let y = (sharp[1] - self.centre[1]) / self.focal[1];
        let x = (sharp[0] - self.centre[0] - self.skew * y) / self.focal[0];
        self.undistort([x, y])
    }

    /// Position of `pixel` (px) if its point were at the focused distance.
    pub fn in_focus(&self, pixel: [f64; 2], rho: f64) -> [f64; 2] {
        let m = self.magnification(rho);
        [self.centre[0] + (pixel[0] - self.centre[0]) / m, self.centre[1] + (pixel[1] - self.centre[1]) / m]
    }

    fn magnification(&self, rho: f64) -> f64 {
        1.0 + self.breathing_mm * (rho - FOCUSED_AT)
    }

    fn pixel(&self, [x, y]: [f64; 2], rho: f64) -> [f64; 2] {
        let m = self.magnification(rho);
        let [fx, fy] = self.focal;
        [self.centre[0] + m * (fx * x + self.skew * y), self.centre[1] + m * fy * y]
    }

    /// Distortion by lens and sensor tilt, in normalised coordinates.
    pub fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        if let Some(k) = self.fisheye {
            let distorted = fisheye_point(k, [x, y]);
            return self.tilt.as_ref().map_or(distorted, |(tilt, _)| apply(tilt, distorted));
        }
        let r2 = x * x + y * y;
        let series = |[a, b, c]: [f64; 3]| 1.0 + r2 * (a + r2 * (b + r2 * c));
        let radial = series(self.radial) / series(self.denominator);
        let [p1, p2] = self.tangential;
        let [s1, s2, s3, s4] = self.prism;
        let xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + r2 * s2);
        let yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + r2 * s4);
        match &self.tilt {
            Some((tilt, _)) => apply(tilt, [xd, yd]),
            None => [xd, yd],
        }
    }

    /// The inverse of [`Self::distort`] by Newton's method; `None` beyond the radius at which the lens folds.
    fn undistort(&self, target: [f64; 2]) -> Option<[f64; 2]> {
        let start = match &self.tilt {
            Some((_, inverse)) => apply(inverse, target),
            None => target,
        };
        if let Some(k) = self.fisheye {
            return fisheye_ray(k, start);
        }
        let (target, mut ray) = (Vector2::from(target), Vector2::from(start));
        for _ in 0..30 {
            let missing = target - Vector2::from(self.distort(ray.into()));
            let step = self.slope(ray.into()).try_inverse()? * missing;
            // Steps are limited, as large ones leave the region in which the map is monotone.
            ray += step * (0.3 / step.norm()).min(1.0);
            if step.norm() < 1e-13 {
                break;
            }
        }
        let missing = target - Vector2::from(self.distort(ray.into()));
        (missing.norm() < 1e-10 && self.is_monotone(ray.into())).then_some(ray.into())
    }

    /// Derivative of the distortion by central differences.
    fn slope(&self, [x, y]: [f64; 2]) -> Matrix2<f64> {
        const H: f64 = 1e-6;
        let difference = |a: [f64; 2], b: [f64; 2]| Vector2::new(a[0] - b[0], a[1] - b[1]) / (2.0 * H);
        Matrix2::from_columns(&[
            difference(self.distort([x + H, y]), self.distort([x - H, y])),
            difference(self.distort([x, y + H]), self.distort([x, y - H])),
        ])
    }

    /// Whether the radial map is monotone from the centre out to this ray. The slope at the ray alone is not enough, as
    /// it is positive again beyond a second fold.
    fn is_monotone(&self, [x, y]: [f64; 2]) -> bool {
        if let Some(k) = self.fisheye {
            return fisheye_grows(k, x.hypot(y).atan());
        }
        let r2 = x * x + y * y;
        if self.radial == [0.0; 3] && self.denominator == [0.0; 3] {
            return true;
        }
        (1..=4).all(|quarter| {
            let s = r2 * f64::from(quarter) / 4.0;
            let value = |[a, b, c]: [f64; 3]| 1.0 + s * (a + s * (b + s * c));
            let slope = |[a, b, c]: [f64; 3]| 2.0 * s * (a + s * (2.0 * b + s * 3.0 * c));
            let (top, bottom) = (value(self.radial), value(self.denominator));
            // d(r n/d)/dr = (n d + r n' d − r n d') / d²
            bottom > 0.0 && top * bottom + slope(self.radial) * bottom - top * slope(self.denominator) > 0.0
        })
    }
}

/// Largest angle to the axis that a fisheye lens sees, radians.
const WIDEST_ANGLE: f64 = 1.52;

/// Image radius of a fisheye lens at an angle to its axis, and its derivative.
fn fisheye_radius(k: [f64; 4], angle: f64) -> (f64, f64) {
    let orders = [3, 5, 7, 9];
    k.iter().zip(orders).fold((angle, 1.0), |(radius, slope), (k, order)| {
        (radius + k * angle.powi(order), slope + k * f64::from(order) * angle.powi(order - 1))
    })
}

fn fisheye_point(k: [f64; 4], [x, y]: [f64; 2]) -> [f64; 2] {
    let azimuth = y.atan2(x);
    let (radius, _) = fisheye_radius(k, x.hypot(y).atan());
    [radius * azimuth.cos(), radius * azimuth.sin()]
}

/// Whether the image radius grows with the angle up to this one.
fn fisheye_grows(k: [f64; 4], angle: f64) -> bool {
    angle <= WIDEST_ANGLE && (1..=32).all(|i| fisheye_radius(k, angle * f64::from(i) / 32.0).1 > 0.0)
}

/// The ray to a point of a fisheye image, by bisection over the angle.
fn fisheye_ray(k: [f64; 4], [x, y]: [f64; 2]) -> Option<[f64; 2]> {
    let target = x.hypot(y);
    let (mut low, mut high) = (0.0, WIDEST_ANGLE);
    if fisheye_radius(k, high).0 < target {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if fisheye_radius(k, middle).0 < target { low = middle } else { high = middle }
    }
    let (angle, azimuth) = (0.5 * (low + high), y.atan2(x));
    fisheye_grows(k, angle).then(|| [angle.tan() * azimuth.cos(), angle.tan() * azimuth.sin()])
}

fn apply(homography: &Matrix3<f64>, [x, y]: [f64; 2]) -> [f64; 2] {
    let p = homography * Vector3::new(x, y, 1.0);
    [p.x / p.z, p.y / p.z]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complete() -> Optics {
        let mut optics = Optics::new(&CameraTruth::published(2).unwrap());
        optics.denominator = [0.02, -0.03, 0.05];
        optics.prism = [0.002, -0.001, 0.001, 0.0005];
        optics.set_tilt([0.02, -0.03]);
        optics.breathing_mm = 5.0;
        optics
    }

    #[test]
    fn rays_and_pixels_are_inverse() {
        let optics = complete();
        for v in (0..480).step_by(53) {
            for u in (0..640).step_by(71) {
                for z in [300.0, 900.0, 2000.0] {
                    let pixel = [u as f64, v as f64];
                    let [x, y] = optics.ray(pixel, 1.0 / z).unwrap();
                    let back = optics.project([x * z, y * z, z]).unwrap();
                    assert!((back[0] - pixel[0]).abs() < 1e-8 && (back[1] - pixel[1]).abs() < 1e-8);
                }
            }
        }
    }

    #[test]
    fn without_any_distortion_the_camera_is_a_pinhole() {
        let optics = Optics::new(&CameraTruth::ideal(640, 480, 500.0));
        assert_eq!(optics.project([100.0, -50.0, 1000.0]), Some([319.5 + 50.0, 239.5 - 25.0]));
        assert_eq!(optics.project([100.0, -50.0, -1.0]), None);
    }

    #[test]
    fn a_fisheye_sees_150_degrees_and_is_inverted() {
        let optics = Optics::new(&CameraTruth::fisheye_150());
        let [left, right] = [0.0, 799.0].map(|u| optics.ray([u, 247.1], 0.001).unwrap()[0].atan().to_degrees());
        assert!((right - left - 150.0).abs() < 1.5, "{left} {right}");
        for v in (0..500).step_by(83) {
            for u in (60..740).step_by(97) {
                let pixel = [u as f64, v as f64];
                let [x, y] = optics.ray(pixel, 0.001).unwrap();
                let back = optics.project([x * 500.0, y * 500.0, 500.0]).unwrap();
                assert!((back[0] - pixel[0]).hypot(back[1] - pixel[1]) < 1e-8, "{pixel:?}: {back:?}");
            }
        }
        assert_eq!(optics.ray([-150.0, 247.1], 0.001), None);
    }

    #[test]
    fn beyond_the_fold_there_is_no_pixel() {
        let camera = CameraTruth { lens: [-0.4, 0.0, 0.0, 0.0, 0.0], ..CameraTruth::ideal(640, 480, 500.0) };
        let optics = Optics::new(&camera);
        assert!(optics.project([500.0, 0.0, 1000.0]).is_some());
        assert_eq!(optics.project([1000.0, 0.0, 1000.0]), None);
        assert_eq!(optics.ray([319.5 + 400.0, 239.5], 0.001), None);
    }
}
