//! Reader of pose graphs in the text format of g2o (Kümmerle, Grisetti, Strasdat, Konolige, Burgard 2011).

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::words::{ProblemFileError, Words, line_error, utf8};

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
    /// Identifiers of fixed vertices; all of them exist.
    pub fixed: BTreeSet<usize>,
    /// Whether the file has edges alone. Vertices are then those that edges refer to, ascending, and all at the origin.
    pub without_vertices: bool,
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
    /// lines that start with `#` are skipped. A file may have edges alone.
    ///
    /// # Errors
    /// [`ProblemFileError::Read`]; [`ProblemFileError::Line`] names the line that does not follow the format, has another tag, or
    /// refers to a vertex that is not there.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, ProblemFileError> {
        let path = path.as_ref();
        let bytes = fs::read(path).map_err(|error| ProblemFileError::Read { path: path.to_owned(), error })?;
        Self::parse(path, &bytes)
    }

    /// Parses the contents of a file; `path` only appears in errors.
    ///
    /// # Errors
    /// [`ProblemFileError::Line`].
    pub fn parse(path: &Path, text: &[u8]) -> Result<Self, ProblemFileError> {
        let mut graph = G2oGraph::default();
        let (mut plane, mut space) = (BTreeSet::new(), BTreeSet::new());
        // A vertex may come after lines that refer to it, so references are checked at the end.
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
        if plane.is_empty() && space.is_empty() {
            graph.add_vertices(&mut plane, &mut space);
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

    /// Adds the vertices that edges refer to, with their ids.
    fn add_vertices(&mut self, plane: &mut BTreeSet<usize>, space: &mut BTreeSet<usize>) {
        plane.extend(self.se2_edges.iter().flat_map(|e| [e.from, e.to]));
        space.extend(self.se3_edges.iter().flat_map(|e| [e.from, e.to]));
        self.se2_vertices.extend(plane.iter().map(|id| Se2Vertex { id: *id, pose: [0.0; 3] }));
        let (translation, rotation) = ([0.0; 3], [1.0, 0.0, 0.0, 0.0]);
        self.se3_vertices.extend(space.iter().map(|id| Se3Vertex { id: *id, translation, rotation }));
        self.without_vertices = true;
    }
}

fn not_an_id(path: &Path, line: usize, text: &str) -> ProblemFileError {
    line_error(path, line, format_args!("\"{text}\" should be the id of a vertex, a whole number"))
}

fn pose_in_space(words: &mut Words<'_>) -> Result<([f64; 3], [f64; 4]), ProblemFileError> {
    let translation = words.numbers("a translation")?;
    let [x, y, z, w] = words.numbers("a quaternion's element")?;
    let norm = [x, y, z, w].iter().map(|q: &f64| q * q).sum::<f64>().sqrt();
    // Numbers in files are rounded; a length farther from 1 is an error.
    if (norm - 1.0).abs() > 0.01 {
        return Err(words.error(format_args!("the quaternion qx qy qz qw has length {norm}, expected 1")));
    }
    Ok((translation, [w, x, y, z].map(|q| q / norm)))
}

/// Reads the upper triangle of a symmetric matrix, row by row, and returns the full matrix.
fn information<const N: usize>(words: &mut Words<'_>) -> Result<[[f64; N]; N], ProblemFileError> {
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
