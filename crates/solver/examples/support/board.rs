//! Calibration of a depth camera by a board: the factor, and the reader of its files.

use std::error::Error;

use depthcal_solver::{Factor, Over, Scalar};
use nalgebra::{Isometry3, SVector, Vector3, Vector4};

/// A point of the board, and where a frame has it.
pub struct Observation {
    /// mm.
    pub board: [f64; 3],
    /// px, px, 1/mm.
    pub observed: [f64; 3],
}

impl Factor<3> for Observation {
    type Variables = (Isometry3<f64>, Vector4<f64>, SVector<f64, 5>, Vector4<f64>);

    #[inline(always)]
    fn residual<T: Scalar>(&self, (pose, pinhole, lens, depth): Over<Self::Variables, T>) -> SVector<T, 3> {
        let [x, y, z] = self.board;
        let p = Vector3::new(T::from(x), T::from(y), T::from(z));
        let x = pose.transform(&p);
        let rho = x[2].recip();
        let (x, y) = (x[0] * rho, x[1] * rho);
        let (x2, y2, xy) = (x * x, y * y, x * y * 2.0);
        let r2 = x2 + y2;
        let radial = ((lens[4] * r2 + lens[1]) * r2 + lens[0]) * r2 + 1.0;
        let dx = x * radial + lens[2] * xy + lens[3] * (r2 + x2 * 2.0);
        let dy = y * radial + lens[2] * (r2 + y2 * 2.0) + lens[3] * xy;
        let u = pinhole[0] * dx + pinhole[2];
        let v = pinhole[1] * dy + pinhole[3];
        let measured = depth[0] * x + depth[1] * y + depth[2] + depth[3] * rho;
        SVector::<T, 3>::new(u - self.observed[0], v - self.observed[1], measured - self.observed[2])
    }
}

/// Frames of a board, with start values.
pub struct Problem {
    /// Pinhole, lens and depth.
    pub initial: [f64; 13],
    /// Standard deviations in px and in 1/mm.
    pub sigmas: [f64; 2],
    /// mm.
    pub board: Vec<[f64; 3]>,
    /// Rotation vector and translation, then (u, v, z) of all points, for each frame.
    pub frames: Vec<([f64; 6], Vec<[f64; 3]>)>,
}

/// Reads a file of `board_44_N.txt`.
pub fn parse(path: &str) -> Result<Problem, Box<dyn Error>> {
    let text = std::fs::read_to_string(path)?;
    let mut numbers = text.split_ascii_whitespace().map(str::parse::<f64>);
    let mut next = || numbers.next().unwrap_or_else(|| "".parse());
    let (frames, points) = (next()? as usize, next()? as usize);
    let sigmas = [next()?, next()?];
    let _truth = array::<13>(&mut next)?;
    let initial = array(&mut next)?;
    let board = (0..points).map(|_| array(&mut next)).collect::<Result<_, _>>()?;
    let frames = (0..frames).map(|_| {
        let _truth = array::<6>(&mut next)?;
        Ok::<_, Box<dyn Error>>((array(&mut next)?, (0..points).map(|_| array(&mut next)).collect::<Result<_, _>>()?))
    });
    let frames = frames.collect::<Result<_, _>>()?;
    Ok(Problem { initial, sigmas, board, frames })
}

fn array<const N: usize>(
    mut next: impl FnMut() -> Result<f64, std::num::ParseFloatError>,
) -> Result<[f64; N], std::num::ParseFloatError> {
    let mut array = [0.0; N];
    for x in &mut array {
        *x = next()?;
    }
    Ok(array)
}
