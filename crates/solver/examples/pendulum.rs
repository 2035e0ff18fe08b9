//! A pendulum that is slowed down by the air, fitted by a model without air: what is the model missing?
//!
//! `cargo run --release -p depthcal-solver --example pendulum`
//!
//! In each of 24 swings a sensor on the pendulum measures its angle, its rate and its angular acceleration; the sensor of the
//! acceleration has an offset that is another one in every swing. The model is α = −ω² sin θ + offset. What the residuals depend
//! on is searched among functions of angle, rate and time; it is the rate, by a drag of −c |θ̇| θ̇.
#![allow(clippy::print_stdout, reason = "a program that prints")]

use std::error::Error;

use depthcal_solver::additive::{Covariate, Observed, missing_functions};
use depthcal_solver::{Batch, Factor, Graph, Noise, Options, Over, Scalar, Values, VariableId, minimize};
use nalgebra::{SVector, Vector1};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Squared angular frequency of small swings, 1/s², and drag.
const OMEGA_SQUARED: f64 = 9.81 / 0.8;
const DRAG: f64 = 0.08;
/// Standard deviation of the measured angular acceleration, rad/s².
const SIGMA: f64 = 0.05;
const SWINGS: usize = 24;
const MEASUREMENTS: usize = 120;
/// Time between measurements, s.
const PERIOD_S: f64 = 0.05;

/// A measurement of angle, rate and angular acceleration at a time.
#[derive(Clone, Copy)]
struct Measurement {
    angle: f64,
    rate: f64,
    acceleration: f64,
    time_s: f64,
}

impl Factor<1> for Measurement {
    /// ω² and the swing's offset.
    type Variables = (Vector1<f64>, Vector1<f64>);

    fn residual<T: Scalar>(&self, (omega_squared, offset): Over<Self::Variables, T>) -> SVector<T, 1> {
        SVector::<T, 1>::new(offset[0] - omega_squared[0] * self.angle.sin() - self.acceleration)
    }
}

/// A swing from rest, by small steps of its equation of motion.
fn swing(rng: &mut ChaCha8Rng) -> Vec<Measurement> {
    const STEPS: usize = 100;
    let (mut angle, mut rate) = (rng.random_range(0.4..1.4), 0.0_f64);
    let offset: f64 = rng.random_range(-0.3..0.3);
    let mut measured = Vec::new();
    for number in 0..MEASUREMENTS {
        let acceleration = |angle: f64, rate: f64| -OMEGA_SQUARED * angle.sin() - DRAG * rate.abs() * rate;
        let noise: f64 = StandardNormal.sample(rng);
        measured.push(Measurement {
            angle,
            rate,
            acceleration: acceleration(angle, rate) + offset + SIGMA * noise,
            time_s: PERIOD_S * number as f64,
        });
        for _ in 0..STEPS {
            rate += acceleration(angle, rate) * PERIOD_S / STEPS as f64;
            angle += rate * PERIOD_S / STEPS as f64;
        }
    }
    measured
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut values = Values::new();
    let omega_squared = values.insert(Vector1::new(10.0));
    let (mut batch, mut measured) = (Batch::new("acceleration").with_noise(Noise::isotropic(SIGMA)?), Vec::new());
    let mut offsets: Vec<VariableId> = Vec::new();
    for _ in 0..SWINGS {
        let offset = values.insert(Vector1::zeros());
        offsets.push(offset.into());
        for measurement in swing(&mut rng) {
            batch.push(measurement, (omega_squared, offset));
            measured.push(measurement);
        }
    }
    let mut graph = Graph::new();
    let batch = graph.add_batch(batch);
    let solution = minimize(&graph, values, &Options::default())?;
    let rms = (2.0 * graph.cost(&solution.values)? / measured.len() as f64).sqrt();
    println!("without drag: residuals of {rms:.2} standard deviations");

    let covariates = [Covariate::new("angle"), Covariate::new("rate"), Covariate::new("time")];
    let functions = missing_functions(&graph, &solution.values, &offsets, batch, &covariates, |row| {
        let Measurement { angle, rate, time_s, .. } = measured[row];
        // The function is added to the predicted acceleration.
        Observed { covariates: vec![angle, rate, time_s], slope: 1.0 / SIGMA }
    })?;
    for function in &functions {
        println!("a function of {} explains {:.1} % of what is left:", function.covariates.join(" and "), {
            100.0 * function.share
        });
        println!("{:>12} {:>12} {:>12}", "rate rad/s", "found", "drag");
        for step in -4..=4 {
            let rate = f64::from(step);
            let value = function.value(&[0.0, rate, 0.0]);
            println!("{rate:>12.1} {value:>12.3} {:>12.3}", -DRAG * rate.abs() * rate);
        }
    }
    Ok(())
}
