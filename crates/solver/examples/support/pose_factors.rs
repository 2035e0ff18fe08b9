//! Factors of relative poses in the plane and in space, and the graph of a g2o file.

use std::collections::HashMap;
use std::error::Error;

use depthcal_solver::{Batch, Factor, Graph, Over, Pose, Scalar, Values};
use nalgebra::{Isometry3, Quaternion, SMatrix, SVector, SymmetricEigen, Translation3, UnitQuaternion, Vector3};

use crate::g2o::{G2oGraph, Se2Edge, Se3Edge};

/// A measured relative pose in the plane: x, y, angle in rad. Poses are vectors (x, y, angle).
struct BetweenPlane {
    measurement: [f64; 3],
    /// A with Aᵀ A the information.
    root: SMatrix<f64, 3, 3>,
}

impl Factor<3> for BetweenPlane {
    type Variables = (Vector3<f64>, Vector3<f64>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, 3> {
        let (s, c) = a[2].sin_cos();
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let [x, y, angle] = self.measurement;
        let turn = b[2] - a[2] - angle;
        let turns = (turn.re() / std::f64::consts::TAU).round();
        let e = [c * dx + s * dy - x, c * dy - s * dx - y, turn - turns * std::f64::consts::TAU];
        weigh(&self.root, &e)
    }
}

/// A measured relative pose in space.
struct BetweenSpace {
    /// The inverse of the measurement.
    inverse: Isometry3<f64>,
    root: SMatrix<f64, 6, 6>,
}

impl Factor<6> for BetweenSpace {
    type Variables = (Isometry3<f64>, Isometry3<f64>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, 6> {
        let error = Pose::<T>::constant(&self.inverse).compose(&a.inverse().compose(&b));
        // In g2o's convention the rotation error is the vector part of the quaternion with positive real part.
        let sign = if error.rotation.w.re() < 0.0 { -1.0 } else { 1.0 };
        let (t, v) = (error.translation, error.rotation.v);
        weigh(&self.root, &[t[0], t[1], t[2], v[0] * sign, v[1] * sign, v[2] * sign])
    }
}

/// A e for `root` = A.
#[inline(always)]
fn weigh<T: Scalar, const N: usize>(root: &SMatrix<f64, N, N>, e: &[T; N]) -> SVector<T, N> {
    let mut r = SVector::<T, N>::from_element(T::from(0.0));
    for i in 0..N {
        for j in 0..N {
            r[i] += e[j] * root[(i, j)];
        }
    }
    r
}

/// A with Aᵀ A = `information`, which may be singular.
fn square_root<const N: usize>(information: &[[f64; N]; N]) -> SMatrix<f64, N, N> {
    let eigen = SymmetricEigen::new(nalgebra::DMatrix::from_fn(N, N, |i, j| information[i][j]));
    SMatrix::from_fn(|i, j| eigen.eigenvalues[i].max(0.0).sqrt() * eigen.eigenvectors[(j, i)])
}

fn isometry(translation: &[f64; 3], [w, x, y, z]: [f64; 4]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(Vector3::from(*translation)), rotation)
}

/// The graph of a file. If it fixes no vertex, the first one is fixed.
pub fn build(file: G2oGraph) -> Result<(Graph, Values), Box<dyn Error>> {
    let mut values = Values::new();
    let mut graph = Graph::new();
    let plane: HashMap<usize, _> =
        file.se2_vertices.iter().map(|v| (v.id, values.insert(Vector3::from(v.pose)))).collect();
    let space: HashMap<usize, _> =
        file.se3_vertices.iter().map(|v| (v.id, values.insert(isometry(&v.translation, v.rotation)))).collect();
    let mut in_plane = Batch::new("relative poses in the plane");
    for Se2Edge { from, to, measurement, information } in &file.se2_edges {
        let root = square_root(information);
        in_plane.push(BetweenPlane { measurement: *measurement, root }, (plane[from], plane[to]));
    }
    let mut in_space = Batch::new("relative poses in space");
    for Se3Edge { from, to, translation, rotation, information } in &file.se3_edges {
        let inverse = isometry(translation, *rotation).inverse();
        in_space.push(BetweenSpace { inverse, root: square_root(information) }, (space[from], space[to]));
    }
    graph.add_batch(in_plane);
    graph.add_batch(in_space);
    let mut fixed = file.fixed.clone();
    if fixed.is_empty() {
        fixed.extend(file.se2_vertices.first().map(|v| v.id));
        fixed.extend(file.se3_vertices.first().map(|v| v.id));
    }
    for id in &fixed {
        plane.get(id).into_iter().for_each(|key| graph.fix(*key));
        space.get(id).into_iter().for_each(|key| graph.fix(*key));
    }
    Ok((graph, values))
}
