//! The free map: a field over the image that corrects what no named effect explains. It names no cause.

use depthcal_model::PieceSpec;

use super::free_functions::Along;

/// Name of the free map among effects.
pub const FREE_MAP: &str = "free_map";

/// A map over the image with a number of columns and rows of nodes.
fn map(name: &str, columns: f64, rows: f64) -> PieceSpec {
    PieceSpec::new(name).with("columns", columns).with("rows", rows)
}

/// Forms of the free map for residuals that follow a covariate: an offset of inverse depth, an offset with a scale, and one that
/// is fine across what the residuals follow alone.
pub(super) fn forms(along: Option<Along>) -> Vec<PieceSpec> {
    let fine = match along {
        Some(Along::Row) => Some(map(FREE_MAP, 4.0, 48.0)),
        Some(Along::Column) => Some(map(FREE_MAP, 64.0, 4.0)),
        _ => None,
    };
    [PieceSpec::new(FREE_MAP), map("bspline", 6.0, 6.0)].into_iter().chain(fine).collect()
}
