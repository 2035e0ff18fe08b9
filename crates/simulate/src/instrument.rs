//! Camera and board of one simulation with all their errors; effects are installed here.

use crate::board::Board;
use crate::camera::CameraTruth;
use crate::conditions::Conditions;
use crate::optics::Optics;

/// The error-free measurement of a depth pixel, as depth effects see it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reading {
    /// The pixel of the depth image.
    pub pixel: [f64; 2],
    /// Its ray (x, y, 1).
    pub ray: [f64; 2],
    /// Cosine of the angle of incidence.
    pub cosine: f64,
    /// Infrared signal at the pixel, 1 = full scale of the image.
    pub amplitude: f64,
    /// Time and temperature of the frame.
    pub conditions: Conditions,
}

impl Reading {
    /// Range over depth: the length of the ray (x, y, 1).
    pub fn range_over_depth(&self) -> f64 {
        (1.0 + self.ray[0] * self.ray[0] + self.ray[1] * self.ray[1]).sqrt()
    }
}

/// Stage of the measurement at which an effect acts, in the order of the stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stage {
    /// Emission, travel and detection of light: acts on depth.
    Signal,
    /// Triangulation: acts on disparity.
    Disparity,
    /// After the projective distortion: acts on the camera's output.
    Output,
}

/// An effect on the measured inverse depth.
pub(crate) trait DepthEffect: Send + Sync {
    /// The stage at which it acts.
    fn stage(&self) -> Stage;
    /// Inverse depth with the effect, 1/mm, given the inverse depth `rho` without it, 1/mm.
    fn distort(&self, at: &Reading, rho: f64) -> f64;
}

/// Inverse depth after adding `dz` mm to the depth.
pub(crate) fn with_depth_added(rho: f64, dz: f64) -> f64 {
    rho / (1.0 + rho * dz)
}

/// A wave of the board's surface along one of its sides: height sin(radians t), t from −1 to 1.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct SurfaceWave {
    /// Amplitude, mm.
    pub height: f64,
    /// Radians per half of the side.
    pub radians: f64,
}

impl SurfaceWave {
    /// Height at t and its derivative.
    pub fn at(&self, t: f64) -> (f64, f64) {
        let (sin, cos) = (self.radians * t).sin_cos();
        (self.height * sin, self.height * self.radians * cos)
    }
}

/// Deviation of the real board from its design.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BoardShape {
    /// Height h = a ξ² + b η² + c ξ η, mm, ξ and η from −1 to 1 over the markers.
    pub bow: [f64; 3],
    /// Waves of the surface along ξ and along η, added to h.
    pub waves: [SurfaceWave; 2],
    /// Relative elongation of the print along y.
    pub stretch_y: f64,
    centre: [f64; 2],
    half: [f64; 2],
}

impl BoardShape {
    pub fn flat(board: &Board) -> Self {
        let [x0, y0, x1, y1] = board.marker_rectangle();
        let half = [(x1 - x0) / 2.0, (y1 - y0) / 2.0].map(|h: f64| h.max(1.0));
        Self { bow: [0.0; 3], waves: Default::default(), stretch_y: 0.0, centre: board.centre(), half }
    }

    pub fn is_flat(&self) -> bool {
        self.bow == [0.0; 3] && self.waves.iter().all(|w| w.height == 0.0)
    }

    /// Position on the real board of the point (x, y) of the design, mm.
    pub fn real(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        let y = y * (1.0 + self.stretch_y);
        [x, y, self.height([x, y]).0]
    }

    /// Point of the design that lies at (x, y) of the real board, mm.
    pub fn designed(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x, y / (1.0 + self.stretch_y)]
    }

    /// Height at (x, y) of the real board, mm, and its gradient.
    pub fn height(&self, [x, y]: [f64; 2]) -> (f64, [f64; 2]) {
        let [a, b, c] = self.bow;
        let (xi, eta) = ((x - self.centre[0]) / self.half[0], (y - self.centre[1]) / self.half[1]);
        let [(along_xi, by_xi), (along_eta, by_eta)] = [self.waves[0].at(xi), self.waves[1].at(eta)];
        let height = a * xi * xi + b * eta * eta + c * xi * eta + along_xi + along_eta;
        (height, [(2.0 * a * xi + c * eta + by_xi) / self.half[0], (2.0 * b * eta + c * xi + by_eta) / self.half[1]])
    }
}

/// Light that the lens spreads over the image. Only rendered images have it: single points have no scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scattering {
    /// Share of the light of the scene that falls on every pixel.
    pub share: f64,
    /// Delay by as much light of the nearest pixels as the pixel's own, rad at 80 MHz.
    pub delay_rad: f64,
}

/// Camera and board with their effects.
pub(crate) struct Instrument {
    pub optics: Optics,
    pub shape: BoardShape,
    /// Displacement (du, dv) of the depth image relative to the image, px.
    pub registration: [f64; 2],
    /// dx, dy, dz, dw.
    pub projective: [f64; 4],
    pub scattering: Option<Scattering>,
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
            scattering: None,
            effects: Vec::new(),
        }
    }

    /// Adds an effect after those of its stage.
    pub fn add(&mut self, effect: Box<dyn DepthEffect>) {
        let index = self.effects.partition_point(|other| other.stage() <= effect.stage());
        self.effects.insert(index, effect);
    }

    /// Its effects on depth.
    pub fn into_effects(self) -> Vec<Box<dyn DepthEffect>> {
        self.effects
    }

    /// Position in the image of what the depth image shows at `pixel`, px.
    pub fn image_pixel(&self, pixel: [f64; 2]) -> [f64; 2] {
        [pixel[0] - self.registration[0], pixel[1] - self.registration[1]]
    }

    /// Applies the depth effects to an inverse depth (1/mm), without the projective distortion.
    pub fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        self.effects.iter().fold(rho, |rho, effect| effect.distort(reading, rho))
    }

    /// Measured inverse depth without noise, given the true inverse depth, 1/mm.
    pub fn measure(&self, reading: &Reading, rho: f64) -> f64 {
        let [dx, dy, dz, dw] = self.projective;
        let before = self.effects.partition_point(|effect| effect.stage() < Stage::Output);
        let run = |effects: &[Box<dyn DepthEffect>], rho| effects.iter().fold(rho, |rho, e| e.distort(reading, rho));
        let rho = run(&self.effects[..before], rho);
        run(&self.effects[before..], dx * reading.ray[0] + dy * reading.ray[1] + dz + dw * rho)
    }
}
