use super::nodes::Grid;

/// The layout of a piece's parameters in the nodes of a grid.
///
/// The parameter of node (column, row), field f and bin b has the index ((row · columns + column) · fields + f) · bins + b;
/// after all nodes come the parameters that all pixels share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldLayout {
    /// The nodes.
    pub grid: Grid,
    /// Local parameters that are fields.
    pub fields: usize,
    /// Parameters that are the same at all pixels.
    pub shared: usize,
}

impl FieldLayout {
    /// Parameters of one node over the image: all fields, all bins.
    pub fn per_node(&self) -> usize {
        self.fields * self.grid.bins
    }

    /// Index of the first parameter of a node over the image.
    pub fn node(&self, column: usize, row: usize) -> usize {
        (row * self.grid.columns + column) * self.per_node()
    }

    /// All parameters.
    pub fn parameter_count(&self) -> usize {
        self.grid.columns_and_rows() * self.per_node() + self.shared
    }

    /// First parameters of the nodes of the cell whose first node is given, row by row.
    pub fn cell_nodes(&self, [column, row]: [usize; 2]) -> impl Iterator<Item = usize> {
        let (order, layout) = (self.grid.interpolation.order(), *self);
        (0..order * order).map(move |k| layout.node(column + k % order, row + k / order))
    }

    /// Whether an observation of inverse depth `rho` depends on bin `bin`.
    pub fn touches_bin(&self, rho: f64, bin: usize) -> bool {
        let (first, weight, _) = self.grid.depth_weight(rho);
        (bin == first && weight < 1.0) || (bin == first + 1 && weight > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::nodes::Domain;
    use super::*;

    /// Bins are those with a weight: one at and beyond the ends and on a node, two between nodes.
    #[test]
    fn an_observation_touches_the_bins_that_it_is_interpolated_from() {
        let grid = Grid::linear(2, 2, 4).over(&Domain { size_px: [10.0, 10.0], depth_mm: Some([500.0, 2000.0]) });
        let layout = FieldLayout { grid, fields: 1, shared: 0 };
        let touched = |z: f64| (0..4).filter(|bin| layout.touches_bin(1.0 / z, *bin)).collect::<Vec<_>>();
        for (z, expected) in [
            (300.0, &[0][..]),
            (499.0, &[0]),
            (700.0, &[0, 1]),
            (1200.0, &[1, 2]),
            (1999.0, &[2, 3]),
            (2001.0, &[3]),
            (4000.0, &[3]),
        ] {
            assert_eq!(touched(z), expected, "{z} mm");
        }
    }

    #[test]
    fn parameters_are_counted_and_numbered_node_by_node() {
        let layout = FieldLayout { grid: Grid::linear(5, 4, 3), fields: 2, shared: 1 };
        assert_eq!((layout.per_node(), layout.node(2, 3)), (6, 17 * 6));
        assert_eq!(layout.cell_nodes([2, 1]).collect::<Vec<_>>(), [7, 8, 12, 13].map(|node| 6 * node));
        let cubic = FieldLayout { grid: Grid::cubic(6, 5), fields: 1, shared: 0 };
        assert_eq!(cubic.cell_nodes([1, 1]).nth(4), Some(2 * 6 + 1));
    }
}
