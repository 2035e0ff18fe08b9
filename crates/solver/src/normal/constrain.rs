//! Constraining components of the step to zero: their rows and columns of H become those of the identity.

use crate::normal::chunk::Chunk;

/// Constrains components in a chunk's H_ee, H_ec and g_e. True marks a constrained component: `eliminated` is over the
/// chunk's eliminated variables, `kept` over all kept variables.
pub(crate) fn constrain_chunk(chunk: &mut Chunk, eliminated: &[bool], kept_flags: &[bool]) {
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
            for c in (0..v.d as usize).filter(|c| kept_flags[v.kept as usize + c]) {
                (0..d).for_each(|i| rows[i * stride + v.column as usize + c] = 0.0);
            }
        }
    }
}

/// Sets row and column `i` of a row-major matrix n × n to those of the identity.
pub(crate) fn identity_row(matrix: &mut [f64], n: usize, i: usize) {
    for k in 0..n {
        matrix[i * n + k] = 0.0;
        matrix[k * n + i] = 0.0;
    }
    matrix[i * n + i] = 1.0;
}
