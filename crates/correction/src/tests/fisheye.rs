//! A fisheye camera of 150°, whose corners lie beyond what a lens may see.

use depthcal_io::DepthImage;
use depthcal_model::{Camera, Context};

use super::{PROJECTIVE, block};
use crate::conventions::pixel;
use crate::{Corrector, FrameContext, PointsMut, Rays, Remap};

const WIDTH: usize = 176;
const HEIGHT: usize = 110;

fn camera(with_depth: bool) -> Camera {
    let lens = block("kannala_brandt", &[0.021, -0.009, 0.0024, -0.0003]);
    let depth = with_depth.then(|| block(PROJECTIVE.0, &[2e-5, -6e-6, 4e-6, 1.008]));
    Camera::new(WIDTH, HEIGHT, [65.9, 65.7, 88.4, 54.2, 0.0], [lens].into_iter().chain(depth).collect())
}

#[test]
fn rays_depth_and_points_are_those_of_the_camera() {
    let camera = camera(true);
    let n = WIDTH * HEIGHT;
    let (mut x, mut y) = (vec![0.0; n], vec![0.0; n]);
    Rays::new(&camera).double([&mut x, &mut y]).unwrap();
    let data: Vec<u16> = (0..n).map(|i| 400 + (i * 37 % 1500) as u16).collect();
    let measured = DepthImage { width: WIDTH, height: HEIGHT, data };
    let corrector = Corrector::new(&camera).unwrap();
    let mut points = vec![0.0f32; 3 * n];
    let context = FrameContext::default();
    corrector.correct_to_points(&measured, 1.0, &context, PointsMut::Interleaved(&mut points)).unwrap();
    let (mut widest, mut without) = (0.0_f64, 0);
    for i in 0..n {
        let point = &points[3 * i..3 * i + 3];
        let context = Context { pixel: pixel(i, WIDTH), ..Context::default() };
        let Ok(([ex, ey], rho)) = camera.correct(&context, 1.0, 1.0 / f64::from(measured.data[i])) else {
            assert!(x[i].is_nan() == camera.ray(context.pixel, 1e-3).is_err() && point[2].is_nan(), "pixel {i}");
            without += 1;
            continue;
        };
        let slant = 1.0 + ex * ex + ey * ey;
        widest = widest.max(slant.sqrt().recip().acos().to_degrees());
        assert!((x[i] - ex).hypot(y[i] - ey) < 1e-11 * slant, "pixel {i}");
        let expected = [ex / rho, ey / rho, 1.0 / rho];
        for (coordinate, expected) in point.iter().zip(expected) {
            assert!(
                (f64::from(*coordinate) - expected).abs() < 0.01 + 1e-6 * expected.abs(),
                "pixel {i}: {coordinate} {expected}"
            );
        }
    }
    assert!(widest > 80.0 && without > 20 && without < n / 10, "{widest}°, {without} pixels without a ray");
}

/// Every pixel of an ideal pinhole camera of 127° comes from where the fisheye camera sees the same ray.
#[test]
fn images_become_those_of_a_pinhole_camera() {
    let camera = camera(false);
    let pinhole = [44.0, 44.0, 87.5, 54.5, 0.0];
    let remap = Remap::to_pinhole(&camera, pinhole);
    // An image whose value tells the pixel.
    let image: Vec<u16> = (0..WIDTH * HEIGHT).map(|i| (100 * (i % WIDTH) + (i / WIDTH)) as u16).collect();
    let mut out = vec![0; image.len()];
    remap.nearest(&image, &mut out).unwrap();
    let mut compared = 0;
    for (i, value) in out.iter().enumerate() {
        let [u, v] = pixel(i, WIDTH);
        let ray = [(u - pinhole[2]) / pinhole[0], (v - pinhole[3]) / pinhole[1], 1.0].map(|c| 1000.0 * c);
        let [su, sv] = camera.project(&ray.into()).unwrap();
        if su < 0.0 || sv < 0.0 || su > WIDTH as f64 - 1.0 || sv > HEIGHT as f64 - 1.0 {
            continue;
        }
        let (fu, fv) = (f64::from(value / 100), f64::from(value % 100));
        // The hundreds are columns only where the row is below a hundred.
        if sv < 99.0 {
            assert!((fu - su).abs() <= 0.501 && (fv - sv).abs() <= 0.501, "{u} {v}: {fu} {fv} against {su} {sv}");
            compared += 1;
        }
    }
    assert!(compared > WIDTH * HEIGHT / 2, "{compared}");
}
