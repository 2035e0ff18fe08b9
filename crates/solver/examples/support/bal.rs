//! Reader of problems of Bundle Adjustment in the Large, a benchmark of solvers (Agarwal, Snavely, Seitz, Szeliski 2010).

use std::fs;
use std::io::Read;
use std::path::Path;

use bzip2::read::MultiBzDecoder;

use crate::words::{ProblemFileError, Words, utf8};

/// Most bytes of text per byte of a compressed file.
const LARGEST_RATIO: u64 = 64;

/// A bundle adjustment problem.
///
/// A camera is [r1 r2 r3, t1 t2 t3, f, k1, k2]: rotation vector (rad), translation, focal length (px), and radial
/// distortion. It projects the point X to the pixel f (1 + k1 ‖p‖² + k2 ‖p‖⁴) p with P = R X + t and p = −(P.x, P.y) / P.z:
/// the camera looks along −z, and pixel coordinates have their origin at the image's centre, with y up.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BalProblem {
    /// Cameras.
    pub cameras: Vec<[f64; 9]>,
    /// Points, in the units of the translations.
    pub points: Vec<[f64; 3]>,
    /// Observations; their indices are within `cameras` and `points`.
    pub observations: Vec<BalObservation>,
}

/// A point seen by a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BalObservation {
    /// Index of the camera.
    pub camera: usize,
    /// Index of the point.
    pub point: usize,
    /// Observed pixel coordinates, px.
    pub pixel: [f64; 2],
}

impl BalProblem {
    /// Reads a problem from text, plain or compressed by bzip2, which is recognised by its contents.
    ///
    /// # Errors
    /// [`ProblemFileError::Read`]; [`ProblemFileError::Line`] names the line that does not follow the format.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, ProblemFileError> {
        let path = path.as_ref();
        let read_error = |error| ProblemFileError::Read { path: path.to_owned(), error };
        let mut bytes = fs::read(path).map_err(read_error)?;
        if bytes.starts_with(b"BZh") {
            // Numbers shrink to a fifth; what is much shorter is made to fill the memory.
            let limit = LARGEST_RATIO * bytes.len() as u64;
            let mut text = Vec::new();
            MultiBzDecoder::new(bytes.as_slice()).take(limit + 1).read_to_end(&mut text).map_err(read_error)?;
            if text.len() as u64 > limit {
                let problem =
                    format!("it is {LARGEST_RATIO} times as long without compression, which is no list of numbers");
                return Err(read_error(std::io::Error::new(std::io::ErrorKind::InvalidData, problem)));
            }
            bytes = text;
        }
        Self::parse(path, &bytes)
    }

    /// Parses the contents of a file; `path` only appears in errors.
    ///
    /// # Errors
    /// [`ProblemFileError::Line`].
    pub fn parse(path: &Path, text: &[u8]) -> Result<Self, ProblemFileError> {
        let mut words = Words::new(path, utf8(path, text)?, 1);
        let cameras = words.count("the number of cameras")?;
        let points = words.count("the number of points")?;
        let observations = words.count("the number of observations")?;

        // No memory is reserved from these counts: those of a damaged file may be huge.
        let mut problem = BalProblem::default();
        for _ in 0..observations {
            let index = |words: &mut Words<'_>, what: &str, count: usize| match words.count(what)? {
                index if index < count => Ok(index),
                index => Err(words.error(format_args!("{what} is {index}, but there are {count}"))),
            };
            let camera = index(&mut words, "the index of a camera", cameras)?;
            let point = index(&mut words, "the index of a point", points)?;
            let pixel = words.numbers("a pixel coordinate")?;
            problem.observations.push(BalObservation { camera, point, pixel });
        }
        for _ in 0..cameras {
            problem.cameras.push(words.numbers("a camera's parameter")?);
        }
        for _ in 0..points {
            problem.points.push(words.numbers("a point's coordinate")?);
        }
        words.end()?;
        Ok(problem)
    }
}
