//! Orthonormal bases by Gram–Schmidt, applied twice for accuracy.

use nalgebra::DVector;

/// Orthonormalises linearly independent vectors in place.
pub(crate) fn orthonormalize(vectors: &mut [DVector<f64>]) {
    for k in 0..vectors.len() {
        let (done, from_k) = vectors.split_at_mut(k);
        let v = &mut from_k[0];
        v.normalize_mut();
        for _ in 0..2 {
            for b in done.iter() {
                let along = b.dot(v);
                v.axpy(-along, b, 1.0);
            }
        }
        v.normalize_mut();
    }
}

/// Orthonormalises linearly independent vectors in place in the metric D²; `d2` is its diagonal.
pub(crate) fn orthonormalize_in_metric(vectors: &mut [DVector<f64>], d2: &[f64]) {
    let dot = |a: &DVector<f64>, b: &DVector<f64>| -> f64 { (0..d2.len()).map(|i| a[i] * d2[i] * b[i]).sum() };
    for k in 0..vectors.len() {
        let (done, from_k) = vectors.split_at_mut(k);
        let v = &mut from_k[0];
        for _ in 0..2 {
            let norm = dot(v, v).sqrt();
            *v /= norm;
            for b in done.iter() {
                let along = dot(b, v);
                v.axpy(-along, b, 1.0);
            }
        }
        let norm = dot(v, v).sqrt();
        *v /= norm;
    }
}
