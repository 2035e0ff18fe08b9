use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use crate::grid::layout::FieldLayout;
use crate::grid::nodes::{Domain, Grid, MAX_NODES};
use crate::hook::{Depth, HookKind};
use crate::piece::{AnyPiece, Constant, Context, Erased, Options, Parameter, Piece, Role};

/// Scalars of the state at the depth hook.
const IN: usize = 4;
/// The inverse depth among them.
const RHO: usize = 2;

/// A piece of depth whose first local parameters are fields over a [`Grid`] and whose last [`FieldLayout::shared`] ones are the
/// same everywhere. Nodes are named `a[column,row]`, with depth `a[column,row,bin]`.
pub struct Field<M, const P: usize> {
    local: Arc<Erased<Depth, P, M>>,
    layout: FieldLayout,
    /// Of all nodes, or of one cell's.
    parameters: Arc<[Parameter]>,
    /// Whether the parameters are those of the observations' cell alone.
    of_cell: bool,
}

/// The constants of a grid for files and the command line, with their present values as defaults.
fn grid_constants(grid: &Grid) -> Vec<Constant> {
    let described = [
        ("columns", "columns", "1"),
        ("rows", "rows", "1"),
        ("width_px", "width", "px"),
        ("height_px", "height", "px"),
        ("bins", "bins", "1"),
        ("near_mm", "nearest node", "mm"),
        ("far_mm", "farthest node", "mm"),
    ];
    let values = grid.options();
    let constant = |(name, label, unit): (&'static str, &'static str, &'static str)| {
        values.get(name).map(|value| Constant::new(name, label, unit, *value))
    };
    described.into_iter().filter_map(constant).collect()
}

impl<M: Piece<Depth, P>, const P: usize> fmt::Debug for Field<M, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Field").field("local", &*self.local).field("grid", &self.layout.grid).finish_non_exhaustive()
    }
}

impl<M: Piece<Depth, P>, const P: usize> Field<M, P> {
    /// All local parameters of a piece as fields.
    pub fn new(local: M, grid: Grid) -> Self {
        Self::with_shared(local, grid, 0)
    }

    /// The last `shared` local parameters are the same at all pixels.
    pub fn with_shared(local: M, grid: Grid, shared: usize) -> Self {
        Self::build(Arc::new(Erased::new(local)), FieldLayout { grid, fields: P - shared, shared }, false)
    }

    fn build(local: Arc<Erased<Depth, P, M>>, layout: FieldLayout, of_cell: bool) -> Self {
        let grid = layout.grid;
        let order = grid.interpolation.order();
        let [columns, rows] = if of_cell { [order, order] } else { [grid.columns, grid.rows] };
        let local_parameters = local.parameters();
        let mut parameters = Vec::with_capacity(columns * rows * layout.per_node() + layout.shared);
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            for field in &local_parameters[..layout.fields] {
                for bin in 0..grid.bins {
                    let depth = if grid.in_depth() { format!(",{bin}") } else { String::new() };
                    let name = Cow::Owned(format!("{}[{column},{row}{depth}]", field.name));
                    parameters.push(Parameter { name, ..field.clone() });
                }
            }
        }
        parameters.extend_from_slice(&local_parameters[layout.fields..]);
        Self { local, layout, parameters: parameters.into(), of_cell }
    }

    /// Where a pixel's nodes are in `theta`: (first parameter, weight) of each.
    #[inline]
    fn nodes(&self, pixel: [f64; 2]) -> ([(usize, f64); MAX_NODES], usize) {
        let order = self.layout.grid.interpolation.order();
        let ([column, row], fraction) = self.layout.grid.cell(pixel);
        let weights = self.layout.grid.image_weights(fraction);
        let mut nodes = [(0, 0.0); MAX_NODES];
        let per_node = self.layout.per_node();
        for k in 0..order * order {
            let index = if self.of_cell { k * per_node } else { self.layout.node(column + k % order, row + k / order) };
            nodes[k] = (index, weights[k]);
        }
        (nodes, order * order)
    }

    /// Local parameters at an observation and their derivatives by inverse depth.
    #[inline]
    fn at(&self, theta: &[f64], nodes: &[(usize, f64)], rho: f64) -> ([f64; P], [f64; P], (usize, f64)) {
        let (bin, far, slope) = self.layout.grid.depth_weight(rho);
        let bins = self.layout.grid.bins;
        let (mut values, mut slopes) = ([0.0; P], [0.0; P]);
        for f in 0..self.layout.fields {
            for (node, weight) in nodes {
                let here = &theta[node + f * bins + bin..];
                values[f] += weight * here[0];
                if bins > 1 {
                    let rise = here[1] - here[0];
                    values[f] += weight * far * rise;
                    slopes[f] += weight * slope * rise;
                }
            }
        }
        let shared = &theta[theta.len() - self.layout.shared..];
        values[self.layout.fields..].copy_from_slice(shared);
        (values, slopes, (bin, far))
    }
}

impl<M: Piece<Depth, P>, const P: usize> AnyPiece for Field<M, P> {
    fn name(&self) -> &'static str {
        M::NAME
    }

    fn described_by(&self) -> Option<&dyn AnyPiece> {
        Some(&*self.local)
    }

    fn source(&self) -> &'static str {
        M::SOURCE
    }

    fn hook(&self) -> HookKind {
        HookKind::Depth
    }

    fn role(&self) -> Role {
        Role::Map
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn constants(&self) -> Vec<Constant> {
        let mut constants = self.local.constants();
        constants.extend(grid_constants(&self.layout.grid));
        constants
    }

    fn options(&self) -> Options {
        let mut options = self.local.options();
        options.extend(self.layout.grid.options());
        options
    }

    fn evaluate(&self, theta: &[f64], states: &[f64], contexts: &[Context], out: &mut [f64]) {
        for ((state, context), y) in states.chunks_exact(IN).zip(contexts).zip(out.chunks_exact_mut(1)) {
            let (nodes, count) = self.nodes(context.pixel);
            let (local, ..) = self.at(theta, &nodes[..count], state[RHO]);
            self.local.evaluate(&local, state, std::slice::from_ref(context), y);
        }
    }

    fn linearize(
        &self,
        theta: &[f64],
        states: &[f64],
        contexts: &[Context],
        out: &mut [f64],
        d_state: &mut [f64],
        mut d_theta: Option<&mut [f64]>,
    ) {
        let (bins, fields, columns) = (self.layout.grid.bins, self.layout.fields, self.parameters.len());
        for (k, (state, context)) in states.chunks_exact(IN).zip(contexts).enumerate() {
            let (nodes, count) = self.nodes(context.pixel);
            let nodes = &nodes[..count];
            let (local, slopes, (bin, far)) = self.at(theta, nodes, state[RHO]);
            let (y, by_state) = (&mut out[k..k + 1], &mut d_state[IN * k..IN * (k + 1)]);
            let mut by_local = [0.0; P];
            // Where the field depends on depth, the state moves the local parameters too.
            let wanted = d_theta.is_some() || self.layout.grid.in_depth();
            let by = wanted.then_some(&mut by_local[..]);
            self.local.linearize(&local, state, std::slice::from_ref(context), y, by_state, by);
            by_state[RHO] += by_local.iter().zip(slopes).map(|(d, slope)| d * slope).sum::<f64>();
            let Some(d_theta) = d_theta.as_deref_mut() else { continue };
            let row = &mut d_theta[columns * k..columns * (k + 1)];
            row.fill(0.0);
            for f in 0..fields {
                for (node, weight) in nodes {
                    let first = node + f * bins + bin;
                    row[first] = by_local[f] * weight * (1.0 - far);
                    if bins > 1 {
                        row[first + 1] = by_local[f] * weight * far;
                    }
                }
            }
            row[columns - self.layout.shared..].copy_from_slice(&by_local[fields..]);
        }
    }

    fn field(&self) -> Option<FieldLayout> {
        Some(self.layout)
    }

    fn over(&self, domain: &Domain) -> Option<Arc<dyn AnyPiece>> {
        let layout = FieldLayout { grid: self.layout.grid.over(domain), ..self.layout };
        if layout == self.layout {
            return None;
        }
        let parameters = self.parameters.clone();
        Some(Arc::new(Self { local: self.local.clone(), layout, parameters, ..*self }))
    }

    fn of_cell(&self) -> Option<Arc<dyn AnyPiece>> {
        Some(Arc::new(Self::build(self.local.clone(), self.layout, true)))
    }
}
