//! Bundle Adjustment in the Large: a benchmark of solvers (Agarwal, Snavely, Seitz, Szeliski 2010).

use std::fs;
use std::io::Read;
use std::path::Path;

use bzip2::read::MultiBzDecoder;

use crate::FileError;
use crate::numbers::{Words, utf8};

/// A bundle adjustment problem.
///
/// A camera is [r1 r2 r3, t1 t2 t3, f, k1, k2]: rotation vector (rad), translation, focal length in px, and radial
/// distortion. It sees the point X at f (1 + k1 p² + k2 p⁴) p with P = R X + t and p = −(P.x, P.y) / P.z: the camera
/// looks along −z, and pixels count from the image's centre, y up.
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
    /// Where the camera sees it, px.
    pub pixel: [f64; 2],
}

impl BalProblem {
    /// Reads a problem from text, plain or compressed by bzip2 (told by the contents).
    ///
    /// # Errors
    /// [`FileError::Read`]; [`FileError::Line`] names the line that does not follow the format.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let path = path.as_ref();
        let read_error = |error| FileError::Read { path: path.to_owned(), error };
        let mut bytes = fs::read(path).map_err(read_error)?;
        if bytes.starts_with(b"BZh") {
            let mut text = Vec::new();
            MultiBzDecoder::new(bytes.as_slice()).read_to_end(&mut text).map_err(read_error)?;
            bytes = text;
        }
        Self::parse(path, &bytes)
    }

    /// Parses the contents of `path`, which is only named in errors.
    ///
    /// # Errors
    /// [`FileError::Line`].
    pub fn parse(path: &Path, text: &[u8]) -> Result<Self, FileError> {
        let mut words = Words::new(path, utf8(path, text)?, 1);
        let cameras = words.count("the number of cameras")?;
        let points = words.count("the number of points")?;
        let observations = words.count("the number of observations")?;

        // Grown as the text is read: the head of a broken file must not ask for all memory.
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

#[cfg(test)]
mod tests {
    use std::io::Write;

    use proptest::prelude::*;

    use super::*;

    const TEXT: &str = "1 2 2\n0 0 -3.859900e+02 3.871200e+02\n0 1 1.5 2.5\n\
                        0.1\n0.2\n0.3\n1\n2\n3\n500\n-1e-7\n1e-13\n1\n2\n3\n4\n5\n6\n";

    fn parse(text: &str) -> Result<BalProblem, FileError> {
        BalProblem::parse(Path::new("problem.txt"), text.as_bytes())
    }

    #[test]
    fn reads_plain_and_compressed() {
        let problem = parse(TEXT).unwrap();
        assert_eq!(problem.cameras, [[0.1, 0.2, 0.3, 1.0, 2.0, 3.0, 500.0, -1e-7, 1e-13]]);
        assert_eq!(problem.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert_eq!(problem.observations[0].pixel, [-385.99, 387.12]);

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("problem.txt.bz2");
        let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
        encoder.write_all(TEXT.as_bytes()).unwrap();
        let bytes = encoder.finish().unwrap();
        fs::write(&path, &bytes).unwrap();
        assert_eq!(BalProblem::read(&path).unwrap(), problem);
        fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(BalProblem::read(&path).unwrap_err().to_string().contains("problem.txt.bz2"));
    }

    #[test]
    fn faults_name_the_line() {
        for (text, line, part) in [
            ("1 2".to_owned(), 1, "number of observations"),
            (TEXT.replace("0 1 1.5", "0 2 1.5"), 3, "index of a point is 2"),
            (TEXT.replace("1.5", "x"), 3, "\"x\""),
            (TEXT.replace("1.5", "nan"), 3, "\"nan\""),
            (TEXT.replace("500\n", "\n"), 18, "ends before"),
            (format!("{TEXT}7"), 19, "\"7\""),
        ] {
            let message = parse(&text).unwrap_err().to_string();
            assert!(message.contains(&format!("problem.txt:{line}:")) && message.contains(part), "{message}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_no_panic(bytes in proptest::collection::vec(any::<u8>(), 0..99), text in "[0-9 .e\n-]{0,99}") {
            let _ = BalProblem::parse(Path::new("x"), &bytes);
            let _ = parse(&text);
        }
    }
}
