//! A curve fitted to points with outliers, by a robust loss.
//!
//! `cargo run --release -p depthcal-solver --example curve` fits y = a exp(b x) to 200 points, 40 of which are wrong, by least
//! squares and with Cauchy's loss, and prints both with their standard deviations.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::error::Error;

use depthcal_solver::{
    Batch, Covariance, CovarianceOptions, Factor, Graph, Loss, Noise, Options, Over, Scalar, Values, minimize,
};
use nalgebra::{SVector, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A point of the curve, with y measured.
#[derive(Clone, Copy)]
struct Point {
    x: f64,
    y: f64,
}

impl Factor<1> for Point {
    type Variables = (Vector2<f64>,);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (curve,): Over<Self::Variables, T>) -> SVector<T, 1> {
        SVector::<T, 1>::new(curve[0] * (curve[1] * self.x).exp() - self.y)
    }
}

/// Standard deviation of y.
const SIGMA: f64 = 0.05;
const TRUE: [f64; 2] = [1.5, 0.3];

fn main() -> Result<(), Box<dyn Error>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let points: Vec<Point> = (0..200)
        .map(|i| {
            let x = 0.02 * f64::from(i);
            let noise: f64 = StandardNormal.sample(&mut rng);
            let outlier = if i % 5 == 0 { rng.random_range(0.0..4.0) } else { 0.0 };
            Point { x, y: TRUE[0] * (TRUE[1] * x).exp() + SIGMA * noise + outlier }
        })
        .collect();
    for (name, loss) in [("least squares", Loss::Trivial), ("Cauchy", Loss::Cauchy { scale: 2.0 })] {
        let mut values = Values::new();
        let curve = values.insert(Vector2::new(1.0, 0.0));
        let mut batch = Batch::new("points").with_noise(Noise::isotropic(SIGMA)?).with_loss(loss);
        points.iter().for_each(|point| batch.push(*point, (curve,)));
        let mut graph = Graph::new();
        graph.add_batch(batch);
        let solution = minimize(&graph, values, &Options::default())?;
        let covariance = Covariance::compute(&graph, &solution.values, &CovarianceOptions::default())?;
        let (fitted, marginal) = (solution.values.get(curve), covariance.marginal(curve));
        println!(
            "{name}: a = {:.3} ± {:.3}, b = {:.4} ± {:.4} (true: {}, {})",
            fitted[0],
            marginal[(0, 0)].sqrt(),
            fitted[1],
            marginal[(1, 1)].sqrt(),
            TRUE[0],
            TRUE[1]
        );
    }
    Ok(())
}
