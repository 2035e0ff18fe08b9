//! The background: a slightly inclined wall, and objects in front of it.

use rand::RngExt;

use crate::rendering::Rendering;
use crate::streams::{Purpose, stream};

/// Intersection of a ray with the background.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Behind {
    pub z: f64,
    pub albedo: f64,
    pub cosine: f64,
}

/// An object: a frontal rectangle.
struct Thing {
    /// x0, y0, x1, y1 in normalised coordinates.
    outline: [f64; 4],
    z: f64,
    albedo: f64,
}

/// The scene without the board.
pub(crate) struct Backdrop {
    /// 1/z = a + b x + c y.
    wall: Option<[f64; 3]>,
    things: Vec<Thing>,
}

impl Backdrop {
    pub fn new(rendering: &Rendering, seed: u64) -> Self {
        let mut rng = stream(seed, Purpose::Background, 0);
        let mut slope = || rng.random_range(-0.08..0.08);
        let (b, c) = (slope(), slope());
        let wall = (rendering.wall_mm > 0.0).then(|| {
            let a = 1.0 / rendering.wall_mm;
            [a, a * b, a * c]
        });
        let farthest = if rendering.wall_mm > 0.0 { rendering.wall_mm } else { rendering.max_range_mm };
        let thing = |_| {
            let (x, y) = (rng.random_range(-0.7..0.7), rng.random_range(-0.55..0.55));
            let (w, h) = (rng.random_range(0.04..0.25), rng.random_range(0.04..0.3));
            // Far enough not to hide the board.
            let z = farthest * rng.random_range(0.8..0.95);
            Thing { outline: [x - w, y - h, x + w, y + h], z, albedo: rng.random_range(0.05..0.7) }
        };
        let mut things: Vec<Thing> = (0..rendering.clutter).map(thing).collect();
        things.sort_by(|p, q| p.z.total_cmp(&q.z));
        Self { wall, things }
    }

    /// Whether there are objects.
    pub fn has_edges(&self) -> bool {
        !self.things.is_empty()
    }

    /// Index of the object that the ray (x, y, 1) meets first; `None` when it meets none.
    pub fn part(&self, [x, y]: [f64; 2]) -> Option<usize> {
        let inside = |[x0, y0, x1, y1]: [f64; 4]| x >= x0 && x <= x1 && y >= y0 && y <= y1;
        self.things.iter().position(|thing| inside(thing.outline))
    }

    /// The first intersection of the ray (x, y, 1) with the background; `None` when there is none.
    pub fn hit(&self, [x, y]: [f64; 2]) -> Option<Behind> {
        let secant = (1.0 + x * x + y * y).sqrt();
        if let Some(thing) = self.part([x, y]).map(|index| &self.things[index]) {
            return Some(Behind { z: thing.z, albedo: thing.albedo, cosine: 1.0 / secant });
        }
        let [a, b, c] = self.wall?;
        let rho = a + b * x + c * y;
        // The plane b x + c y + a = 1/z has the normal (b, c, a).
        let cosine = rho / ((a * a + b * b + c * c).sqrt() * secant);
        (rho > 0.0).then_some(Behind { z: 1.0 / rho, albedo: 0.3, cosine })
    }
}
