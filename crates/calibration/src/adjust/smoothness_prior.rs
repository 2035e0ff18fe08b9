//! Smoothness prior of fields: grids of parameters over the image, and over depth.
//!
//! Second differences between neighbouring nodes (∂²/∂u², √2 ∂²/∂u∂v, ∂²/∂v², and ∂²/∂z²) are normal with mean zero and the
//! standard deviation *roughness*, one per field, which is chosen from the data (see
//! [`crate::adjust::smoothness_selection`]). A weak ridge keeps near their nominal values those combinations of parameters
//! whose second differences vanish. In a stack such as `projective+bspline` the ridge assigns the shared subspace to D, which
//! is not penalised; there its strength is chosen from the data as well. Nodes that no sample touches are held at their
//! nominal values.
//!
//! Smooth functions that pieces have themselves, such as splines in formulas, have a prior of the same kind of given strength.

use std::collections::BTreeMap;

use depthcal_model::field::FieldLayout;
use depthcal_model::{Block, Camera};
use depthcal_solver::{EvaluationError, FactorBatch, Key, Values, VariableId};
use nalgebra::{DMatrix, DVector};

use super::field_thresholds::FieldThresholds;
use crate::observe::{CameraFrames, SampledFrame};

/// One field of a piece, and the strength of its smoothness prior.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldRoughness {
    /// The piece.
    pub piece: &'static str,
    /// The field: the name of the local parameter.
    pub field: String,
    /// Number of the field within its piece.
    pub index: usize,
    /// Standard deviation of second differences, in units of the parameter's typical deviation.
    pub roughness: f64,
    /// Nodes with data.
    pub nodes: usize,
    /// Nodes without data, which are held at their nominal values.
    pub untouched: usize,
    /// Effective number of parameters, tr(Σ N): those that the data rather than the prior determine; `None` where not
    /// computed.
    pub effective: Option<f64>,
}

/// The smoothness prior of all fields of a camera.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Smoothness {
    /// In the order of the camera's blocks.
    pub fields: Vec<FieldRoughness>,
    /// Standard deviation of the ridge, in units of a parameter's typical deviation.
    pub ridge: f64,
    /// Whether D is fitted jointly with the fields: then the ridge is chosen from the data too.
    pub with_projective: bool,
    /// The rules' thresholds.
    pub thresholds: FieldThresholds,
}

impl Smoothness {
    /// Takes over the strength of every field and of the ridge from an earlier choice, where that had them.
    pub(crate) fn start_from(&mut self, earlier: &Self) {
        for field in &mut self.fields {
            let same = earlier.fields.iter().find(|f| f.piece == field.piece && f.field == field.field);
            field.roughness = same.map_or(field.roughness, |f| f.roughness);
        }
        if self.with_projective == earlier.with_projective && !earlier.fields.is_empty() {
            self.ridge = earlier.ridge;
        }
    }

    /// Whether all fields are as smooth as they may be.
    pub(crate) fn is_flat(&self) -> bool {
        self.fields.iter().all(|field| field.roughness <= self.thresholds.roughness_range[0])
    }

    /// All fields of a camera at the roughness with which the search starts.
    pub fn of(camera: &Camera, thresholds: &FieldThresholds) -> Self {
        let mut fields = Vec::new();
        for block in camera.blocks() {
            let Some((piece, layout)) = block.piece().and_then(|p| Some((p, p.field()?))) else { continue };
            for index in 0..layout.fields {
                let is_free: Vec<bool> = indices(&layout, index).map(|i| block.free[i]).collect();
                let nodes = is_free.iter().filter(|free| **free).count();
                let name = &piece.parameters()[index * layout.grid.bins].name;
                fields.push(FieldRoughness {
                    piece: piece.name(),
                    field: name.split('[').next().unwrap_or_default().to_owned(),
                    index,
                    roughness: thresholds.first_roughness,
                    nodes,
                    untouched: is_free.len() - nodes,
                    effective: None,
                });
            }
        }
        let with_projective = camera.block("projective").is_some_and(|d| d.free.contains(&true));
        let ridge = if with_projective { thresholds.ridge_with_projective } else { thresholds.ridge_alone };
        Self { fields, ridge, with_projective, thresholds: *thresholds }
    }

    /// Whether neither a roughness nor the ridge differs by more than [`FieldThresholds::settled_log_ratio`].
    pub fn close_to(&self, other: &Self) -> bool {
        let pairs = self.fields.iter().zip(&other.fields);
        let close = |a: f64, b: f64| (a / b).ln().abs() < self.thresholds.settled_log_ratio;
        pairs.into_iter().all(|(a, b)| close(a.roughness, b.roughness)) && close(self.ridge, other.ridge)
    }

    /// Roughness of field `index` of a piece.
    fn roughness(&self, piece: &str, index: usize) -> f64 {
        let field = self.fields.iter().find(|f| f.piece == piece && f.index == index);
        field.map_or(self.thresholds.first_roughness, |f| f.roughness)
    }

    /// The prior's rows for a block: smoothness of each field, ridge, and the prior of shared parameters.
    pub fn rows(&self, block: &Block) -> Vec<PriorRow> {
        let Some(layout) = block.piece().and_then(|p| p.field()) else { return Vec::new() };
        let mut rows = differences(&layout, &block.free, |f| self.roughness(block.name(), f));
        rows.extend(ridge(&layout, &block.free, self.ridge));
        for row in &mut rows {
            // Typical deviations are those of the parameters; all entries of a row belong to one field.
            let scale = block.parameters()[row.entries[0].0].scale;
            row.entries.iter_mut().for_each(|(_, c)| *c /= scale);
        }
        rows
    }
}

/// One row of the prior: Σ c (θ − nominal) is standard normal.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorRow {
    /// Parameters of the block, with their coefficients.
    pub entries: Vec<(usize, f64)>,
}

impl PriorRow {
    /// Adds the row's normal matrix over the parameters of its block, in units of `scale`; `places` are their places in `matrix`.
    pub(super) fn add_to(&self, matrix: &mut DMatrix<f64>, places: &[Option<usize>], scale: impl Fn(usize) -> f64) {
        for (i, a) in &self.entries {
            for (j, b) in &self.entries {
                if let (Some(p), Some(q)) = (places[*i], places[*j]) {
                    matrix[(p, q)] += a * b / (scale(*i) * scale(*j));
                }
            }
        }
    }
}

/// The prior's rows for the smooth functions that a piece has itself ([`SmoothParameters`]), whose strength is part of the piece.
///
/// [`SmoothParameters`]: depthcal_model::SmoothParameters
pub fn rows_of_smooth_functions(block: &Block) -> Vec<PriorRow> {
    let Some(piece) = block.piece() else { return Vec::new() };
    let parameters = piece.parameters();
    let mut rows = Vec::new();
    for function in piece.smooth() {
        let places = function.parameters.iter().filter_map(|name| parameters.iter().position(|p| p.name == *name));
        let places: Vec<usize> = places.collect();
        // A definition has no other names than those of its parameters.
        for three in function.neighbours().filter(|_| places.len() == function.parameters.len()) {
            let entries = three.into_iter().zip([1.0, -2.0, 1.0]).map(|(i, c)| (places[i], c / function.roughness));
            rows.push(PriorRow { entries: entries.collect() });
        }
        rows.extend(places.iter().map(|i| PriorRow { entries: vec![(*i, 1.0 / function.deviation)] }));
    }
    rows.retain(|row| row.entries.iter().any(|(i, _)| block.free[*i]));
    rows
}

/// Precision matrix over the parameters of a piece of the prior for the smooth functions that it has itself; `None` where it has
/// none.
pub fn precision_of_smooth_functions(block: &Block) -> Option<DMatrix<f64>> {
    let rows = rows_of_smooth_functions(block);
    let mut precision = DMatrix::zeros(block.theta.len(), block.theta.len());
    let places: Vec<Option<usize>> = (0..block.theta.len()).map(Some).collect();
    rows.iter().for_each(|row| row.add_to(&mut precision, &places, |_| 1.0));
    (!rows.is_empty()).then_some(precision)
}

/// Places of one field's parameters in its block: all nodes, all bins.
pub fn indices(layout: &FieldLayout, field: usize) -> impl Iterator<Item = usize> {
    let (bins, per_node) = (layout.grid.bins, layout.per_node());
    (0..layout.grid.columns_and_rows() * bins).map(move |k| (k / bins) * per_node + field * bins + k % bins)
}

/// Second differences of the fields over the nodes with data, divided by `roughness(field)`.
pub(crate) fn differences(layout: &FieldLayout, free: &[bool], roughness: impl Fn(usize) -> f64) -> Vec<PriorRow> {
    let (grid, bins) = (layout.grid, layout.grid.bins);
    let (columns, rows) = (grid.columns, grid.rows);
    let mut all = Vec::new();
    for field in 0..layout.fields {
        let weight = 1.0 / roughness(field);
        let index = |c: usize, r: usize, b: usize| layout.node(c, r) + field * bins + b;
        let mut add = |entries: &[(usize, f64)]| {
            if entries.iter().all(|(i, _)| free[*i]) {
                all.push(PriorRow { entries: entries.iter().map(|(i, c)| (*i, c * weight)).collect() });
            }
        };
        for (r, c, b) in (0..rows).flat_map(|r| (0..columns).flat_map(move |c| (0..bins).map(move |b| (r, c, b)))) {
            if c + 2 < columns {
                add(&[(index(c, r, b), 1.0), (index(c + 1, r, b), -2.0), (index(c + 2, r, b), 1.0)]);
            }
            if r + 2 < rows {
                add(&[(index(c, r, b), 1.0), (index(c, r + 1, b), -2.0), (index(c, r + 2, b), 1.0)]);
            }
            if b + 2 < bins {
                add(&[(index(c, r, b), 1.0), (index(c, r, b + 1), -2.0), (index(c, r, b + 2), 1.0)]);
            }
            if c + 1 < columns && r + 1 < rows {
                let s = std::f64::consts::SQRT_2;
                add(&[
                    (index(c, r, b), s),
                    (index(c + 1, r, b), -s),
                    (index(c, r + 1, b), -s),
                    (index(c + 1, r + 1, b), s),
                ]);
            }
        }
    }
    all
}

/// The ridge of standard deviation `sigma` on all nodes with data, and the unit prior of shared parameters.
pub(crate) fn ridge(layout: &FieldLayout, free: &[bool], sigma: f64) -> Vec<PriorRow> {
    let nodes = layout.parameter_count() - layout.shared;
    let row = |i: usize| PriorRow { entries: vec![(i, if i < nodes { 1.0 / sigma } else { 1.0 })] };
    (0..free.len()).filter(|i| free[*i]).map(row).collect()
}

/// Holds every node that no sample touches at its nominal value.
pub fn hold_untouched(camera: &Camera, capture: &CameraFrames<SampledFrame>) -> Camera {
    camera.map_blocks(|mut block| {
        let Some(layout) = block.piece().and_then(|p| p.field()) else { return block };
        let mut touched = vec![false; block.theta.len()];
        let shared = touched.len() - layout.shared;
        touched[shared..].fill(true);
        for sample in capture.frames.iter().flat_map(|f| f.samples.iter()) {
            let (cell, _) = layout.grid.cell(sample.context.pixel);
            let bins = (0..layout.grid.bins)
                .filter(|b| layout.grid.bins == 1 || layout.touches_bin(1.0 / sample.depth_mm, *b));
            for bin in bins {
                for node in layout.cell_nodes(cell) {
                    for field in 0..layout.fields {
                        touched[node + field * layout.grid.bins + bin] = true;
                    }
                }
            }
        }
        let nominal: Vec<f64> = block.parameters().iter().map(|p| p.nominal).collect();
        for i in 0..touched.len() {
            if !touched[i] {
                (block.free[i], block.theta[i]) = (false, nominal[i]);
            }
        }
        block
    })
}

/// The prior of one block on the factor graph.
#[derive(Debug, Clone)]
pub struct SmoothnessBatch {
    name: String,
    groups: Vec<PriorGroup>,
}

/// Rows over the same variables.
#[derive(Debug, Clone)]
struct PriorGroup {
    keys: Vec<Key<DVector<f64>>>,
    ids: Vec<VariableId>,
    /// Nominal values of all components.
    nominal: Vec<f64>,
    /// Rows whose entries count the components of all variables, one variable after the other.
    rows: Vec<PriorRow>,
}

impl PriorGroup {
    fn new(keys: Vec<Key<DVector<f64>>>, nominal: Vec<f64>, rows: Vec<PriorRow>) -> Self {
        Self { ids: keys.iter().map(|k| k.id()).collect(), keys, nominal, rows }
    }
}

impl SmoothnessBatch {
    /// The prior's rows for a block whose parameters are the variable `key`.
    pub fn new(block: &Block, key: Key<DVector<f64>>, rows: Vec<PriorRow>) -> Self {
        let nominal = block.parameters().iter().map(|p| p.nominal).collect();
        let groups = vec![PriorGroup::new(vec![key], nominal, rows)];
        Self { name: format!("smoothness of {}", block.name()), groups }
    }

    /// The prior's rows for a block with one variable per node, and a last one for shared parameters.
    pub fn by_node(block: &Block, layout: &FieldLayout, keys: &[Key<DVector<f64>>], rows: &[PriorRow]) -> Self {
        let (size, nodes) = (layout.per_node(), layout.grid.columns_and_rows());
        let place = |i: usize| if i < nodes * size { (i / size, i % size) } else { (nodes, i - nodes * size) };
        let range = |node: usize| node * size..if node < nodes { (node + 1) * size } else { block.theta.len() };
        let mut sets: BTreeMap<Vec<usize>, Vec<&PriorRow>> = BTreeMap::new();
        for row in rows {
            let mut set: Vec<usize> = row.entries.iter().map(|(i, _)| place(*i).0).collect();
            set.sort_unstable();
            set.dedup();
            sets.entry(set).or_default().push(row);
        }
        let group = |(set, rows): (Vec<usize>, Vec<&PriorRow>)| {
            let local = |i: usize| {
                let (node, component) = place(i);
                set.iter().take_while(|n| **n != node).map(|n| range(*n).len()).sum::<usize>() + component
            };
            let rows = rows
                .iter()
                .map(|row| PriorRow { entries: row.entries.iter().map(|(i, c)| (local(*i), *c)).collect() })
                .collect();
            let parameters = block.parameters();
            let nominal = set.iter().flat_map(|n| range(*n)).map(|i| parameters[i].nominal).collect();
            PriorGroup::new(set.iter().map(|n| keys[*n]).collect(), nominal, rows)
        };
        Self { name: format!("smoothness of {}", block.name()), groups: sets.into_iter().map(group).collect() }
    }
}

impl FactorBatch for SmoothnessBatch {
    fn name(&self) -> &str {
        &self.name
    }

    fn group_count(&self) -> usize {
        self.groups.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        &self.groups[group].ids
    }

    fn row_count(&self, group: usize) -> usize {
        self.groups[group].rows.len()
    }

    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let group = &self.groups[group];
        let theta = group.keys.iter().flat_map(|k| values.get(*k).iter());
        let deviation: Vec<f64> = theta.zip(&group.nominal).map(|(t, n)| t - n).collect();
        for (row, r) in group.rows.iter().zip(residuals) {
            *r = row.entries.iter().map(|(i, c)| c * deviation[*i]).sum();
        }
        if let Some(jacobian) = jacobian {
            jacobian.fill(0.0);
            for (row, j) in group.rows.iter().zip(jacobian.chunks_exact_mut(deviation.len())) {
                row.entries.iter().for_each(|(i, c)| j[*i] = *c);
            }
        }
        Ok(())
    }
}
