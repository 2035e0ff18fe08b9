//! Problems that several tests solve.
#![allow(dead_code)]

use depthcal_solver::{Batch, Factor, Graph, Key, LinearSolver, Loss, Noise, Over, Preconditioner, Scalar, Values};
use nalgebra::{Isometry3, SVector, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// All linear solvers that may be asked for.
pub const LINEAR_SOLVERS: [LinearSolver; 8] = [
    LinearSolver::Auto,
    LinearSolver::Dense,
    LinearSolver::SparseCholesky,
    LinearSolver::DenseSchur,
    LinearSolver::SparseSchur,
    LinearSolver::ConjugateGradients(Preconditioner::BlockJacobi),
    LinearSolver::ConjugateGradients(Preconditioner::SchurJacobi),
    LinearSolver::SparseQr,
];

pub fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

pub fn normal3(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| normal(rng))
}

/// y = a exp(b x).
pub struct Exponential {
    pub x: f64,
    pub y: f64,
}

impl Factor<1> for Exponential {
    type Variables = (Vector2<f64>,);

    fn residual<T: Scalar>(&self, (p,): Over<Self::Variables, T>) -> SVector<T, 1> {
        SVector::<T, 1>::new(p[0] * (p[1] * self.x).exp() - self.y)
    }
}

/// A point in a camera with focal length and one radial coefficient.
pub struct Projection {
    pub observed: Vector2<f64>,
}

impl Factor<2> for Projection {
    type Variables = (Isometry3<f64>, Vector2<f64>, Vector3<f64>);

    fn residual<T: Scalar>(&self, (pose, camera, point): Over<Self::Variables, T>) -> SVector<T, 2> {
        let x = pose.transform(&point);
        let (u, v) = (x[0] / x[2], x[1] / x[2]);
        let radial = (u * u + v * v) * camera[1] + 1.0;
        let f = camera[0] * radial;
        SVector::<T, 2>::new(f * u - self.observed.x, f * v - self.observed.y)
    }
}

/// The distance between two points.
pub struct Distance(pub f64);

impl Factor<1> for Distance {
    type Variables = (Vector3<f64>, Vector3<f64>);

    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, 1> {
        let d = a - b;
        SVector::<T, 1>::new((d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt() - self.0)
    }
}

/// Relative pose between two poses: rotation and translation, tangent order.
pub struct Between(pub Isometry3<f64>);

impl Factor<6> for Between {
    type Variables = (Isometry3<f64>, Isometry3<f64>);

    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, 6> {
        let measured = depthcal_solver::Pose::<T>::constant(&self.0.inverse());
        let error = measured.compose(&a.inverse().compose(&b));
        let r = error.rotation.log();
        let t = error.translation;
        SVector::from([r[0], r[1], r[2], t[0], t[1], t[2]])
    }
}

pub struct Bundle {
    pub graph: Graph,
    /// Perturbed start.
    pub values: Values,
    pub truth: Values,
    pub poses: Vec<Key<Isometry3<f64>>>,
    pub camera: Key<Vector2<f64>>,
    pub points: Vec<Key<Vector3<f64>>>,
}

/// Cameras on an arc that look at a cloud of points; one camera model is shared. Gauge: the first pose and one coordinate of
/// the second are fixed.
pub fn bundle(cameras: usize, points: usize, noise: f64, loss: Loss, seed: u64) -> Bundle {
    let mut rng = rng(seed);
    let mut truth = Values::new();
    let mut values = Values::new();
    let mut graph = Graph::new();
    let camera = truth.insert(Vector2::new(500.0, -0.1));
    values.insert(Vector2::new(510.0, -0.05));
    let mut poses = Vec::new();
    for i in 0..cameras {
        let angle = 0.15 * (i as f64 - 0.5 * cameras as f64);
        let rotation = UnitQuaternion::from_euler_angles(0.02 * i as f64, angle, 0.1 * (i as f64).sin());
        let pose = Isometry3::from_parts(Translation3::new(-4.0 * angle.sin(), 0.05 * i as f64, 4.0), rotation);
        poses.push(truth.insert(pose));
        let (w, t) = if i == 0 { (Vector3::zeros(), Vector3::zeros()) } else { (normal3(&mut rng), normal3(&mut rng)) };
        let mut t = 0.02 * t;
        if i == 1 {
            t.x = 0.0;
        }
        values.insert(Isometry3::from_parts(
            Translation3::from(pose.translation.vector + t),
            pose.rotation * UnitQuaternion::from_scaled_axis(0.01 * w),
        ));
    }
    let mut keys = Vec::new();
    for _ in 0..points {
        let point = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        keys.push(truth.insert(point));
        values.insert(point + 0.03 * normal3(&mut rng));
    }
    let mut batch =
        Batch::new("projections").with_noise(Noise::isotropic(if noise > 0.0 { noise } else { 1.0 }).unwrap());
    batch = batch.with_loss(loss);
    for (i, pose) in poses.iter().enumerate() {
        for (j, point) in keys.iter().enumerate() {
            // Every point is seen by most cameras, not by all.
            if (i + j) % 4 == 3 {
                continue;
            }
            let exact = Projection { observed: Vector2::zeros() }.residual::<f64>((
                depthcal_solver::Pose::constant(truth.get(*pose)),
                *truth.get(camera),
                *truth.get(*point),
            ));
            let observed = exact + noise * Vector2::from_fn(|_, _| normal(&mut rng));
            batch.push(Projection { observed }, (*pose, camera, *point));
        }
    }
    graph.add_batch(batch);
    graph.fix(poses[0]);
    graph.fix_partly(poses[1], &[false, false, false, true, false, false]);
    Bundle { graph, values, truth, poses, camera, points: keys }
}
