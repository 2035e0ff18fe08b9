//! A variable on a manifold of one's own: the orientation of a plane figure as a unit complex number.
//!
//! `cargo run --release -p depthcal-solver --example own_manifold` finds the turn, the scale and the shift between two sets of
//! points. Unlike an angle it does not jump at ±π. A line or a camera with a lens of one's own is written in the same way.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::error::Error;

use depthcal_solver::{
    AutoDiffVariable, Batch, Factor, Graph, Noise, Options, Over, Scalar, Values, Variable, minimize,
};
use nalgebra::{SVector, Vector1, Vector2};

/// cos φ + i sin φ.
#[derive(Clone, Debug)]
struct Turn {
    cos: f64,
    sin: f64,
}

/// One tangent component, the angle by which the figure is turned further.
impl Variable for Turn {
    fn dim(&self) -> usize {
        1
    }

    fn retract(&self, delta: &[f64]) -> Self {
        let (s, c) = delta[0].sin_cos();
        Self { cos: self.cos * c - self.sin * s, sin: self.sin * c + self.cos * s }
    }

    fn local(&self, other: &Self, delta: &mut [f64]) {
        delta[0] = (self.cos * other.sin - self.sin * other.cos).atan2(self.cos * other.cos + self.sin * other.sin);
    }
}

/// A step over dual numbers, to first order in δ.
impl AutoDiffVariable for Turn {
    const DIM: usize = 1;
    type Over<T: Scalar> = [T; 2];

    #[inline(always)]
    fn retract_over<T: Scalar>(&self, delta: impl Fn(usize) -> T) -> [T; 2] {
        [-delta(0) * self.sin + self.cos, delta(0) * self.cos + self.sin]
    }
}

/// A point and its image.
struct Pair {
    from: Vector2<f64>,
    to: Vector2<f64>,
}

impl Factor<2> for Pair {
    type Variables = (Turn, Vector1<f64>, Vector2<f64>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, ([cos, sin], scale, shift): Over<Self::Variables, T>) -> SVector<T, 2> {
        let [x, y] = [self.from.x, self.from.y];
        let turned = [cos * x - sin * y, sin * x + cos * y];
        SVector::<T, 2>::new(scale[0] * turned[0] + shift[0] - self.to.x, scale[0] * turned[1] + shift[1] - self.to.y)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let (angle, scale, shift) = (2.5_f64, 1.8, Vector2::new(3.0, -1.0));
    let (s, c) = angle.sin_cos();
    let mut values = Values::new();
    let keys =
        (values.insert(Turn { cos: 1.0, sin: 0.0 }), values.insert(Vector1::new(1.0)), values.insert(Vector2::zeros()));
    let mut pairs = Batch::new("pairs").with_noise(Noise::isotropic(0.01)?);
    for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 2.0), (-1.0, 1.5)] {
        let to = Vector2::new(c * x - s * y, s * x + c * y) * scale + shift;
        pairs.push(Pair { from: Vector2::new(x, y), to }, keys);
    }
    let mut graph = Graph::new();
    graph.add_batch(pairs);
    let solution = minimize(&graph, values, &Options::default())?;
    let turn = solution.values.get(keys.0);
    println!(
        "turned by {:.6} (true: {angle}), scaled by {:.6} (true: {scale}), after {} iterations",
        turn.sin.atan2(turn.cos),
        solution.values.get(keys.1)[0],
        solution.report.iterations
    );
    Ok(())
}
