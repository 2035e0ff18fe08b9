//! The goal of further captures.

use depthcal_model::{Camera, Context};
use nalgebra::{DMatrix, Matrix3, Vector3};
use thiserror::Error;

use crate::calibrate::parameter_names;

/// Columns and rows of the grid over the image, and distances.
const GRID: [usize; 3] = [7, 5, 5];
/// Change of a parameter for a derivative, in standard deviations.
const STEP: f64 = 0.1;

/// The goal that further captures are to lower.
#[derive(Debug, Clone, PartialEq)]
pub enum Goal {
    /// Root mean square error of corrected depth over the image and a range of distances, mm, as far as the parameters make it.
    Depth {
        /// Nearest and farthest distance, mm.
        range_mm: [f64; 2],
    },
    /// Root mean square error of projection over the image at a distance, px, less the rotation that poses take up.
    Projection {
        /// The distance, mm.
        distance_mm: f64,
    },
    /// Error of one parameter, `PIECE.PARAMETER`, in its unit.
    Parameter(String),
}

/// Why a goal cannot be planned for.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum GoalError {
    /// There is no such parameter.
    #[error("the goal '{name}' is no free parameter of the camera: it has {known}")]
    UnknownParameter {
        /// The name.
        name: String,
        /// Names of the free parameters.
        known: String,
    },
    /// The parameters do not change what the goal is about.
    #[error("no free parameter of the camera changes the {goal}: fit a model that has one")]
    NothingChanges {
        /// The subject of the goal.
        goal: &'static str,
    },
}

impl Goal {
    /// The unit of its values.
    pub fn unit(&self, camera: &Camera) -> String {
        match self {
            Self::Depth { .. } => "mm".to_owned(),
            Self::Projection { .. } => "px".to_owned(),
            Self::Parameter(name) => {
                let parameters = camera.blocks().iter().flat_map(|block| {
                    block.parameters().iter().map(move |p| (format!("{}.{}", block.name(), p.name), p.unit))
                });
                parameters.into_iter().find(|(known, _)| known == name).map_or_else(String::new, |(_, u)| u.to_owned())
            }
        }
    }

    /// W with δᵀ W δ the mean square of the goal's quantities for a change δ of the given parameters, each in units of its
    /// standard deviation. `places` are those of the parameters in [`Camera::theta`].
    pub(super) fn weight(
        &self,
        camera: &Camera,
        conditions: &Context,
        (places, std_devs): (&[usize], &[f64]),
    ) -> Result<DMatrix<f64>, GoalError> {
        let p = places.len();
        if let Self::Parameter(name) = self {
            let names = parameter_names(camera);
            let number = places.iter().position(|place| names[*place].0 == *name);
            let number = number.ok_or_else(|| GoalError::UnknownParameter {
                name: name.clone(),
                known: places.iter().map(|place| names[*place].0.as_str()).collect::<Vec<_>>().join(", "),
            })?;
            let mut weight = DMatrix::zeros(p, p);
            weight[(number, number)] = std_devs[number].powi(2);
            return Ok(weight);
        }
        let quantities = |theta: &[f64]| self.quantities(camera, &camera.with_theta(theta), conditions);
        let theta = camera.theta();
        let columns: Vec<Vec<f64>> = (0..p)
            .map(|i| {
                let shifted = |by: f64| {
                    let mut theta = theta.clone();
                    theta[places[i]] += by * std_devs[i];
                    quantities(&theta)
                };
                shifted(STEP).iter().zip(shifted(-STEP)).map(|(a, b)| (a - b) / (2.0 * STEP)).collect()
            })
            .collect();
        let count = columns.first().map_or(0, Vec::len);
        // What cannot be computed at any change of a parameter is no part of the goal.
        let valid: Vec<usize> = (0..count).filter(|row| columns.iter().all(|c| c[*row].is_finite())).collect();
        let mut rows = DMatrix::from_fn(valid.len(), p, |row, column| columns[column][valid[row]]);
        if let Self::Projection { distance_mm } = self {
            remove_rotation(camera, *distance_mm, &valid, &mut rows);
        }
        let weight = rows.tr_mul(&rows) / valid.len().max(1) as f64;
        if weight.trace() > 0.0 {
            return Ok(weight);
        }
        let goal = if matches!(self, Self::Depth { .. }) { "depth" } else { "projection" };
        Err(GoalError::NothingChanges { goal })
    }

    /// The quantities of a camera that differs a little from the nominal one: corrected depth, or pixels of the nominal rays.
    fn quantities(&self, nominal: &Camera, camera: &Camera, conditions: &Context) -> Vec<f64> {
        let pixels = pixels(nominal);
        match self {
            Self::Depth { range_mm: [near, far] } => {
                let planes = (0..GRID[2]).map(|i| {
                    let t = i as f64 / (GRID[2] - 1) as f64;
                    1.0 / (t / near + (1.0 - t) / far)
                });
                let corrected = |pixel: [f64; 2], z: f64| {
                    let context = Context { pixel, ..*conditions };
                    camera.correct(&context, 1.0, 1.0 / z).map_or(f64::NAN, |(_, rho)| 1.0 / rho)
                };
                planes.flat_map(|z| pixels.iter().map(move |pixel| (*pixel, z))).map(|(p, z)| corrected(p, z)).collect()
            }
            Self::Projection { distance_mm } => {
                let projected = |pixel: &[f64; 2]| {
                    let ray = nominal.ray(*pixel, 1.0 / distance_mm).ok();
                    let point = ray.map(|[x, y]| Vector3::new(x, y, 1.0) * *distance_mm);
                    point.and_then(|point| camera.project(&point)).unwrap_or([f64::NAN; 2])
                };
                pixels.iter().flat_map(projected).collect()
            }
            Self::Parameter(_) => Vec::new(),
        }
    }
}

/// Pixels over the image.
fn pixels(camera: &Camera) -> Vec<[f64; 2]> {
    let place = |i: usize, n: usize, size: usize| (i as f64 + 0.5) * size as f64 / n as f64 - 0.5;
    let [columns, rows, _] = GRID;
    (0..columns * rows)
        .map(|i| [place(i % columns, columns, camera.width), place(i / columns, rows, camera.height)])
        .collect()
}

/// Takes out of derivatives of pixels what a rotation of the camera does alike.
fn remove_rotation(camera: &Camera, distance_mm: f64, valid: &[usize], rows: &mut DMatrix<f64>) {
    /// rad; small against the image, large against rounding.
    const TURN: f64 = 1e-5;
    let pixels = pixels(camera);
    let turned = |axis: usize, by: f64| {
        let rotation = nalgebra::Rotation3::new(Matrix3::identity().column(axis) * by);
        let projected = |pixel: &[f64; 2]| {
            let ray = camera.ray(*pixel, 1.0 / distance_mm).ok()?;
            camera.project(&(rotation * (Vector3::new(ray[0], ray[1], 1.0) * distance_mm)))
        };
        pixels.iter().flat_map(|pixel| projected(pixel).unwrap_or([f64::NAN; 2])).collect::<Vec<f64>>()
    };
    let columns = [0, 1, 2].map(|axis| {
        let (plus, minus) = (turned(axis, TURN), turned(axis, -TURN));
        plus.iter().zip(minus).map(|(a, b)| (a - b) / (2.0 * TURN)).collect::<Vec<f64>>()
    });
    let rotations = DMatrix::from_fn(valid.len(), 3, |row, axis| columns[axis][valid[row]]);
    if rotations.iter().all(|value| value.is_finite()) {
        let basis = rotations.qr().q();
        *rows -= &basis * basis.tr_mul(rows);
    }
}
