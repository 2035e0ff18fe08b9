//! Time and temperature of frames.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use crate::streams::{Purpose, stream};

/// Time and temperature of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Conditions {
    /// Index of the frame in capture order.
    pub frame: usize,
    /// Seconds since the first frame.
    pub time_s: f64,
    /// Duration of the session, first to last frame, s; 1 for a single frame.
    pub session_s: f64,
    /// Temperature of the camera, °C.
    pub temperature_c: f64,
}

/// Reference temperature of drifts, °C.
pub(crate) const REFERENCE_TEMPERATURE_C: f64 = 30.0;

/// Conditions of `frames` frames, some seconds apart. The camera warms up, its fan cycles and the room has draughts, so
/// that temperature and time are not collinear.
pub(crate) fn choose(frames: usize, seed: u64) -> Vec<Conditions> {
    let mut rng = stream(seed, Purpose::Conditions, 0);
    let mut clock = 0.0;
    let times: Vec<f64> = (0..frames)
        .map(|_| {
            let now = clock;
            clock += rng.random_range(3.0..9.0);
            now
        })
        .collect();
    let session_s = times.last().copied().unwrap_or(0.0).max(1.0);
    let phase = rng.random::<f64>() * std::f64::consts::TAU;
    let cycles = rng.random_range(1.6..2.4);
    let conditions = |(frame, &time_s): (usize, &f64)| {
        let share = time_s / session_s;
        let warming = 2.5 * (1.0 - (-share / 0.4).exp());
        let fan = 2.8 * (std::f64::consts::TAU * cycles * share + phase).sin();
        let draught = rng.random_range(-0.4..0.4);
        let temperature_c = REFERENCE_TEMPERATURE_C + warming + fan + draught;
        Conditions { frame, time_s, session_s, temperature_c }
    };
    times.iter().enumerate().map(conditions).collect()
}

/// Conditions of the frames of a video, which is too short for the temperature to change.
pub(crate) fn video(frames: usize, period_s: f64) -> Vec<Conditions> {
    let session_s = (period_s * frames.saturating_sub(1) as f64).max(1.0);
    let conditions_of = |frame: usize| Conditions {
        frame,
        time_s: period_s * frame as f64,
        session_s,
        temperature_c: REFERENCE_TEMPERATURE_C,
    };
    (0..frames).map(conditions_of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_and_temperature_can_be_told_apart() {
        for seed in 0..50 {
            let frames = choose(27, seed);
            assert!(frames.windows(2).all(|pair| pair[1].time_s > pair[0].time_s + 2.0));
            let falls = frames.windows(2).filter(|pair| pair[1].temperature_c < pair[0].temperature_c).count();
            assert!(falls > 5, "{falls}");
            let mean = |values: &dyn Fn(&Conditions) -> f64| frames.iter().map(values).sum::<f64>() / 27.0;
            let (t, c) = (mean(&|f| f.time_s), mean(&|f| f.temperature_c));
            let product = mean(&|f| (f.time_s - t) * (f.temperature_c - c));
            let norm = (mean(&|f| (f.time_s - t).powi(2)) * mean(&|f| (f.temperature_c - c).powi(2))).sqrt();
            assert!((product / norm).abs() < 0.8, "{}", product / norm);
        }
    }
}
