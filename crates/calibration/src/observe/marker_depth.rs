//! Depth at markers, interpolated from a plane that is fitted to the depth around each marker.

use depthcal_model::Target;
use depthcal_statistics::{Thinning, upper_median};
use nalgebra::{Matrix3, Vector3};

use super::board_pixels::BoardPixel;

/// Radius around a marker within which pixels support its plane, in distances between neighbouring markers.
const SUPPORT: f64 = 1.1;
/// Fewest supporting pixels.
const FEWEST_PIXELS: usize = 12;
/// Most pixels that support a marker in the middle of the board, about: of more, a scattered part. Noise that is left of so many
/// is a few per cent of a pixel's.
const MOST_PIXELS: f64 = 1000.0;
/// Residuals beyond this many robust standard deviations are excluded from the fit.
const GATE: f64 = 3.5;

/// Measured inverse depth (1/mm) at every marker (index and ray), interpolated from an affine function of the ray, which is
/// exact for planes, that is fitted robustly to the board pixels around the marker. `None` where too few pixels are valid or
/// where they lie on one side of the marker only.
pub fn marker_inverse_depths(
    target: &Target,
    markers: &[(usize, [f64; 2])],
    pixels: &[BoardPixel],
) -> Vec<Option<f64>> {
    let radius = SUPPORT * nearest_distance(target);
    let cells = Cells::of(pixels, radius);
    let mut support = Vec::new();
    markers
        .iter()
        .map(|(index, ray)| {
            support.clear();
            cells.within(target.point(*index), &mut |i| {
                let q = &pixels[i];
                support.push(Supporting {
                    x: q.ray[0] - ray[0],
                    y: q.ray[1] - ray[1],
                    inverse_depth: 1.0 / q.depth_mm,
                });
            });
            value_at_marker(&mut support)
        })
        .collect()
}

/// Smallest distance between two markers, mm.
fn nearest_distance(target: &Target) -> f64 {
    let points = target.points();
    let first = points.first().copied().unwrap_or([0.0; 2]);
    let others = points.iter().skip(1).map(|p| (p[0] - first[0]).hypot(p[1] - first[1]));
    others.fold(f64::INFINITY, f64::min)
}

/// Pixels sorted into square cells of the board as wide as the search radius.
struct Cells<'a> {
    pixels: &'a [BoardPixel],
    radius: f64,
    low: [f64; 2],
    columns: usize,
    rows: usize,
    /// First entry of every cell in `order`, and the end of the last.
    starts: Vec<u32>,
    /// Those of the pixels that may support a marker, by cell; within a cell in their own order.
    order: Vec<u32>,
}

impl<'a> Cells<'a> {
    fn of(pixels: &'a [BoardPixel], radius: f64) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in pixels {
            for i in 0..2 {
                low[i] = low[i].min(p.board[i]);
                high[i] = high[i].max(p.board[i]);
            }
        }
        let count = |i: usize| if high[i] >= low[i] { ((high[i] - low[i]) / radius) as usize + 1 } else { 0 };
        let (columns, rows) = (count(0), count(1));
        let mut cells =
            Self { pixels, radius, low, columns, rows, starts: vec![0; columns * rows + 1], order: Vec::new() };
        let area = |side: f64| (high[0] - low[0]).max(side) * (high[1] - low[1]).max(side);
        let share = std::f64::consts::PI * radius * radius / area(radius);
        let thinning = Thinning::new(pixels.len(), (MOST_PIXELS / share) as usize);
        let thinned = pixels.iter().enumerate().filter(|(number, _)| thinning.keeps(*number as u64));
        let pixel_cells: Vec<(u32, u32)> = thinned.map(|(number, p)| (number as u32, cells.cell(p.board))).collect();
        for (_, cell) in &pixel_cells {
            cells.starts[*cell as usize + 1] += 1;
        }
        for i in 1..cells.starts.len() {
            cells.starts[i] += cells.starts[i - 1];
        }
        let mut next = cells.starts.clone();
        cells.order.resize(pixel_cells.len(), 0);
        for (number, cell) in &pixel_cells {
            cells.order[next[*cell as usize] as usize] = *number;
            next[*cell as usize] += 1;
        }
        cells
    }

    fn cell(&self, point: [f64; 2]) -> u32 {
        let cell = [0, 1].map(|i| ((point[i] - self.low[i]) / self.radius) as usize);
        (cell[1].min(self.rows - 1) * self.columns + cell[0].min(self.columns - 1)) as u32
    }

    /// Calls `take` with every pixel within the radius of a board point.
    fn within(&self, point: [f64; 2], take: &mut impl FnMut(usize)) {
        let position = [0, 1].map(|i| ((point[i] - self.low[i]) / self.radius).floor());
        let range =
            |i: usize, n: usize| (position[i] - 1.0).max(0.0) as usize..((position[i] + 2.0).max(0.0) as usize).min(n);
        for row in range(1, self.rows) {
            for column in range(0, self.columns) {
                let cell = row * self.columns + column;
                for i in &self.order[self.starts[cell] as usize..self.starts[cell + 1] as usize] {
                    let board = self.pixels[*i as usize].board;
                    if (board[0] - point[0]).powi(2) + (board[1] - point[1]).powi(2) <= self.radius * self.radius {
                        take(*i as usize);
                    }
                }
            }
        }
    }
}

/// A pixel that supports a marker's plane: its ray relative to the marker's, and its measured inverse depth, 1/mm.
#[derive(Debug, Clone, Copy)]
struct Supporting {
    x: f64,
    y: f64,
    inverse_depth: f64,
}

/// The inverse depth at the marker of the plane through its support; `support` is reordered and loses its outliers.
fn value_at_marker(kept: &mut Vec<Supporting>) -> Option<f64> {
    let mut value = None;
    let mut sizes = Vec::with_capacity(kept.len());
    for _ in 0..5 {
        if kept.len() < FEWEST_PIXELS {
            return None;
        }
        // Coordinates are relative to the marker: the constant of the plane is the value at the marker.
        let (mut normal, mut rhs) = (Matrix3::zeros(), Vector3::zeros());
        for q in &*kept {
            let row = Vector3::new(q.x, q.y, 1.0);
            normal += row * row.transpose();
            rhs += row * q.inverse_depth;
        }
        // A marker outside its supporting pixels would be extrapolated, which the variance of the constant shows.
        let inverse = normal.try_inverse()?;
        if inverse.m33 * kept.len() as f64 > 4.0 {
            return None;
        }
        let plane = inverse * rhs;
        value = Some(plane.z).filter(|v| v.is_finite() && *v > 0.0);
        let residual = |q: &Supporting| (q.inverse_depth - (plane.x * q.x + plane.y * q.y + plane.z)).abs();
        sizes.clear();
        sizes.extend(kept.iter().map(residual));
        let sigma = 1.4826 * upper_median(&mut sizes)?;
        let before = kept.len();
        kept.retain(|q| residual(q) <= GATE * sigma);
        if kept.len() == before || sigma == 0.0 {
            break;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use depthcal_model::Pattern;

    /// A tilted plane with a hole at the marker and gross outliers: the plane's value there comes back exactly, from few pixels
    /// and from so many that only a part of them supports the plane.
    #[test]
    fn a_plane_is_interpolated_through_a_hole_despite_outliers() {
        let target = Target {
            pattern: Pattern::SymmetricCircles { circle_diameter_mm: 8.0 },
            columns: 3,
            rows: 3,
            spacing_mm: 30.0,
        };
        let plane = |x: f64, y: f64| 2e-4 * x - 1e-4 * y + 1.25e-3;
        for (reach, step_mm) in [(20, 1.5), (90, 0.34)] {
            let mut pixels = Vec::new();
            for i in -reach..=reach {
                for j in -reach..=reach {
                    let board = [30.0 + step_mm * f64::from(i), 30.0 + step_mm * f64::from(j)];
                    if (board[0] - 30.0).hypot(board[1] - 30.0) < 6.0 {
                        continue;
                    }
                    let ray = [board[0] / 800.0, board[1] / 800.0];
                    let outlier = if (i * 7 + j * 3) % 11 == 0 { 1.1 } else { 1.0 };
                    let depth_mm = outlier / plane(ray[0], ray[1]);
                    pixels.push(BoardPixel {
                        number: 0,
                        pixel: [0.0; 2],
                        depth_mm,
                        board_depth_mm: depth_mm,
                        board,
                        ray,
                        cos_incidence: 1.0,
                    });
                }
            }
            let ray = [30.0 / 800.0, 30.0 / 800.0];
            let inverse_depth = marker_inverse_depths(&target, &[(4, ray)], &pixels)[0].unwrap();
            assert!((inverse_depth / plane(ray[0], ray[1]) - 1.0).abs() < 1e-9, "{inverse_depth}");
            assert_eq!(marker_inverse_depths(&target, &[(4, ray)], &[]), [None], "no pixels");
        }
    }

    /// The cells change nothing: the same pixels as by comparing all.
    #[test]
    fn cells_find_every_supporting_pixel() {
        let pixels: Vec<BoardPixel> = (0..500_u32)
            .map(|i| BoardPixel {
                number: i,
                pixel: [0.0; 2],
                cos_incidence: 1.0,
                depth_mm: 500.0,
                board_depth_mm: 500.0,
                board: [f64::from(i * 37 % 101) * 1.7 - 20.0, f64::from(i * 53 % 97) * 1.3 - 15.0],
                ray: [0.0; 2],
            })
            .collect();
        let cells = Cells::of(&pixels, 22.0);
        for p in [[0.0, 0.0], [-40.0, 30.0], [75.0, 60.0], [160.0, 110.0], [500.0, 0.0]] {
            let mut within = Vec::new();
            cells.within(p, &mut |i| within.push(i));
            within.sort_unstable();
            let near = |q: &BoardPixel| (q.board[0] - p[0]).powi(2) + (q.board[1] - p[1]).powi(2) <= 22.0 * 22.0;
            let all: Vec<usize> = (0..pixels.len()).filter(|i| near(&pixels[*i])).collect();
            assert_eq!(within, all, "{p:?}");
        }
    }
}
