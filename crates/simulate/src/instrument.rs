//! The camera and board of one simulation with everything that is wrong with them: effects install themselves here.

use crate::board::Board;
use crate::camera::CameraTruth;
use crate::conditions::Conditions;
use crate::optics::Optics;

/// What a depth pixel sees, before any error. Depth effects may look at all of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reading {
    /// The pixel of the depth image.
    pub pixel: [f64; 2],
    /// The ray (x, y, 1) along which it measures.
    pub ray: [f64; 2],
    /// Cosine of the angle of incidence.
    pub cosine: f64,
    /// Infrared signal at the pixel, 1 = full scale of the image.
    pub amplitude: f64,
    /// The frame.
    pub conditions: Conditions,
}

impl Reading {
    /// Range over depth: the length of the ray (x, y, 1).
    pub fn range_over_depth(&self) -> f64 {
        (1.0 + self.ray[0] * self.ray[0] + self.ray[1] * self.ray[1]).sqrt()
    }
}

/// Where in the measurement an effect acts; the order is that of the stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stage {
    /// Light and its travel: acts on depth.
    Signal,
    /// Triangulation: acts on disparity.
    Disparity,
    /// After the projective distortion: what the camera makes of its own measurement.
    Output,
}

/// An effect on the measured inverse depth.
pub(crate) trait DepthEffect: Send + Sync {
    /// Where it acts.
    fn stage(&self) -> Stage;
    /// The inverse depth with the effect, from `rho` without it, 1/mm.
    fn distort(&self, at: &Reading, rho: f64) -> f64;
}

/// Inverse depth after the depth has grown by `dz` mm.
pub(crate) fn with_depth_added(rho: f64, dz: f64) -> f64 {
    rho / (1.0 + rho * dz)
}

/// How the real board departs from its design.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BoardShape {
    /// Height h = a ξ² + b η² + c ξ η, mm, ξ and η from −1 to 1 over the markers.
    pub bow: [f64; 3],
    /// Elongation of the print along y.
    pub stretch_y: f64,
    centre: [f64; 2],
    half: [f64; 2],
}

impl BoardShape {
    pub fn flat(board: &Board) -> Self {
        let [x0, y0, x1, y1] = board.marker_rectangle();
        let half = [(x1 - x0) / 2.0, (y1 - y0) / 2.0].map(|h: f64| h.max(1.0));
        Self { bow: [0.0; 3], stretch_y: 0.0, centre: board.centre(), half }
    }

    pub fn is_flat(&self) -> bool {
        self.bow == [0.0; 3]
    }

    /// Position of the designed point (x, y) on the real board, mm.
    pub fn real(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        let y = y * (1.0 + self.stretch_y);
        [x, y, self.height([x, y]).0]
    }

    /// The designed point that lies at (x, y) of the real board, mm.
    pub fn designed(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x, y / (1.0 + self.stretch_y)]
    }

    /// Height at (x, y) of the real board, mm, and its gradient.
    pub fn height(&self, [x, y]: [f64; 2]) -> (f64, [f64; 2]) {
        let [a, b, c] = self.bow;
        let (xi, eta) = ((x - self.centre[0]) / self.half[0], (y - self.centre[1]) / self.half[1]);
        let height = a * xi * xi + b * eta * eta + c * xi * eta;
        (height, [(2.0 * a * xi + c * eta) / self.half[0], (2.0 * b * eta + c * xi) / self.half[1]])
    }
}

/// Camera and board as they are.
pub(crate) struct Instrument {
    pub optics: Optics,
    pub shape: BoardShape,
    /// The depth image is displaced against the image by this many pixels.
    pub registration: [f64; 2],
    /// dx, dy, dz, dw.
    pub projective: [f64; 4],
    effects: Vec<Box<dyn DepthEffect>>,
}

impl Instrument {
    /// Camera and board without effects.
    pub fn new(camera: &CameraTruth, board: &Board) -> Self {
        Self {
            optics: Optics::new(camera),
            shape: BoardShape::flat(board),
            registration: [0.0, 0.0],
            projective: camera.depth,
            effects: Vec::new(),
        }
    }

    /// Adds an effect behind those of its stage.
    pub fn add(&mut self, effect: Box<dyn DepthEffect>) {
        let at = self.effects.partition_point(|other| other.stage() <= effect.stage());
        self.effects.insert(at, effect);
    }

    /// The pixel of the image that shows what the depth image shows at `pixel`.
    pub fn image_pixel(&self, pixel: [f64; 2]) -> [f64; 2] {
        [pixel[0] - self.registration[0], pixel[1] - self.registration[1]]
    }

    /// Inverse depth with the depth effects only, without the projective distortion, from a depth that has them not.
    pub fn distort(&self, at: &Reading, rho: f64) -> f64 {
        self.effects.iter().fold(rho, |rho, effect| effect.distort(at, rho))
    }

    /// Measured inverse depth, without noise, from the true one.
    pub fn measure(&self, at: &Reading, rho: f64) -> f64 {
        let [dx, dy, dz, dw] = self.projective;
        let before = self.effects.partition_point(|effect| effect.stage() < Stage::Output);
        let run = |effects: &[Box<dyn DepthEffect>], rho| effects.iter().fold(rho, |rho, e| e.distort(at, rho));
        let rho = run(&self.effects[..before], rho);
        run(&self.effects[before..], dx * at.ray[0] + dy * at.ray[1] + dz + dw * rho)
    }
}
