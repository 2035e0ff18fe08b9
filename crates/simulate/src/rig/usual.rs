//! Usual cameras of rigs, by name.

use super::camera::{RigCamera, Streams};
use crate::camera::CameraTruth;
use crate::error::SimulateError;
use crate::noise::{DepthNoise, Noise};
use crate::pose::Pose;

impl RigCamera {
    /// A usual camera by its name: `infrared` (the published camera `model` of infrared and depth), `colour` (1280×720 px, 52
    /// mm to its side) and `depth` (time of flight, 512×424 px, without images), each with a number behind for the second
    /// and further ones, which sit farther to the side and are turned inwards. `None` for other names.
    ///
    /// # Errors
    /// [`SimulateError::UnknownCamera`] where there is no such published camera.
    pub fn usual(name: &str, model: usize) -> Result<Option<Self>, SimulateError> {
        let word = name.trim_end_matches(|c: char| c.is_ascii_digit());
        let number = name[word.len()..].parse::<usize>().unwrap_or(1).max(1);
        // A metre away, further cameras look at the same place.
        let side = 180.0 * (number - 1) as f64;
        let inwards = (side / 1000.0_f64).atan();
        let away = Pose::from_rotation_vector([0.0, inwards, 0.0], [0.0; 3]);
        let place = |turn: [f64; 3], shift: [f64; 3]| {
            let shift = [shift[0] - side, shift[1], shift[2]];
            Pose::from_rotation_vector(turn, [0.0; 3]).after(&away).after(&Pose::from_rotation_vector([0.0; 3], shift))
        };
        Ok(match word {
            "infrared" => {
                let truth = CameraTruth::published((model + number - 2) % 4 + 1)?;
                let turn = if number == 1 { [0.0; 3] } else { [0.01, -0.006, 0.004] };
                Some(Self::new(name, Streams::InfraredAndDepth, truth, place(turn, [0.0; 3])))
            }
            "colour" => {
                let truth = CameraTruth {
                    centre_px: [644.0, 352.5],
                    focal_px: [931.0, 929.5],
                    lens: [0.09, -0.21, -0.0008, 0.0011, 0.08],
                    ..CameraTruth::ideal(1280, 720, 930.0)
                };
                Some(Self::new(name, Streams::Colour, truth, place([0.012, -0.021, 0.006], [52.3, -1.4, 3.2])))
            }
            "depth" => {
                let truth = CameraTruth {
                    centre_px: [258.6, 208.2],
                    focal_px: [365.4, 365.9],
                    lens: [0.09, -0.26, 0.0007, -0.0005, 0.09],
                    depth: [4.0e-6, -3.0e-6, 1.2e-5, 0.997],
                    ..CameraTruth::ideal(512, 424, 365.0)
                };
                let mut camera =
                    Self::new(name, Streams::Depth, truth, place([-0.008, 0.015, -0.003], [-71.5, 3.0, -4.1]));
                camera.noise = Noise { depth: DepthNoise::TimeOfFlight { sigma_mm: 2.0 }, ..Noise::default() };
                Some(camera)
            }
            _ => None,
        })
    }
}
