//! The frames that are spoiled: rendered once per seed.

use depthcal_simulate::{Board, CameraTruth, Kind, Pose, RenderedFrame, Simulation, Truth};

use crate::Failure;

/// A capture of a board, the same frames with the board partly outside the image, and with a larger board.
pub struct Rendered {
    pub seed: u64,
    pub truth: Truth,
    pub frames: Vec<RenderedFrame>,
    pub outside: Vec<RenderedFrame>,
    pub larger: Vec<RenderedFrame>,
    /// Other frames, on which calibrations are judged.
    pub other: Simulation,
}

/// Spacing of the larger board over that of the board.
const LARGER: f64 = 1.18;

impl Rendered {
    pub fn new(seed: u64, frames: usize) -> Result<Self, Failure> {
        let camera = CameraTruth::published(1 + (seed % 4) as usize)?;
        let simulation = |seed: u64| Simulation::new(camera, Kind::General(1), &[], seed);
        let plain = simulation(500 + seed).frames(frames);
        let truth = plain.renderer()?.truth().clone();
        let poses: Vec<Pose> = truth.frames.iter().map(|frame| frame.pose).collect();
        let board = plain.renderer()?.truth().board;
        let outside = poses.iter().map(|pose| moved_to_border(pose, &camera, &board)).collect();
        let larger = Board { spacing_mm: LARGER * board.spacing_mm, ..board };
        let larger = match larger.pattern {
            depthcal_simulate::Pattern::AsymmetricCircles { circle_diameter_mm } => Board {
                pattern: depthcal_simulate::Pattern::AsymmetricCircles {
                    circle_diameter_mm: LARGER * circle_diameter_mm,
                },
                ..larger
            },
            _ => larger,
        };
        Ok(Self {
            seed,
            frames: rendered(&plain)?,
            outside: rendered(&simulation(700 + seed).poses(outside))?,
            larger: rendered(&simulation(800 + seed).poses(poses).board(larger))?,
            other: simulation(900 + seed).frames(40),
            truth,
        })
    }
}

fn rendered(simulation: &Simulation) -> Result<Vec<RenderedFrame>, Failure> {
    use rayon::prelude::*;
    let renderer = simulation.renderer()?;
    Ok((0..renderer.len()).into_par_iter().filter_map(|i| renderer.frame(i)).collect())
}

/// The pose with the middle of the board on the image's nearer vertical border.
fn moved_to_border(pose: &Pose, camera: &CameraTruth, board: &Board) -> Pose {
    let half = |count: usize| 0.5 * (count - 1) as f64 * board.spacing_mm;
    let middle = pose.apply([2.0 * half(board.columns), half(board.rows), 0.0]);
    let border = if middle[0] < 0.0 { -camera.centre_px[0] } else { camera.width as f64 - camera.centre_px[0] };
    let to = border * middle[2] / camera.focal_px[0];
    let mut moved = *pose;
    moved.translation[0] += to - middle[0];
    moved
}
