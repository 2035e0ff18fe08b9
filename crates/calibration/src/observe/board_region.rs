//! The region of a board whose depth is used.

use depthcal_model::{Pattern, Target};

use depthcal_io::MarkerObservation;

/// Pixels nearer than this to a dot's edge are excluded: depth on the dark print and at its rim is unreliable.
pub const MARKER_MARGIN_PX: f64 = 1.5;

/// The region of the board whose depth is used: the convex hull of the markers, without dots and their surroundings.
#[derive(Debug, Clone)]
pub struct BoardRegion {
    hull: Vec<[f64; 2]>,
    dots: Option<DotGrid>,
}

impl BoardRegion {
    /// The region within all markers of a board.
    pub fn new(target: &Target) -> Self {
        Self { hull: convex_hull(target.points()), dots: DotGrid::of(target) }
    }

    /// The region within the markers that were found in a frame. What lies beyond them may be hidden, or be no board.
    pub fn within_markers(target: &Target, markers: &[MarkerObservation]) -> Self {
        let marker_points = markers.iter().map(|m| target.point(m.index)).collect();
        Self { hull: convex_hull(marker_points), dots: DotGrid::of(target) }
    }

    /// Corners of the convex hull in order, board frame, mm.
    pub fn hull(&self) -> &[[f64; 2]] {
        &self.hull
    }

    /// Whether a board point (mm) is in the region; `mm_per_px` is the size of a pixel on the board there.
    pub fn contains(&self, point: [f64; 2], mm_per_px: f64) -> bool {
        let [x, y] = point;
        let n = self.hull.len();
        let inside = n > 2
            && (0..n).all(|i| {
                let (a, b) = (self.hull[i], self.hull[(i + 1) % n]);
                (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) >= 0.0
            });
        inside && self.dots.as_ref().is_none_or(|dots| !dots.any_within(point, MARKER_MARGIN_PX * mm_per_px))
    }
}

/// The dots of a board, sorted into cells as wide as their distance, so that only near ones are looked at.
#[derive(Debug, Clone)]
struct DotGrid {
    cells: Vec<Vec<[f64; 2]>>,
    columns: usize,
    low: [f64; 2],
    cell_mm: f64,
    radius_mm: f64,
}

impl DotGrid {
    /// `None` for boards without dots.
    fn of(target: &Target) -> Option<Self> {
        if !matches!(target.pattern, Pattern::AsymmetricCircles { .. } | Pattern::SymmetricCircles { .. }) {
            return None;
        }
        let dots = target.points();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for dot in &dots {
            for i in 0..2 {
                low[i] = low[i].min(dot[i]);
                high[i] = high[i].max(dot[i]);
            }
        }
        let cell_mm = target.spacing_mm;
        // A cell of margin all round: neighbours of every point inside the hull exist.
        let low = low.map(|l| l - cell_mm);
        let [columns, rows] = [0, 1].map(|i| ((high[i] - low[i]) / cell_mm) as usize + 2);
        let radius_mm = target.circle_diameter_mm().unwrap_or(0.0) / 2.0;
        let mut grid = Self { cells: vec![Vec::new(); columns * rows], columns, low, cell_mm, radius_mm };
        for dot in dots {
            if let Some([column, row]) = grid.cell(dot) {
                grid.cells[row * columns + column].push(dot);
            }
        }
        Some(grid)
    }

    fn cell(&self, point: [f64; 2]) -> Option<[usize; 2]> {
        let position = [0, 1].map(|i| (point[i] - self.low[i]) / self.cell_mm);
        let rows = self.cells.len() / self.columns;
        let inside =
            position[0] >= 0.0 && position[1] >= 0.0 && position[0] < self.columns as f64 && position[1] < rows as f64;
        inside.then(|| position.map(|t| t as usize))
    }

    /// Whether the edge of any dot is nearer than `margin_mm`. Margins of more than a cell reach a dot everywhere on the board.
    fn any_within(&self, point: [f64; 2], margin_mm: f64) -> bool {
        let reach = self.radius_mm + margin_mm;
        if reach >= self.cell_mm {
            return true;
        }
        let Some([column, row]) = self.cell(point) else { return false };
        let rows = self.cells.len() / self.columns;
        let near = |at: usize, n: usize| at.saturating_sub(1)..(at + 2).min(n);
        near(row, rows).any(|r| {
            near(column, self.columns).any(|c| {
                let dots = &self.cells[r * self.columns + c];
                dots.iter().any(|d| (d[0] - point[0]).powi(2) + (d[1] - point[1]).powi(2) <= reach * reach)
            })
        })
    }
}

/// Convex hull, counter-clockwise in a frame with y up (Andrew's monotone chain).
fn convex_hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let turn = |o: [f64; 2], a: [f64; 2], b: [f64; 2]| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while chain.len() >= 2 && turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target() -> Target {
        Target {
            pattern: Pattern::SymmetricCircles { circle_diameter_mm: 10.0 },
            columns: 3,
            rows: 3,
            spacing_mm: 30.0,
        }
    }

    #[test]
    fn the_region_is_the_hull_without_the_dots() {
        let region = BoardRegion::new(&target());
        assert_eq!(region.hull().len(), 4);
        assert!(region.contains([15.0, 15.0], 1.0), "between four dots");
        assert!(!region.contains([30.0, 30.0], 1.0), "on a dot");
        assert!(!region.contains([36.4, 30.0], 1.0), "within 1.5 px of a dot");
        assert!(region.contains([36.6, 30.0], 1.0), "beyond that margin");
        assert!(!region.contains([-0.1, 15.0], 1.0), "outside the markers");
    }

    /// The cells change nothing: every dot of the board is compared with every point of a dense grid.
    #[test]
    fn cells_find_every_near_dot() {
        for target in
            [target(), Target { pattern: Pattern::AsymmetricCircles { circle_diameter_mm: 20.0 }, ..target() }]
        {
            let grid = DotGrid::of(&target).unwrap();
            let radius_mm = target.circle_diameter_mm().unwrap() / 2.0;
            for i in -10..160 {
                for j in -10..80 {
                    let p = [f64::from(i) * 0.93, f64::from(j) * 1.07];
                    for margin_mm in [0.5, 3.0, 14.0] {
                        let near =
                            target.points().iter().any(|d| (d[0] - p[0]).hypot(d[1] - p[1]) <= radius_mm + margin_mm);
                        assert_eq!(grid.any_within(p, margin_mm), near, "{p:?} {margin_mm}");
                    }
                }
            }
        }
    }

    #[test]
    fn without_three_markers_there_is_no_region() {
        let marker = |index| MarkerObservation { index, pixel: [0.0; 2], std_px: 1.0 };
        let on_a_line = [marker(0), marker(1), marker(2)];
        for markers in [&[][..], &on_a_line[..1], &on_a_line[..2], &on_a_line] {
            assert!(!BoardRegion::within_markers(&target(), markers).contains([15.0, 0.0], 0.1));
        }
        let corner = [marker(0), marker(1), marker(3), marker(4)];
        let region = BoardRegion::within_markers(&target(), &corner);
        assert!(region.contains([15.0, 15.0], 1.0) && !region.contains([45.0, 15.0], 1.0));
    }
}
