//! The infrared image.

use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::look::Look;
use super::renderer::Renderer;
use crate::defects::Shot;
use crate::streams::{Purpose, stream};

/// The infrared signal at every pixel (row-major) with the lens' blur, without noise, share of full scale.
pub(super) fn signal(renderer: &Renderer<'_>, shot: &Shot) -> Vec<f32> {
    let simulation = renderer.session.simulation;
    let (width, height) = (simulation.camera.width, simulation.camera.height);
    let look = Look::new(renderer, shot);
    let mut signal = vec![0.0f32; width * height];
    signal.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
        for (column, value) in values.iter_mut().enumerate() {
            *value = look.pixel([column as f64, row as f64]) as f32;
        }
    });
    signal
}

/// The image with noise, quantised to its bits.
pub(super) fn expose(renderer: &Renderer<'_>, shot: &Shot, signal: &[f32]) -> Vec<u16> {
    let simulation = renderer.session.simulation;
    let noise = simulation.noise;
    let mut rng = stream(renderer.session.seed(), Purpose::ImageNoise, shot.source);
    let full = if simulation.rendering.image_bits == 16 { 65535.0 } else { 255.0 };
    let expose = |&signal: &f32| {
        let signal = f64::from(signal);
        let sigma = (noise.image_read * noise.image_read + noise.image_shot * signal).sqrt();
        let value = signal + sigma * rng.sample::<f64, _>(StandardNormal);
        (value.clamp(0.0, 1.0) * full).round() as u16
    };
    signal.iter().map(expose).collect()
}
