//! Camera, pose, light, clutter, blur and noise.

use depthcal_io::GrayImage;
use nalgebra::{Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::Texture;

#[derive(Clone, Copy)]
pub struct Camera {
    pub width: usize,
    pub height: usize,
    pub f: f64,
    pub c: [f64; 2],
    /// k1 k2 p1 p2 k3
    pub lens: [f64; 5],
}

impl Camera {
    /// Camera 1 of the thesis.
    pub fn thesis() -> Camera {
        let lens = [-0.1468, 0.0463, 0.0012, -0.0007, -0.0756];
        Camera { width: 640, height: 480, f: 476.9, c: [312.97, 242.49], lens }
    }

    fn distort(&self, x: f64, y: f64) -> [f64; 2] {
        let [k1, k2, p1, p2, k3] = self.lens;
        let r = x * x + y * y;
        let k = 1.0 + r * (k1 + r * (k2 + r * k3));
        [x * k + 2.0 * p1 * x * y + p2 * (r + 2.0 * x * x), y * k + p1 * (r + 2.0 * y * y) + 2.0 * p2 * x * y]
    }

    pub fn project(&self, p: Vector3<f64>) -> [f64; 2] {
        let [x, y] = self.distort(p.x / p.z, p.y / p.z);
        [self.f * x + self.c[0], self.f * y + self.c[1]]
    }

    /// Normalised coordinates of a pixel, by fixed-point iteration.
    fn ray(&self, u: f64, v: f64) -> [f64; 2] {
        let target = [(u - self.c[0]) / self.f, (v - self.c[1]) / self.f];
        let mut p = target;
        for _ in 0..25 {
            let q = self.distort(p[0], p[1]);
            p = [p[0] + target[0] - q[0], p[1] + target[1] - q[1]];
        }
        p
    }
}

#[derive(Clone, Copy)]
pub struct Pose {
    pub rotation: Rotation3<f64>,
    pub translation: Vector3<f64>,
}

impl Pose {
    /// Board point `center` (mm) on the optical ray of `pixel` at depth z, tilted by `tilt` rad about an axis in
    /// the board at `axis` rad, after a turn by `roll` rad in its plane.
    pub fn looking(
        camera: &Camera,
        center: [f64; 2],
        pixel: [f64; 2],
        z: f64,
        tilt: f64,
        axis: f64,
        roll: f64,
    ) -> Pose {
        let axis = nalgebra::Unit::new_normalize(Vector3::new(axis.cos(), axis.sin(), 0.0));
        let rotation = Rotation3::from_axis_angle(&axis, tilt) * Rotation3::from_axis_angle(&Vector3::z_axis(), roll);
        let [x, y] = camera.ray(pixel[0], pixel[1]);
        let translation = Vector3::new(x * z, y * z, z) - rotation * Vector3::new(center[0], center[1], 0.0);
        Pose { rotation, translation }
    }

    pub fn apply(&self, p: [f64; 2]) -> Vector3<f64> {
        self.rotation * Vector3::new(p[0], p[1], 0.0) + self.translation
    }
}

pub struct Scene<'a> {
    pub camera: Camera,
    pub pose: Pose,
    pub texture: &'a Texture,
    /// Random shapes behind the board.
    pub clutter: bool,
    /// Relative fall of the light over the image, and the direction of the fall (rad).
    pub light: [f64; 2],
    /// Gaussian blur, px.
    pub blur: f64,
    /// Noise over the range.
    pub noise: f64,
    /// Grey value of reflectance 1, and bits.
    pub white: f64,
    pub bits: u8,
    /// Rays along one side of a pixel.
    pub rays: usize,
    pub seed: u64,
}

impl<'a> Scene<'a> {
    pub fn new(camera: Camera, pose: Pose, texture: &'a Texture, seed: u64) -> Scene<'a> {
        Scene {
            camera,
            pose,
            texture,
            clutter: true,
            light: [0.4, seed as f64],
            blur: 0.7,
            noise: 0.015,
            white: 240.0,
            bits: 8,
            rays: 5,
            seed,
        }
    }

    /// Where a board point is seen.
    pub fn truth(&self, p: [f64; 2]) -> [f64; 2] {
        self.camera.project(self.pose.apply(p))
    }

    pub fn render(&self) -> GrayImage {
        let Camera { width, height, .. } = self.camera;
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let background = self.background(&mut rng);
        let rays: Vec<[f64; 2]> = (0..(width + 1) * (height + 1))
            .map(|i| self.camera.ray((i % (width + 1)) as f64 - 0.5, (i / (width + 1)) as f64 - 0.5))
            .collect();
        let inverse = self.pose.rotation.inverse();
        let origin = inverse * -self.pose.translation;
        let mut data = vec![0.0; width * height];
        for y in 0..height {
            for x in 0..width {
                let corner = |dx: usize, dy: usize| rays[(y + dy) * (width + 1) + x + dx];
                let (a, b, c, d) = (corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1));
                let mut sum = 0.0;
                for i in 0..self.rays * self.rays {
                    let fraction = |k: usize| (k as f64 + 0.5) / self.rays as f64;
                    let (s, t) = (fraction(i % self.rays), fraction(i / self.rays));
                    let mix = |k: usize| (1.0 - t) * ((1.0 - s) * a[k] + s * b[k]) + t * ((1.0 - s) * c[k] + s * d[k]);
                    let ray = inverse * Vector3::new(mix(0), mix(1), 1.0);
                    let distance = -origin.z / ray.z;
                    let hit = (distance > 0.0)
                        .then(|| self.texture.at(origin.x + distance * ray.x, origin.y + distance * ray.y))
                        .flatten();
                    sum += hit.unwrap_or(background[y * width + x]);
                }
                data[y * width + x] = sum / (self.rays * self.rays) as f64;
            }
        }
        let blurred = blur(&data, width, height, self.blur);
        let full = if self.bits <= 8 { 255.0 } else { 65_535.0 };
        let (sin, cos) = self.light[1].sin_cos();
        let data = blurred
            .iter()
            .enumerate()
            .map(|(i, v)| {
                let (x, y) = ((i % width) as f64 / width as f64 - 0.5, (i / width) as f64 / width as f64 - 0.5);
                let light = 1.0 + self.light[0] * (cos * x + sin * y);
                let noise: f64 = StandardNormal.sample(&mut rng);
                (self.white * (v * light + self.noise * noise)).round().clamp(0.0, full) as u16
            })
            .collect();
        GrayImage { width, height, data, bits: self.bits }
    }

    fn background(&self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let Camera { width, height, .. } = self.camera;
        let base = rng.random_range(0.03..0.25);
        let mut data = vec![base; width * height];
        if !self.clutter {
            return data;
        }
        for _ in 0..60 {
            let grey = rng.random_range(0.02..0.8);
            let (cx, cy) = (rng.random_range(0.0..width as f64), rng.random_range(0.0..height as f64));
            let (a, b) = (rng.random_range(2.0..60.0), rng.random_range(2.0..60.0));
            let (round, turn) = (rng.random_bool(0.5), rng.random_range(0.0..3.1f64));
            let (sin, cos) = turn.sin_cos();
            for y in 0..height {
                for x in 0..width {
                    let (dx, dy) = (x as f64 - cx, y as f64 - cy);
                    let (p, q) = ((cos * dx + sin * dy) / a, (cos * dy - sin * dx) / b);
                    if if round { p * p + q * q < 1.0 } else { p.abs().max(q.abs()) < 1.0 } {
                        data[y * width + x] = grey;
                    }
                }
            }
        }
        data
    }
}

fn blur(data: &[f64], width: usize, height: usize, sigma: f64) -> Vec<f64> {
    if sigma <= 0.0 {
        return data.to_vec();
    }
    let radius = (4.0 * sigma).ceil() as i64;
    let kernel: Vec<f64> = (-radius..=radius).map(|i| (-((i * i) as f64) / (2.0 * sigma * sigma)).exp()).collect();
    let total: f64 = kernel.iter().sum();
    let pass = |input: &[f64], horizontal: bool| -> Vec<f64> {
        (0..width * height)
            .map(|i| {
                let (x, y) = ((i % width) as i64, (i / width) as i64);
                let sum: f64 = (-radius..=radius)
                    .zip(&kernel)
                    .map(|(d, k)| {
                        let (x, y) = if horizontal { (x + d, y) } else { (x, y + d) };
                        let (x, y) = (x.clamp(0, width as i64 - 1), y.clamp(0, height as i64 - 1));
                        k * input[y as usize * width + x as usize]
                    })
                    .sum();
                sum / total
            })
            .collect()
    };
    pass(&pass(data, true), false)
}
