//! The structure of a chunk: its part of the normal equations and the places to which groups of residuals are added.
//!
//! A chunk is a fixed part of the groups of residuals, with the variables that are eliminated there. Threads process
//! whole chunks, and the chunks' sums are added in the order of the chunks: results are bitwise identical for any number
//! of threads.
//!
//! Matrices are row-major. Index e is for eliminated variables, c for kept ones (of the reduced system). A chunk stores
//! blocks over the kept variables that its groups depend on, in the order in which they are first met.

/// The columns of a strip are padded to a multiple of this number.
pub(crate) const QUAD: usize = 4;

/// An eliminated variable and its offsets in the chunk's buffers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Elimination {
    /// Dimension d.
    pub d: u32,
    /// Offset of H_ee, d × d, in `hee`.
    pub ee: usize,
    /// Offset of its strip of H_ec, d × stride, in `hec`.
    pub ec: usize,
    /// Offset of its components in `ge` and `step`.
    pub e: usize,
    /// Index of its strip's pattern in [`ChunkPlan::strips`].
    pub strip: u32,
}

/// A kept variable in a strip.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StripVariable {
    /// First column in the strip.
    pub column: u32,
    /// Dimension.
    pub d: u32,
    /// Offset in the chunk's vector over the kept variables that it touches.
    pub local: u32,
    /// Offset in the vector over all kept variables.
    pub kept: u32,
}

/// The pattern of the non-zero columns of H_ec in the rows of an eliminated variable: the kept variables that share
/// groups with it. Eliminated variables with the same kept variables have one pattern in common.
#[derive(Clone, Debug)]
pub(crate) struct Strip {
    pub variables: Vec<StripVariable>,
    pub width: u32,
    /// Row length: `width` and a column for the right-hand side, padded to a multiple of [`QUAD`].
    pub stride: u32,
    /// Number of eliminated variables with this pattern.
    pub count: u32,
    /// Offset in `dense` of the sum of these variables' products Wᵀ W, if they are summed as one matrix.
    pub dense: Option<u32>,
    /// For every pair of variables (k, l ≤ k) the offset of its block of the Schur complement in `scc`.
    pub pairs: Vec<u32>,
    /// Ranks of the kept variables, ascending.
    pub ranks: Vec<u32>,
}

/// A kept variable in a group.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScatterVariable {
    /// First column among the group's free columns.
    pub column: u32,
    pub d: u32,
    /// Offset in the chunk's vector over the kept variables that it touches.
    pub local: u32,
}

/// A block of H_cc to which a group adds: columns of the group's JᵀJ, and the block's offset in `hcc`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScatterPair {
    pub row: u32,
    pub row_d: u32,
    pub column: u32,
    pub column_d: u32,
    pub block: u32,
}

/// The blocks to which the entries of a group's JᵀJ are added. Groups with the same destinations have one in common.
#[derive(Clone, Debug)]
pub(crate) struct Scatter {
    /// Columns of the Jacobian that the batch writes.
    pub columns: u32,
    /// The free ones among them, unless all are free.
    pub keep: Option<Box<[u32]>>,
    /// Number of free columns.
    pub m: u32,
    /// First free column and dimension of the eliminated variable, if the group has one.
    pub eliminated: Option<(u32, u32)>,
    pub kept: Vec<ScatterVariable>,
    pub pairs: Vec<ScatterPair>,
    /// For groups in lanes the number of lanes in a block: rows of the residual and entries of its Jacobian.
    pub block: Option<u32>,
}

/// A group of residuals in the chunk.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GroupPlan {
    pub batch: u32,
    pub group: u32,
    pub rows: u32,
    pub scatter: u32,
    /// Index in [`ChunkPlan::eliminations`] of the group's eliminated variable, or `NONE`.
    pub elimination: u32,
    /// First entry in [`ChunkPlan::strip_columns`]; there is one for each kept variable.
    pub strip_columns: u32,
    /// Offset in the chunk's `rows`, if it keeps them: residuals, then the Jacobian.
    pub kept_rows: usize,
}

/// A block over two kept variables, row rank ≥ column rank, and its offset in the chunk's buffer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalBlock {
    pub row: u32,
    pub column: u32,
    pub offset: u32,
}

/// A kept variable on which groups of the chunk depend.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalVariable {
    /// Offset in the vector over all kept variables.
    pub kept: u32,
    /// Offset in the chunk's vector.
    pub local: u32,
    pub d: u32,
}

/// The structure of a chunk; constant while solving.
#[derive(Clone, Debug, Default)]
pub(crate) struct ChunkPlan {
    pub eliminations: Vec<Elimination>,
    /// First component of the chunk among those of all eliminated variables, and the number of its components.
    pub offset: usize,
    pub dim: usize,
    pub groups: Vec<GroupPlan>,
    pub scatters: Vec<Scatter>,
    pub strips: Vec<Strip>,
    /// For each group with an eliminated variable, the first column in the strip of each of its kept variables.
    pub strip_columns: Vec<u32>,
    pub locals: Vec<LocalVariable>,
    /// Length of the chunk's vector over the kept variables that it touches.
    pub local_dim: usize,
    pub hcc_blocks: Vec<LocalBlock>,
    pub hcc_len: usize,
    pub scc_blocks: Vec<LocalBlock>,
    pub scc_len: usize,
    /// Lengths of the buffers.
    pub hee_len: usize,
    pub hec_len: usize,
    pub dense_len: usize,
    /// Sizes of scratch memory: the largest group, or strip, of the chunk.
    pub max_rows: usize,
    pub max_lanes: usize,
    pub max_jacobian: usize,
    pub max_columns: usize,
    pub max_strip: usize,
    pub form: Form,
    pub rows_len: usize,
}

/// The quantities that are accumulated from the residuals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Form {
    /// Normal equations and the Schur complement.
    #[default]
    Explicit,
    /// Normal equations; the Schur complement is not formed.
    Implicit,
    /// Normal equations; the residuals and the Jacobian are stored as well.
    Rows,
}

impl ChunkPlan {
    /// The offset in the vector over all kept variables of a variable at an offset in the chunk's vector.
    pub fn kept_of_local(&self, local: u32) -> usize {
        let index = self.locals.binary_search_by_key(&local, |l| l.local);
        index.map_or(0, |i| self.locals[i].kept as usize)
    }
}
