//! The print of a board: reflectance as a function of the position in mm.

use depthcal_model::target::{Pattern, Target};

use super::tag_print::{Style, TagPrint};

pub struct Texture {
    pub target: Target,
    /// Paper beyond the outermost markers, mm.
    pub margin: f64,
    pub paper: f64,
    pub ink: f64,
    /// A drawn board (ChArUco, tags): grey values, width, px per mm, and the place of its first pixel's corner, mm.
    pub raster: Option<(Vec<u8>, usize, f64, [f64; 2])>,
    /// The print of a board with tags.
    pub tags: Option<TagPrint>,
}

impl Texture {
    pub fn new(target: Target, margin: f64) -> Texture {
        Texture { target, margin, paper: 0.9, ink: 0.1, raster: None, tags: None }
    }

    /// A board with tags.
    pub fn with_tags(target: Target, margin: f64, style: Style) -> Texture {
        let tags = Some(TagPrint::new(&target, style));
        Texture { tags, ..Texture::new(target, margin) }
    }

    /// Bright print on a dark board.
    pub fn inverted(mut self) -> Texture {
        std::mem::swap(&mut self.paper, &mut self.ink);
        self
    }

    /// Reflectance at (x, y), mm; `None` outside the board.
    pub fn at(&self, x: f64, y: f64) -> Option<f64> {
        if let Some((data, width, scale, origin)) = &self.raster {
            let (u, v) = ((x - origin[0]) * scale, (y - origin[1]) * scale);
            let height = data.len() / width;
            if u < 0.0 || v < 0.0 || u >= *width as f64 || v >= height as f64 {
                return None;
            }
            let grey = f64::from(data[v as usize * width + u as usize]) / 255.0;
            return Some(self.ink + (self.paper - self.ink) * grey);
        }
        let [low, high] = self.extent();
        if x < low[0] - self.margin
            || y < low[1] - self.margin
            || x > high[0] + self.margin
            || y > high[1] + self.margin
        {
            return None;
        }
        let s = self.target.spacing_mm;
        let (columns, rows) = (self.target.columns as i64, self.target.rows as i64);
        let dark = match self.target.pattern {
            Pattern::AsymmetricCircles { circle_diameter_mm } | Pattern::SymmetricCircles { circle_diameter_mm } => {
                let shifted = matches!(self.target.pattern, Pattern::AsymmetricCircles { .. });
                let i0 = (y / s).round() as i64;
                (i0 - 1..=i0 + 1).filter(|i| (0..rows).contains(i)).any(|i| {
                    let (pitch, shift) = if shifted { (2.0 * s, (i % 2) as f64 * s) } else { (s, 0.0) };
                    let j = ((x - shift) / pitch).round() as i64;
                    let (dx, dy) = (x - shift - j as f64 * pitch, y - i as f64 * s);
                    (0..columns).contains(&j) && dx.hypot(dy) <= circle_diameter_mm / 2.0
                })
            }
            Pattern::Chessboard => {
                let (j, i) = ((x / s).floor() as i64, (y / s).floor() as i64);
                (-1..columns).contains(&j) && (-1..rows).contains(&i) && (i + j).rem_euclid(2) == 0
            }
            _ => self.tags.as_ref().is_some_and(|tags| tags.is_black(x, y)),
        };
        Some(if dark { self.ink } else { self.paper })
    }

    /// Smallest and largest coordinates of the print.
    fn extent(&self) -> [[f64; 2]; 2] {
        let s = self.target.spacing_mm;
        let (c, r) = (self.target.columns as f64 - 1.0, self.target.rows as f64 - 1.0);
        match self.target.pattern {
            Pattern::AsymmetricCircles { .. } => [[0.0, 0.0], [(2.0 * c + 1.0) * s, r * s]],
            Pattern::SymmetricCircles { .. } => [[0.0, 0.0], [c * s, r * s]],
            Pattern::Chessboard => [[-s, -s], [(c + 1.0) * s, (r + 1.0) * s]],
            Pattern::Charuco { .. } => [[0.0, 0.0], [(c + 1.0) * s, (r + 1.0) * s]],
            Pattern::Aprilgrid { marker_mm } => [[marker_mm - s, marker_mm - s], [(c + 1.0) * s, (r + 1.0) * s]],
            Pattern::Several { .. } => panic!("boards are drawn one by one"),
        }
    }
}
