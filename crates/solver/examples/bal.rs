//! Bundle adjustment in the large: cameras and points from image observations.
//!
//! `cargo run --release -p depthcal-solver --example bal -- FILE --threads N` reads a problem of
//! <https://grail.cs.washington.edu/projects/bal/>, plain or compressed by bzip2, and prints one line of JSON.
//! `--nielsen` damps by the default rule.
//!
//! `cargo run --release -p depthcal-solver --example bal -- --generate CAMERAS FILE` writes a synthetic problem instead, of a
//! street around a block.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

#[path = "support/bal.rs"]
mod problem;
#[path = "support/street.rs"]
mod street;
mod support;
#[path = "support/words.rs"]
mod words;

use std::error::Error;

use depthcal_solver::{AutoDiffVariable, Batch, Damping, Factor, Graph, Noise, Over, Pose, Scalar, Values, Variable};
use nalgebra::{Isometry3, SVector, Translation3, UnitQuaternion, Vector2, Vector3};
use problem::BalProblem;

/// Pose, focal length in px, and radial distortion k1, k2.
#[derive(Clone, Debug)]
struct Camera {
    pose: Isometry3<f64>,
    intrinsics: Vector3<f64>,
}

impl Variable for Camera {
    fn dim(&self) -> usize {
        9
    }

    fn retract(&self, delta: &[f64]) -> Self {
        Self { pose: self.pose.retract(&delta[..6]), intrinsics: self.intrinsics.retract(&delta[6..]) }
    }

    fn local(&self, other: &Self, delta: &mut [f64]) {
        self.pose.local(&other.pose, &mut delta[..6]);
        self.intrinsics.local(&other.intrinsics, &mut delta[6..]);
    }
}

impl AutoDiffVariable for Camera {
    const DIM: usize = 9;
    type Over<T: Scalar> = (Pose<T>, Vector3<T>);

    #[inline(always)]
    fn retract_over<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> (Pose<T>, Vector3<T>) {
        (self.pose.retract_over(&delta), self.intrinsics.retract_over(|i| delta(i + 6)))
    }
}

/// A point observed at (u, v), in px from the centre.
struct Observation {
    pixel: Vector2<f64>,
}

/// Pixel of a point in the camera's frame, which looks along −z.
#[inline(always)]
fn project<T: Scalar>([x, y, z]: [T; 3], [f, k1, k2]: [T; 3]) -> [T; 2] {
    let rho = -z.recip();
    let (x, y) = (x * rho, y * rho);
    let r2 = x * x + y * y;
    let scale = f * ((k2 * r2 + k1) * r2 + 1.0);
    [scale * x, scale * y]
}

impl Factor<2> for Observation {
    type Variables = (Camera, Vector3<f64>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, ((pose, intrinsics), point): Over<Self::Variables, T>) -> SVector<T, 2> {
        let [u, v] = project(pose.transform(&point).into(), intrinsics.into());
        SVector::<T, 2>::new(u - self.pixel.x, v - self.pixel.y)
    }
}

fn build(problem: BalProblem) -> Result<(Graph, Values), Box<dyn Error>> {
    let mut values = Values::new();
    let cameras: Vec<_> = problem
        .cameras
        .iter()
        .map(|[r1, r2, r3, t1, t2, t3, f, k1, k2]| {
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(*r1, *r2, *r3));
            let pose = Isometry3::from_parts(Translation3::new(*t1, *t2, *t3), rotation);
            values.insert(Camera { pose, intrinsics: Vector3::new(*f, *k1, *k2) })
        })
        .collect();
    let points: Vec<_> = problem.points.iter().map(|p| values.insert(Vector3::from(*p))).collect();
    let mut observations = problem.observations;
    // Observations of a point are consecutive, so that its blocks of the normal equations stay in the cache.
    observations.sort_by_key(|o| (o.point, o.camera));
    let mut batch = Batch::new("observations").with_noise(Noise::unit());
    for o in &observations {
        batch.push(Observation { pixel: o.pixel.into() }, (cameras[o.camera], points[o.point]));
    }
    let mut graph = Graph::new();
    graph.add_batch(batch);
    Ok((graph, values))
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [option, count, path] = arguments.as_slice()
        && option == "--generate"
    {
        std::fs::write(path, street::generate(count.parse()?))?;
        return Ok(());
    }
    let parse = |path: &str| Ok(BalProblem::read(path)?);
    let nielsen = support::Arguments::read().has("--nielsen");
    support::run("bal", parse, build, |options| {
        options.cost_tolerance = 1e-6;
        // Points that a step brings close to a camera have derivatives that are huge once: D² as the largest so far then damps
        // them for good.
        if !nielsen {
            options.damping = Damping::Radius { initial: 1e4, max: 1e16 };
        }
    })?;
    Ok(())
}
