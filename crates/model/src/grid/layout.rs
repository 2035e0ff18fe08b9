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

    /// Parameters that the pixels of one cell depend on.
    pub fn cell_parameter_count(&self) -> usize {
        self.grid.interpolation.order().pow(2) * self.per_node() + self.shared
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
