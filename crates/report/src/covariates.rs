//! Quantities that a depth error may depend on, and the image as a grid.

use super::input::ReportCamera;
use super::pool::Pool;
use depthcal_calibration::judge::depth_errors::PixelError;
use depthcal_model::Quantities;

/// Bins of a covariate.
pub(super) const BINS: usize = 14;

/// The size of the image, and its division into cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Image {
    pub width: f64,
    pub height: f64,
    /// Principal point, else the middle.
    pub centre: [f64; 2],
}

impl Image {
    /// From the calibrated camera; without one, from the pixels of the evaluated frames.
    pub(super) fn of(camera: &ReportCamera<'_>) -> Self {
        if let Some(c) = camera.calibrated {
            let [_, _, cx, cy, _] = c.camera.pinhole();
            let (width, height) = (c.camera.width as f64, c.camera.height as f64);
            return Self { width, height, centre: [cx, cy] };
        }
        let pool = Pool::of(camera, |_| true);
        let markers = pool.frames.iter().flat_map(|f| f.frame.reprojection.iter().map(|e| [e[0], e[1]]));
        let seen =
            markers.chain(pool.pixels().map(|p| p.context.pixel)).filter(|p| p[0].is_finite() && p[1].is_finite());
        let [width, height] = seen.fold([1.0_f64, 1.0_f64], |m, p| [m[0].max(p[0] + 1.0), m[1].max(p[1] + 1.0)]);
        Self { width, height, centre: [width / 2.0, height / 2.0] }
    }

    /// Columns and rows of square cells, about `columns` of them in a row.
    pub(super) fn grid(&self, columns: usize) -> [usize; 2] {
        [columns, ((columns as f64 * self.height / self.width).round() as usize).clamp(1, 4 * columns)]
    }

    /// Row-major cell of a pixel in a grid.
    pub(super) fn cell(&self, [columns, rows]: [usize; 2], pixel: [f64; 2]) -> Option<usize> {
        let t = [(pixel[0] + 0.5) / self.width, (pixel[1] + 0.5) / self.height];
        let inside = t.iter().all(|t| (0.0..1.0).contains(t));
        inside.then(|| (t[1] * rows as f64) as usize * columns + (t[0] * columns as f64) as usize)
    }

    /// Middle of a cell, px.
    pub(super) fn middle(&self, [columns, rows]: [usize; 2], cell: usize) -> [f64; 2] {
        let middle = |i: usize, n: usize, size: f64| (i as f64 + 0.5) * size / n as f64 - 0.5;
        [middle(cell % columns, columns, self.width), middle(cell / columns, rows, self.height)]
    }

    /// Where a pixel lies, in words.
    pub(super) fn place(&self, [u, v]: [f64; 2]) -> String {
        let third = |x: f64, size: f64| ((3.0 * (x + 0.5) / size) as usize).min(2);
        let row = ["upper", "", "lower"][third(v, self.height)];
        let column = ["left", "", "right"][third(u, self.width)];
        let words = [row, column].iter().filter(|w| !w.is_empty()).copied().collect::<Vec<_>>().join(" ");
        let part = if words.is_empty() { "in the middle".to_owned() } else { format!("in the {words} part") };
        format!("{part} of the image, around pixel ({u:.0}, {v:.0})")
    }
}

/// The value of a quantity at a pixel.
type Value = Box<dyn Fn(&PixelError) -> f64 + Send + Sync>;

/// A quantity that an error may depend on.
pub(super) struct Covariate {
    /// Identifier in the page, such as `depth` in `against-depth`.
    pub id: &'static str,
    /// As in "against the distance".
    pub name: &'static str,
    pub unit: &'static str,
    /// The quantity in words, and what a dependence on it indicates.
    pub hint: &'static str,
    pub value: Value,
}

/// All covariates, the quantities that users record among them. Data in which one is unknown or constant have no axis for it.
pub(super) fn all(camera: &ReportCamera<'_>, image: &Image) -> Vec<Covariate> {
    let pool = Pool::of(camera, |_| true);
    let recorded =
        Quantities::names_of(pool.pixels().map(|p| &p.context.quantities)).into_iter().map(|quantity| Covariate {
            id: quantity.name(),
            name: quantity.name(),
            unit: if quantity.unit() == "1" { "" } else { quantity.unit() },
            hint: "Of the frame, as its column of frames.csv has it.",
            value: Box::new(move |p| p.context.quantities.value(quantity)),
        });
    usual(image).into_iter().chain(recorded).collect()
}

/// Those of every capture.
fn usual(image: &Image) -> Vec<Covariate> {
    let centre = image.centre;
    let new = |id, name, unit, hint, value: Value| Covariate { id, name, unit, hint, value };
    vec![
        new(
            "depth",
            "distance",
            "mm",
            "D describes a straight line in inverse distance, but neither waves nor a bend.",
            Box::new(|p| p.board_depth_mm),
        ),
        new(
            "incidence",
            "angle of incidence",
            "°",
            "0°: a board that faces the camera. A trend indicates an effect of the surface or of the emitter's geometry.",
            Box::new(|p| p.cos_incidence.clamp(-1.0, 1.0).abs().acos().to_degrees()),
        ),
        new(
            "radius",
            "radius in the image",
            "px",
            "Distance from the principal point. A trend indicates a lens error, or range that is reported as depth.",
            Box::new(move |p| (p.context.pixel[0] - centre[0]).hypot(p.context.pixel[1] - centre[1])),
        ),
        new(
            "amplitude",
            "infrared amplitude",
            "image steps",
            "Brightness of the pixel. A trend indicates an error that depends on reflectivity or exposure.",
            Box::new(|p| p.context.amplitude),
        ),
        new(
            "surround",
            "brightness of the surroundings",
            "ln of ratio to the pixel",
            "Above zero: a dark pixel among brighter ones. A trend indicates that signals of neighbouring pixels mix.",
            Box::new(|p| (p.context.surround / p.context.amplitude).ln()),
        ),
        new(
            "time",
            "time",
            "s",
            "Since the first frame. A trend indicates a camera that was still warming up.",
            Box::new(|p| p.context.time_s),
        ),
        new(
            "temperature",
            "temperature",
            "°C",
            "Temperature of the frame, as the dataset declares it.",
            Box::new(|p| p.context.temperature_c),
        ),
    ]
}
