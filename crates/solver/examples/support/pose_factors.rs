//! The graph of a g2o file: its objective, its start, and the certificate of its optimum.

use std::collections::HashMap;
use std::error::Error;

use depthcal_solver::pose_graph::{
    BetweenPlane, BetweenSpace, Certificate, ChordalPlane, ChordalSpace, RelativePose, RigidMotion, certify,
    chordal_start, tree_start,
};
use depthcal_solver::{Batch, Graph, Key, Values};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::g2o::{G2oGraph, Se2Edge, Se3Edge};

/// The sum of squares that is minimised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objective {
    /// That of g2o, with the information matrices of the file.
    G2o,
    /// That of SE-Sync, with isotropic precisions.
    Chordal,
}

/// A graph, its variables in the file's order, and its measurements by index of the pose.
pub struct PoseGraph {
    pub graph: Graph,
    pub values: Values,
    plane: Vec<Key<Vector3<f64>>>,
    space: Vec<Key<Isometry3<f64>>>,
    in_plane: Vec<RelativePose<2>>,
    in_space: Vec<RelativePose<3>>,
}

fn isometry(translation: &[f64; 3], [w, x, y, z]: [f64; 4]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(Vector3::from(*translation)), rotation)
}

/// The graph of a file with g2o's objective and the file's start. If it fixes no vertex, the first one is fixed.
#[allow(dead_code, reason = "the example has a choice")]
pub fn build(file: G2oGraph) -> Result<(Graph, Values), Box<dyn Error>> {
    let PoseGraph { graph, values, .. } = PoseGraph::new(&file, Objective::G2o)?;
    Ok((graph, values))
}

impl PoseGraph {
    /// The graph of a file, with its start.
    pub fn new(file: &G2oGraph, objective: Objective) -> Result<Self, Box<dyn Error>> {
        let mut values = Values::new();
        let plane: Vec<_> = file.se2_vertices.iter().map(|v| values.insert(Vector3::from(v.pose))).collect();
        let space: Vec<_> =
            file.se3_vertices.iter().map(|v| values.insert(isometry(&v.translation, v.rotation))).collect();
        let plane_index: HashMap<usize, usize> = file.se2_vertices.iter().enumerate().map(|(i, v)| (v.id, i)).collect();
        let space_index: HashMap<usize, usize> = file.se3_vertices.iter().enumerate().map(|(i, v)| (v.id, i)).collect();
        let mut result = Self { graph: Graph::new(), values, plane, space, in_plane: Vec::new(), in_space: Vec::new() };
        let (mut between_plane, mut chordal_plane) = (Batch::new("in the plane"), Batch::new("in the plane, chordal"));
        for Se2Edge { from, to, measurement, information } in &file.se2_edges {
            let (i, j) = (plane_index[from], plane_index[to]);
            let keys = (result.plane[i], result.plane[j]);
            let measured = RelativePose::in_plane(i, j, *measurement, information)?;
            if objective == Objective::G2o {
                between_plane.push(BetweenPlane::new(*measurement, information), keys);
            } else {
                chordal_plane.push(ChordalPlane::new(&measured), keys);
            }
            result.in_plane.push(measured);
        }
        let (mut between_space, mut chordal_space) = (Batch::new("in space"), Batch::new("in space, chordal"));
        for Se3Edge { from, to, translation, rotation, information } in &file.se3_edges {
            let (i, j) = (space_index[from], space_index[to]);
            let (keys, motion) = ((result.space[i], result.space[j]), isometry(translation, *rotation));
            let measured = RelativePose::in_space(i, j, &motion, information)?;
            if objective == Objective::G2o {
                between_space.push(BetweenSpace::new(&motion, information), keys);
            } else {
                chordal_space.push(ChordalSpace::new(&measured), keys);
            }
            result.in_space.push(measured);
        }
        result.graph.add_batch(between_plane);
        result.graph.add_batch(chordal_plane);
        result.graph.add_batch(between_space);
        result.graph.add_batch(chordal_space);
        let (plane, space) = (&result.plane, &result.space);
        for id in &file.fixed {
            plane_index.get(id).into_iter().for_each(|i| result.graph.fix(plane[*i]));
            space_index.get(id).into_iter().for_each(|i| result.graph.fix(space[*i]));
        }
        if file.fixed.is_empty() {
            plane.first().into_iter().for_each(|key| result.graph.fix(*key));
            space.first().into_iter().for_each(|key| result.graph.fix(*key));
        }
        Ok(result)
    }

    /// Replaces the start by that of the chordal relaxation, or by measurements chained from the first pose on.
    pub fn start(&mut self, chordal: bool) -> Result<(), Box<dyn Error>> {
        if !self.plane.is_empty() {
            let (count, measured) = (self.plane.len(), &self.in_plane);
            let start = if chordal { chordal_start(count, measured) } else { tree_start(count, measured) }?;
            self.plane.iter().zip(start).for_each(|(key, pose)| self.values.set(*key, pose.into()));
        }
        if !self.space.is_empty() {
            let (count, measured) = (self.space.len(), &self.in_space);
            let start = if chordal { chordal_start(count, measured) } else { tree_start(count, measured) }?;
            self.space.iter().zip(start).for_each(|(key, pose)| self.values.set(*key, pose.into()));
        }
        Ok(())
    }

    /// The poses as lines of g2o.
    #[allow(dead_code, reason = "tests do not write")]
    pub fn vertices(&self, file: &G2oGraph, values: &Values) -> String {
        let plane = self.plane.iter().zip(&file.se2_vertices).map(|(key, v)| {
            let pose = values.get(*key);
            format!("VERTEX_SE2 {} {} {} {}\n", v.id, pose.x, pose.y, pose.z)
        });
        let space = self.space.iter().zip(&file.se3_vertices).map(|(key, v)| {
            let (t, q) = (values.get(*key).translation, values.get(*key).rotation);
            format!("VERTEX_SE3:QUAT {} {} {} {} {} {} {} {}\n", v.id, t.x, t.y, t.z, q.i, q.j, q.k, q.w)
        });
        plane.chain(space).collect()
    }

    /// How far values are from the global optimum of the chordal objective: of poses in the plane, or in space without those.
    pub fn certify(&self, values: &Values) -> Result<Certificate, Box<dyn Error>> {
        if self.plane.is_empty() {
            let poses: Vec<RigidMotion<3>> = self.space.iter().map(|key| (*values.get(*key)).into()).collect();
            return Ok(certify(&poses, &self.in_space)?);
        }
        let poses: Vec<RigidMotion<2>> = self.plane.iter().map(|key| (*values.get(*key)).into()).collect();
        Ok(certify(&poses, &self.in_plane)?)
    }
}
