//! Holding components of a linear system: their rows and columns become those of the identity.

use crate::accumulate::Chunk;

/// Replaces rows and columns of a chunk's H_ee and H_ec, and components of its g_e. `eliminated` has the chunk's own
/// components, `kept` those of all kept variables.
pub(crate) fn hold_chunk(chunk: &mut Chunk, eliminated: &[bool], kept: &[bool]) {
    let Chunk { plan, hee, hec, ge, .. } = chunk;
    for e in &plan.eliminations {
        let d = e.d as usize;
        let strip = &plan.strips[e.strip as usize];
        let stride = if strip.width == 0 { 0 } else { strip.stride as usize };
        let h = &mut hee[e.ee..][..d * d];
        let rows = &mut hec[e.ec..][..d * stride];
        for i in (0..d).filter(|i| eliminated[e.e + i]) {
            identity_row(h, d, i);
            rows[i * stride..][..stride].fill(0.0);
            ge[e.e + i] = 0.0;
        }
        for v in &strip.variables {
            for c in (0..v.d as usize).filter(|c| kept[v.kept as usize + c]) {
                (0..d).for_each(|i| rows[i * stride + v.column as usize + c] = 0.0);
            }
        }
    }
}

/// Makes row and column `i` of a matrix n × n those of the identity.
pub(crate) fn identity_row(matrix: &mut [f64], n: usize, i: usize) {
    for k in 0..n {
        matrix[i * n + k] = 0.0;
        matrix[k * n + i] = 0.0;
    }
    matrix[i * n + i] = 1.0;
}
