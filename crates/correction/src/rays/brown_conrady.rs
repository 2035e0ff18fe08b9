//! The Brown–Conrady lens with its derivatives written out.

use depthcal_model::hook::HookKind;
use depthcal_model::{Camera, Context};

use super::real::{Real, mul_add};

/// A pinhole camera with the Brown–Conrady lens.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BrownConrady {
    /// fx, fy, cx, cy, skew, px.
    pub pinhole: [f64; 5],
    /// Displacement of the depth image's pixels on the image, px.
    pub shift: [f64; 2],
    /// k1, k2, p1, p2, k3.
    pub k: [f64; 5],
    /// Radius |(x, y)| of the undistorted ray up to which the lens is monotone.
    pub limit: f64,
}

impl BrownConrady {
    /// The lens of a camera that has this lens and no other, or none, and whose depth image is displaced by the same
    /// amount at all pixels. `None` for other cameras.
    pub fn of(camera: &Camera) -> Option<Self> {
        let mut pieces = camera.blocks().iter().filter(|b| b.piece().is_some() && b.hook() == HookKind::Lens);
        let k = match (pieces.next(), pieces.next()) {
            (None, _) => [0.0; 5],
            (Some(block), None) if block.name() == "brown_conrady" => block.theta.clone().try_into().ok()?,
            _ => return None,
        };
        let shift_at = |u: usize, v: usize| {
            let pixel = [u as f64, v as f64];
            let seen = camera.image_pixel(&Context { pixel, ..Context::default() });
            [seen[0] - pixel[0], seen[1] - pixel[1]]
        };
        let shift = shift_at(0, 0);
        let (w, h) = (camera.width, camera.height);
        let alike = |d: [f64; 2]| (d[0] - shift[0]).abs() < 1e-11 && (d[1] - shift[1]).abs() < 1e-11;
        let lens = Self { pinhole: camera.pinhole(), shift, k, limit: camera.lens_limit() };
        // A user's register may hold another piece of that name, so the lens is compared with the camera's at one ray.
        let [x, y] = [0.21, -0.13];
        let ([u, v], [fx, fy, cx, cy, skew]) = (camera.project(&[0.21, -0.13, 1.0].into())?, lens.pinhole);
        let [a, b, ..] = distort::<f64, false>(&k, x, y);
        let same = (fx * a + skew * b + cx - u).abs() < 1e-9 && (fy * b + cy - v).abs() < 1e-9;
        (same && [shift_at(w - 1, 0), shift_at(w / 2, h / 2), shift_at(w / 3, h - 1)].into_iter().all(alike))
            .then_some(lens)
    }
}

/// The distorted ray x', y' of a ray x, y, and its derivatives ∂x'/∂x, ∂x'/∂y = ∂y'/∂x, ∂y'/∂y.
#[inline(always)]
pub(crate) fn distort<T: Real, const FMA: bool>(k: &[T; 5], x: T, y: T) -> [T; 5] {
    let [k1, k2, p1, p2, k3] = *k;
    let (one, two, three) = (T::of(1.0), T::of(2.0), T::of(3.0));
    let (xx, xy) = (x * x, x * y);
    let yy = y * y;
    let r2 = xx + yy;
    let radial = mul_add::<T, FMA>(mul_add::<T, FMA>(mul_add::<T, FMA>(k3, r2, k2), r2, k1), r2, one);
    // ∂radial/∂x = 2 x · slope, ∂radial/∂y = 2 y · slope.
    let slope = mul_add::<T, FMA>(mul_add::<T, FMA>(three * k3, r2, two * k2), r2, k1);
    let px = mul_add::<T, FMA>(p1, x, p2 * y);
    let py = mul_add::<T, FMA>(p1, y, p2 * x);
    let xd = mul_add::<T, FMA>(x, radial, mul_add::<T, FMA>(two * p1, xy, p2 * mul_add::<T, FMA>(two, xx, r2)));
    let yd = mul_add::<T, FMA>(y, radial, mul_add::<T, FMA>(two * p2, xy, p1 * mul_add::<T, FMA>(two, yy, r2)));
    let cross = two * mul_add::<T, FMA>(xy, slope, px);
    let dxx = mul_add::<T, FMA>(two, mul_add::<T, FMA>(xx, slope, mul_add::<T, FMA>(two * p2, x, py)), radial);
    let dyy = mul_add::<T, FMA>(two, mul_add::<T, FMA>(yy, slope, mul_add::<T, FMA>(two * p1, y, py)), radial);
    [xd, yd, dxx, cross, dyy]
}

#[cfg(test)]
mod tests {
    use depthcal_model::Block;

    use super::*;
    use crate::tests::block;

    fn of(blocks: Vec<Block>) -> Option<BrownConrady> {
        BrownConrady::of(&Camera::new(160, 120, [140.0, 139.0, 77.9, 60.2, 0.3], blocks))
    }

    #[test]
    fn cameras_with_this_lens_and_a_constant_displacement_are_taken() {
        let k = [-0.1468, 0.0463, 0.0012, -0.0007, -0.0756];
        let lens = || block("brown_conrady", &k);
        let plain = of(vec![]).unwrap();
        assert_eq!((plain.k, plain.shift), ([0.0; 5], [0.0; 2]));
        let displaced = of(vec![lens(), block("depth_registration", &[1.7, -0.6])]).unwrap();
        assert_eq!(displaced.k, k);
        assert!((displaced.shift[0].abs() - 1.7).abs() < 1e-12 && (displaced.shift[1].abs() - 0.6).abs() < 1e-12);
        assert!(of(vec![lens(), lens()]).is_none());
        assert!(of(vec![block("kannala_brandt", &[0.01, 0.0, 0.0, 0.0])]).is_none());
    }

    #[test]
    fn derivatives_are_those_of_the_distorted_ray() {
        let k = [-0.1468, 0.0463, 0.0012, -0.0007, -0.0756];
        let h = 1e-6;
        for (x, y) in [(0.31, -0.22), (-0.4, 0.15), (0.05, 0.5)] {
            let [xd, yd, dxx, cross, dyy] = distort::<f64, false>(&k, x, y);
            let [right, left] = [h, -h].map(|h| distort::<f64, false>(&k, x + h, y));
            let [below, above] = [h, -h].map(|h| distort::<f64, false>(&k, x, y + h));
            let slope = |one: f64, other: f64| (one - other) / (2.0 * h);
            // Differences of rounding 1e-16 over 2e-6, and of third derivatives near 1 times h².
            for (derivative, expected) in [
                (dxx, slope(right[0], left[0])),
                (cross, slope(right[1], left[1])),
                (cross, slope(below[0], above[0])),
                (dyy, slope(below[1], above[1])),
            ] {
                assert!((derivative - expected).abs() < 1e-9, "({x}, {y}): {derivative}, by differences {expected}");
            }
            // The equation as it is printed (Brown 1966; OpenCV's order of coefficients).
            let r2 = x * x + y * y;
            let radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
            let expected = [
                x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x),
                y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y,
            ];
            assert!((xd - expected[0]).abs() < 1e-15 && (yd - expected[1]).abs() < 1e-15, "({x}, {y})");
        }
    }
}
