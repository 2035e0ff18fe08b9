//! Captures of which camera, board, poses, number of frames and noise are drawn at random.

use depthcal_simulate::{Board, CameraTruth, DepthNoise, Effect, Kind, Noise, Pattern, Rendering, Simulation};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Failure;

/// A simulation with everything drawn, and the law of its depth noise.
pub struct Drawn {
    pub simulation: Simulation,
    pub noise: Noise,
}

/// A capture with effects, or without; the seed decides all the rest, and it is the same with and without effects.
pub fn drawn(effects: &[Effect], seed: u64) -> Result<Drawn, Failure> {
    drawn_of(effects, seed, None)
}

/// As [`drawn`], with a number of frames where it is given.
pub fn drawn_of(effects: &[Effect], seed: u64, frames: Option<usize>) -> Result<Drawn, Failure> {
    let mut rng = ChaCha8Rng::seed_from_u64(7000 + seed);
    let camera = CameraTruth::published(rng.random_range(1..=4))?;
    let boards = [
        Board::default(),
        Board::new(Pattern::Chessboard, 9, 6, 28.0),
        Board::new(Pattern::Chessboard, 7, 5, 40.0),
        Board::new(Pattern::SymmetricCircles { circle_diameter_mm: 14.0 }, 8, 6, 28.0),
    ];
    let board = boards[rng.random_range(0..boards.len())];
    let kind = [Kind::General(1), Kind::General(1), Kind::Plywood1, Kind::Filling1][rng.random_range(0..4)];
    let drawn_frames = rng.random_range(24..=40);
    // Some 0.8 to 4 mm at a metre, as of structured light or of time of flight.
    let depth = match rng.random_bool(0.5) {
        true => DepthNoise::Disparity { sigma_rho: 10f64.powf(rng.random_range(-6.1..-5.4)) },
        false => DepthNoise::TimeOfFlight { sigma_mm: 10f64.powf(rng.random_range(-0.1..0.6)) },
    };
    let noise = Noise {
        depth,
        depth_correlation_px: [0.0, 0.8, 1.3, 2.5][rng.random_range(0..4)],
        depth_step_rho: 0.0,
        tail_dof: [None, None, Some(5.0)][rng.random_range(0..3)],
        ..Noise::default()
    };
    // A fine unit: a coarse one is an error of its own where noise is small.
    let rendering = Rendering { depth_unit_mm: 0.03, max_range_mm: 1900.0, wall_mm: 1800.0, ..Rendering::default() };
    let simulation = Simulation::new(camera, kind, effects, 100 + seed)
        .unit(seed)
        .board(board)
        .frames(frames.unwrap_or(drawn_frames))
        .noise(noise)
        .rendering(rendering);
    Ok(Drawn { simulation, noise })
}
