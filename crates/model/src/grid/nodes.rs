//! The nodes of a field: where they lie over the image and in depth, and how they are interpolated.

use std::collections::BTreeMap;

/// Most nodes over the image that a pixel depends on: 4 × 4 of a cubic field.
pub(crate) const MAX_NODES: usize = 16;

/// Interpolation of a field over the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// Bilinear: nodes from border to border of the image, continuous.
    Linear,
    /// Uniform cubic B-splines (de Boor 1978): one node beyond the border on each side, twice differentiable.
    Cubic,
}

impl Interpolation {
    /// Nodes along one axis that a pixel depends on.
    pub fn order(self) -> usize {
        match self {
            Interpolation::Linear => 2,
            Interpolation::Cubic => 4,
        }
    }

    /// Weights of those nodes at a fraction in [0, 1] of their cell; they sum to 1.
    fn weights(self, t: f64) -> [f64; 4] {
        match self {
            Interpolation::Linear => [1.0 - t, t, 0.0, 0.0],
            Interpolation::Cubic => {
                let s = 1.0 - t;
                let (t2, s2) = (t * t, s * s);
                let inner = |a: f64, a2: f64| (4.0 - 6.0 * a2 + 3.0 * a2 * a) / 6.0;
                [s2 * s / 6.0, inner(t, t2), inner(s, s2), t2 * t / 6.0]
            }
        }
    }
}

/// The domain of a camera, which grids are laid over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    /// Width and height of the image, px.
    pub size_px: [f64; 2],
    /// Nearest and farthest depth that was seen, mm; `None` where unknown.
    pub depth_mm: Option<[f64; 2]>,
}

/// Nodes in columns and rows over the image, and in bins of depth.
///
/// Constants by name: `columns`, `rows`; `bins`, `near_mm`, `far_mm` where a field has depth; `width_px`, `height_px`, which
/// the camera sets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Interpolation over the image. In depth it is linear, and constant beyond the nearest and farthest node.
    pub interpolation: Interpolation,
    /// Nodes along u.
    pub columns: usize,
    /// Nodes along v.
    pub rows: usize,
    /// Nodes in depth; 1 where the field does not depend on it.
    pub bins: usize,
    size_px: Option<[f64; 2]>,
    range_mm: Option<[f64; 2]>,
    in_depth: bool,
}

/// Fewest and most nodes along an axis.
const MOST_NODES: usize = 1024;
/// Depth of the nearest and farthest node where neither data nor user say, mm.
const USUAL_RANGE_MM: [f64; 2] = [300.0, 3000.0];
/// Image size before a camera has set it, px.
const USUAL_SIZE_PX: [f64; 2] = [640.0, 480.0];

impl Grid {
    /// A field over the image, with cubic B-splines.
    pub fn cubic(columns: usize, rows: usize) -> Self {
        let interpolation = Interpolation::Cubic;
        Self { interpolation, columns, rows, bins: 1, size_px: None, range_mm: None, in_depth: false }
    }

    /// A field over image and depth, linear between its nodes.
    pub fn linear(columns: usize, rows: usize, bins: usize) -> Self {
        let interpolation = Interpolation::Linear;
        Self { interpolation, columns, rows, bins, size_px: None, range_mm: None, in_depth: true }
    }

    /// Sets the constants that are given by name, brought into their range.
    pub fn with_options(mut self, options: &BTreeMap<String, f64>) -> Self {
        let fewest = self.interpolation.order();
        let count = |name: &str, present: usize, fewest: usize| {
            options.get(name).map_or(present, |n| (*n as usize).clamp(fewest, MOST_NODES))
        };
        self.columns = count("columns", self.columns, fewest);
        self.rows = count("rows", self.rows, fewest);
        let pair = |a: &str, b: &str, present: Option<[f64; 2]>, usual: [f64; 2]| {
            let [x, y] = [a, b].map(|name| options.get(name).copied().filter(|v| *v > 0.0 && v.is_finite()));
            let [p, q] = present.unwrap_or(usual);
            (x.is_some() || y.is_some() || present.is_some()).then_some([x.unwrap_or(p), y.unwrap_or(q)])
        };
        self.size_px = pair("width_px", "height_px", self.size_px, USUAL_SIZE_PX);
        if self.in_depth {
            self.bins = count("bins", self.bins, 1);
            let range = pair("near_mm", "far_mm", self.range_mm, USUAL_RANGE_MM);
            self.range_mm = range.map(|[near, far]| if far > near { [near, far] } else { USUAL_RANGE_MM });
        }
        self
    }

    /// Laid over a camera's image; over the depth that was seen too unless the user said where its nodes are.
    pub fn over(mut self, domain: &Domain) -> Self {
        self.size_px = Some(domain.size_px);
        self.range_mm = self.range_mm.or(domain.depth_mm.filter(|_| self.in_depth));
        self
    }

    /// Values of its constants by name.
    pub fn options(&self) -> BTreeMap<String, f64> {
        let [width, height] = self.size_px.unwrap_or(USUAL_SIZE_PX);
        let mut options = BTreeMap::new();
        let mut set = |name: &str, value: f64| _ = options.insert(name.to_owned(), value);
        set("columns", self.columns as f64);
        set("rows", self.rows as f64);
        set("width_px", width);
        set("height_px", height);
        if self.in_depth {
            let [near, far] = self.range_mm();
            set("bins", self.bins as f64);
            set("near_mm", near);
            set("far_mm", far);
        }
        options
    }

    /// Depth of the nearest and farthest node, mm.
    pub fn range_mm(&self) -> [f64; 2] {
        self.range_mm.unwrap_or(USUAL_RANGE_MM)
    }

    /// Number of nodes over the image.
    pub fn columns_and_rows(&self) -> usize {
        self.columns * self.rows
    }

    /// Whether the field depends on depth.
    pub fn in_depth(&self) -> bool {
        self.in_depth && self.bins > 1
    }

    /// The cell of a pixel, as its first node's column and row, and the fractions of the cell. Pixels beyond the image take
    /// the values of its border.
    pub fn cell(&self, pixel: [f64; 2]) -> ([usize; 2], [f64; 2]) {
        let size = self.size_px.unwrap_or(USUAL_SIZE_PX);
        let order = self.interpolation.order();
        let along = |i: usize, nodes: usize| {
            let cells = nodes + 1 - order;
            let s = (pixel[i] / (size[i] - 1.0) * cells as f64).clamp(0.0, cells as f64);
            let first = (s as usize).min(cells - 1);
            (first, s - first as f64)
        };
        let ((u, s), (v, t)) = (along(0, self.columns), along(1, self.rows));
        ([u, v], [s, t])
    }

    /// Pixel of a node, beyond the border for the outermost of a cubic field.
    pub fn node_pixel(&self, column: usize, row: usize) -> [f64; 2] {
        let size = self.size_px.unwrap_or(USUAL_SIZE_PX);
        let order = self.interpolation.order();
        let along = |i: usize, node: usize, nodes: usize| {
            (node as f64 - (order / 2 - 1) as f64) * (size[i] - 1.0) / (nodes + 1 - order) as f64
        };
        [along(0, column, self.columns), along(1, row, self.rows)]
    }

    /// Weights of a pixel's nodes over the image, row by row within the cell.
    pub(crate) fn image_weights(&self, [s, t]: [f64; 2]) -> [f64; MAX_NODES] {
        let order = self.interpolation.order();
        let (wu, wv) = (self.interpolation.weights(s), self.interpolation.weights(t));
        let mut weights = [0.0; MAX_NODES];
        for j in 0..order {
            for i in 0..order {
                weights[j * order + i] = wu[i] * wv[j];
            }
        }
        weights
    }

    /// Nearer node in depth, weight of the farther one, and that weight's derivative by inverse depth.
    pub(crate) fn depth_weight(&self, rho: f64) -> (usize, f64, f64) {
        if self.bins < 2 {
            return (0, 0.0, 0.0);
        }
        let [near, far] = self.range_mm();
        let per_mm = (self.bins - 1) as f64 / (far - near);
        let t = (1.0 / rho - near) * per_mm;
        let last = (self.bins - 1) as f64;
        if !(t > 0.0) {
            return (0, 0.0, 0.0);
        }
        if t >= last {
            return (self.bins - 2, 1.0, 0.0);
        }
        let first = (t as usize).min(self.bins - 2);
        (first, t - first as f64, -per_mm / (rho * rho))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cubic B-splines reproduce polynomials up to third order from blossomed coefficients; here the first order: node
    /// values that are affine give the affine function everywhere, and weights sum to 1.
    #[test]
    fn affine_node_values_give_the_affine_function() {
        let domain = Domain { size_px: [640.0, 480.0], depth_mm: Some([500.0, 900.0]) };
        for grid in [Grid::cubic(7, 5), Grid::linear(4, 3, 2)] {
            let grid = grid.over(&domain);
            let order = grid.interpolation.order();
            for pixel in [[0.0, 0.0], [639.0, 479.0], [13.2, 400.7], [320.0, 240.0]] {
                let ([c, r], fraction) = grid.cell(pixel);
                let weights = grid.image_weights(fraction);
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                let mut sum = [0.0; 2];
                for j in 0..order {
                    for i in 0..order {
                        let node = grid.node_pixel(c + i, r + j);
                        sum = [0, 1].map(|k| sum[k] + weights[j * order + i] * node[k]);
                    }
                }
                assert!((sum[0] - pixel[0]).hypot(sum[1] - pixel[1]) < 1e-10, "{sum:?} for {pixel:?}");
            }
        }
    }

    #[test]
    fn depth_nodes_are_interpolated_and_end() {
        let grid = Grid::linear(2, 2, 5).over(&Domain { size_px: [10.0, 10.0], depth_mm: Some([400.0, 1200.0]) });
        let (first, weight, slope) = grid.depth_weight(1.0 / 700.0);
        assert_eq!(first, 1);
        assert!((weight - 0.5).abs() < 1e-12 && (slope + 700.0 * 700.0 / 200.0).abs() < 1e-6);
        assert_eq!(grid.depth_weight(1.0 / 300.0), (0, 0.0, 0.0));
        assert_eq!(grid.depth_weight(1.0 / 2000.0), (3, 1.0, 0.0));
    }

    #[test]
    fn what_the_user_sets_stays() {
        let options = [("bins", 3.0), ("near_mm", 200.0), ("far_mm", 900.0), ("columns", 1.0)];
        let options = options.map(|(k, v)| (k.to_owned(), v)).into_iter().collect();
        let grid = Grid::linear(8, 6, 5).with_options(&options);
        let grid = grid.over(&Domain { size_px: [512.0, 424.0], depth_mm: Some([500.0, 4500.0]) });
        assert_eq!((grid.bins, grid.range_mm(), grid.columns), (3, [200.0, 900.0], 2));
        assert_eq!(grid.options()["width_px"], 512.0);
        assert_eq!(Grid::linear(8, 6, 5).with_options(&grid.options()).options(), grid.options());
    }

    /// Constants by halves: what is not given stays as it was, and what makes no sense is not taken.
    #[test]
    fn constants_are_brought_into_their_range() {
        let with = |grid: Grid, given: &[(&str, f64)]| {
            grid.with_options(&given.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect())
        };
        let linear = Grid::linear(8, 6, 5);
        assert_eq!(with(linear, &[("near_mm", 450.0)]).range_mm(), [450.0, USUAL_RANGE_MM[1]]);
        assert_eq!(with(linear, &[("far_mm", 4500.0)]).range_mm(), [USUAL_RANGE_MM[0], 4500.0]);
        for given in [[900.0, 900.0], [900.0, 200.0]] {
            let [near, far] = given;
            assert_eq!(with(linear, &[("near_mm", near), ("far_mm", far)]).range_mm(), USUAL_RANGE_MM, "{given:?}");
        }
        for wrong in [0.0, -3.0, f64::INFINITY, f64::NAN] {
            assert_eq!(with(linear, &[("near_mm", wrong), ("width_px", wrong)]), linear, "{wrong}");
        }
        assert_eq!(with(linear, &[("width_px", 320.0)]).options()["height_px"], USUAL_SIZE_PX[1]);
        let extreme = with(linear, &[("columns", 1e9), ("rows", -4.0), ("bins", 0.0)]);
        assert_eq!((extreme.columns, extreme.rows, extreme.bins), (MOST_NODES, 2, 1));
        // A field over the image alone has no bins.
        let cubic = with(Grid::cubic(7, 5), &[("rows", 2.0), ("bins", 9.0), ("near_mm", 100.0)]);
        assert_eq!((cubic.columns, cubic.rows, cubic.bins, cubic.range_mm), (7, 4, 1, None));
        assert!(!cubic.options().contains_key("bins") && !cubic.in_depth() && linear.in_depth());
        assert_eq!((linear.columns_and_rows(), Grid::linear(8, 6, 1).in_depth()), (48, false));
    }

    /// Two nodes are the fewest that a depth can lie between; the weight's slope is that of its differences.
    #[test]
    fn two_depth_nodes_are_interpolated_too() {
        let over =
            |bins| Grid::linear(2, 2, bins).over(&Domain { size_px: [10.0, 10.0], depth_mm: Some([400.0, 1200.0]) });
        assert_eq!(over(1).depth_weight(1.0 / 700.0), (0, 0.0, 0.0));
        for (bins, node) in [(2, 0), (9, 5)] {
            let grid = over(bins);
            let (first, weight, slope) = grid.depth_weight(1.0 / 960.0);
            let expected = 560.0 * (bins - 1) as f64 / 800.0 - node as f64;
            assert!(first == node && (weight - expected).abs() < 1e-12, "{bins} bins: {first} {weight}");
            let h = 1e-9;
            let ends = [-h, h].map(|h| grid.depth_weight(1.0 / 960.0 + h).1);
            let difference = (ends[1] - ends[0]) / (2.0 * h);
            assert!((slope / difference - 1.0).abs() < 1e-6, "{bins} bins: {slope} {difference}");
            // At the last node the last cell ends, and so does the slope.
            assert_eq!(grid.depth_weight(1.0 / 1200.5), (bins - 2, 1.0, 0.0));
            assert_eq!(grid.depth_weight(1.0 / 399.5), (0, 0.0, 0.0));
        }
    }
}
