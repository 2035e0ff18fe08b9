//! Pose graphs in the text format of g2o (Kümmerle, Grisetti, Strasdat, Konolige, Burgard 2011).

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::FileError;
use crate::numbers::{Words, line_error, utf8};

/// A pose graph, in the plane, in space, or both.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct G2oGraph {
    /// Poses in the plane, in the file's order.
    pub se2_vertices: Vec<Se2Vertex>,
    /// Relative poses in the plane; both ends are in `se2_vertices`.
    pub se2_edges: Vec<Se2Edge>,
    /// Poses in space, in the file's order.
    pub se3_vertices: Vec<Se3Vertex>,
    /// Relative poses in space; both ends are in `se3_vertices`.
    pub se3_edges: Vec<Se3Edge>,
    /// Vertices to hold; all of them exist.
    pub fixed: BTreeSet<usize>,
}

/// `VERTEX_SE2`: a pose in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Se2Vertex {
    /// Identifier.
    pub id: usize,
    /// x, y, angle in rad.
    pub pose: [f64; 3],
}

/// `EDGE_SE2`: the pose of `to` in the frame of `from`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Se2Edge {
    /// Identifier of the vertex whose frame it is.
    pub from: usize,
    /// Identifier of the vertex that is seen.
    pub to: usize,
    /// x, y, angle in rad.
    pub measurement: [f64; 3],
    /// Information (inverse covariance) of x, y, angle.
    pub information: [[f64; 3]; 3],
}

/// `VERTEX_SE3:QUAT`: a pose in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Se3Vertex {
    /// Identifier.
    pub id: usize,
    /// Translation.
    pub translation: [f64; 3],
    /// Rotation, unit quaternion [w, x, y, z]; the file has x y z w, not always of length 1.
    pub rotation: [f64; 4],
}

/// `EDGE_SE3:QUAT`: the pose of `to` in the frame of `from`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Se3Edge {
    /// Identifier of the vertex whose frame it is.
    pub from: usize,
    /// Identifier of the vertex that is seen.
    pub to: usize,
    /// Translation.
    pub translation: [f64; 3],
    /// Rotation, unit quaternion [w, x, y, z].
    pub rotation: [f64; 4],
    /// Information of the translation and, in g2o's convention, of the quaternion's vector part (half the rotation
    /// vector for small angles).
    pub information: [[f64; 6]; 6],
}

impl G2oGraph {
    /// Reads a graph of `VERTEX_SE2`, `EDGE_SE2`, `VERTEX_SE3:QUAT`, `EDGE_SE3:QUAT` and `FIX` lines; empty lines and
    /// lines that start with `#` are skipped.
    ///
    /// # Errors
    /// [`FileError::Read`]; [`FileError::Line`] names the line that does not follow the format, has another tag, or
    /// refers to a vertex that is not there.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let path = path.as_ref();
        let bytes = fs::read(path).map_err(|error| FileError::Read { path: path.to_owned(), error })?;
        Self::parse(path, &bytes)
    }

    /// Parses the contents of `path`, which is only named in errors.
    ///
    /// # Errors
    /// [`FileError::Line`].
    pub fn parse(path: &Path, text: &[u8]) -> Result<Self, FileError> {
        let mut graph = G2oGraph::default();
        let (mut plane, mut space) = (BTreeSet::new(), BTreeSet::new());
        // A vertex may come after what refers to it, so references are checked at the end.
        let mut references: Vec<(usize, usize, &str)> = Vec::new();
        for (i, line) in utf8(path, text)?.lines().enumerate() {
            let number = i + 1;
            let mut words = Words::new(path, line, number);
            let Some(tag) = words.next().filter(|tag| !tag.starts_with('#')) else { continue };
            match tag {
                "VERTEX_SE2" | "VERTEX_SE3:QUAT" => {
                    let id = words.count("the id of a vertex")?;
                    if plane.contains(&id) || space.contains(&id) {
                        return Err(words.error(format_args!("there is a vertex {id} already")));
                    }
                    if tag == "VERTEX_SE2" {
                        plane.insert(id);
                        graph.se2_vertices.push(Se2Vertex { id, pose: words.numbers("x, y or angle")? });
                    } else {
                        space.insert(id);
                        let (translation, rotation) = pose_in_space(&mut words)?;
                        graph.se3_vertices.push(Se3Vertex { id, translation, rotation });
                    }
                }
                "EDGE_SE2" | "EDGE_SE3:QUAT" => {
                    let from = words.count("the id of a vertex")?;
                    let to = words.count("the id of a vertex")?;
                    references.extend([(number, from, tag), (number, to, tag)]);
                    if tag == "EDGE_SE2" {
                        let measurement = words.numbers("x, y or angle")?;
                        let information = information(&mut words)?;
                        graph.se2_edges.push(Se2Edge { from, to, measurement, information });
                    } else {
                        let (translation, rotation) = pose_in_space(&mut words)?;
                        let information = information(&mut words)?;
                        graph.se3_edges.push(Se3Edge { from, to, translation, rotation, information });
                    }
                }
                "FIX" => {
                    let mut word = Some(words.count("the id of a vertex")?);
                    while let Some(id) = word {
                        references.push((number, id, tag));
                        graph.fixed.insert(id);
                        word = words
                            .next()
                            .map(|text| text.parse().map_err(|_| not_an_id(path, number, text)))
                            .transpose()?;
                    }
                }
                _ => {
                    let known = "VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT and FIX";
                    return Err(words.error(format_args!("unknown tag \"{tag}\": known are {known}")));
                }
            }
            words.end()?;
        }
        for (line, id, tag) in references {
            let known = match tag {
                "EDGE_SE2" => plane.contains(&id),
                "EDGE_SE3:QUAT" => space.contains(&id),
                _ => plane.contains(&id) || space.contains(&id),
            };
            if !known {
                return Err(line_error(
                    path,
                    line,
                    format_args!("{tag} refers to vertex {id}, which is not in the file"),
                ));
            }
        }
        Ok(graph)
    }
}

fn not_an_id(path: &Path, line: usize, text: &str) -> FileError {
    line_error(path, line, format_args!("\"{text}\" should be the id of a vertex, a whole number"))
}

fn pose_in_space(words: &mut Words<'_>) -> Result<([f64; 3], [f64; 4]), FileError> {
    let translation = words.numbers("a translation")?;
    let [x, y, z, w] = words.numbers("a quaternion's element")?;
    let norm = [x, y, z, w].iter().map(|q: &f64| q * q).sum::<f64>().sqrt();
    // Files are rounded; anything farther from 1 is no rotation.
    if (norm - 1.0).abs() > 0.01 {
        return Err(words.error(format_args!("the quaternion qx qy qz qw has length {norm}, expected 1")));
    }
    Ok((translation, [w, x, y, z].map(|q| q / norm)))
}

/// The upper triangle, row by row, as a full matrix.
fn information<const N: usize>(words: &mut Words<'_>) -> Result<[[f64; N]; N], FileError> {
    let mut matrix = [[0.0; N]; N];
    for i in 0..N {
        for j in i..N {
            let value = words.number("an element of the information matrix")?;
            if i == j && value < 0.0 {
                return Err(
                    words.error(format_args!("the information matrix has {value} on its diagonal, expected 0 or more"))
                );
            }
            matrix[i][j] = value;
            matrix[j][i] = value;
        }
    }
    Ok(matrix)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PLANE: &str = "# made by hand\nVERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1.5 0 -0.5\n\nFIX 0\n\
                         EDGE_SE2 0 1 1.5 0.25 -0.5 1 2 3 4 5 6\n";
    const SPACE: &str = "EDGE_SE3:QUAT 7 8 1 2 3 0 0 0.6 0.8 1 0 0 0 0 9 2 0 0 0 0 3 0 0 0 4 0 0 5 0 6\n\
                         VERTEX_SE3:QUAT 7 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 8 1 2 3 0 0 0.6001 0.8\n";

    fn parse(text: &str) -> Result<G2oGraph, FileError> {
        G2oGraph::parse(Path::new("graph.g2o"), text.as_bytes())
    }

    #[test]
    fn reads_the_plane() {
        let graph = parse(PLANE).unwrap();
        assert_eq!(graph.se2_vertices[1], Se2Vertex { id: 1, pose: [1.5, 0.0, -0.5] });
        assert_eq!(graph.fixed, BTreeSet::from([0]));
        let edge = graph.se2_edges[0];
        assert_eq!((edge.from, edge.to, edge.measurement), (0, 1, [1.5, 0.25, -0.5]));
        assert_eq!(edge.information, [[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]]);
    }

    #[test]
    fn reads_space() {
        let graph = parse(SPACE).unwrap();
        assert_eq!(graph.se3_vertices[0].rotation, [1.0, 0.0, 0.0, 0.0]);
        let norm: f64 = graph.se3_vertices[1].rotation.iter().map(|q| q * q).sum();
        assert!((norm - 1.0).abs() < 1e-15);
        let edge = graph.se3_edges[0];
        assert_eq!((edge.translation, edge.rotation), ([1.0, 2.0, 3.0], [0.8, 0.0, 0.0, 0.6]));
        assert_eq!((edge.information[0][5], edge.information[5][0], edge.information[5][5]), (9.0, 9.0, 6.0));
    }

    #[test]
    fn faults_name_the_line() {
        for (text, line, part) in [
            (PLANE.replace("EDGE_SE2 0 1", "EDGE_SE2 0 2"), 6, "vertex 2"),
            (PLANE.replace("FIX 0", "FIX 0 5"), 5, "vertex 5"),
            (PLANE.replace("FIX 0", "FIX x"), 5, "\"x\""),
            (PLANE.replace("VERTEX_SE2 1 1.5", "VERTEX_SE2 1 ?"), 3, "\"?\""),
            (PLANE.replace("VERTEX_SE2 1", "VERTEX_SE2 0"), 3, "already"),
            (PLANE.replace(" 5 6", " 5"), 6, "ends before"),
            (PLANE.replace(" 5 6", " 5 6 7"), 6, "\"7\""),
            (PLANE.replace(" 5 6", " 5 -6"), 6, "diagonal"),
            (PLANE.replace("FIX", "VERTEX_XY"), 5, "unknown tag \"VERTEX_XY\""),
            (SPACE.replace("0 0 0 1\n", "0 0 0 0\n"), 2, "length 0"),
            (SPACE.replace("VERTEX_SE3:QUAT 7 0 0 0 0 0 0 1", "VERTEX_SE2 7 0 0 0"), 1, "vertex 7"),
        ] {
            let message = parse(&text).unwrap_err().to_string();
            assert!(message.contains(&format!("graph.g2o:{line}:")) && message.contains(part), "{message}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_no_panic(bytes in proptest::collection::vec(any::<u8>(), 0..99), numbers in "[0-9 .e-]{0,60}") {
            let _ = G2oGraph::parse(Path::new("x"), &bytes);
            for tag in ["VERTEX_SE2", "EDGE_SE2", "VERTEX_SE3:QUAT", "EDGE_SE3:QUAT", "FIX"] {
                let _ = parse(&format!("{tag} {numbers}"));
            }
        }
    }
}
