//! Start values of a pose graph by chaining measurements.

use std::collections::VecDeque;

use crate::pose_graph::error::PoseGraphError;
use crate::pose_graph::relative_pose::{RelativePose, check_ends};
use crate::pose_graph::rigid_motion::RigidMotion;

/// Start values of `count` poses: measured relative poses, chained from the first pose, the identity, along a tree of shortest
/// chains. Of measurements that would do, the first one is taken.
///
/// # Errors
/// [`PoseGraphError::Ends`]; [`PoseGraphError::Disconnected`].
pub fn tree_start<const D: usize>(
    count: usize,
    measurements: &[RelativePose<D>],
) -> Result<Vec<RigidMotion<D>>, PoseGraphError> {
    check_ends(count, measurements)?;
    let mut incident: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (index, m) in measurements.iter().enumerate() {
        incident[m.from].push(index);
        incident[m.to].push(index);
    }
    let mut poses: Vec<Option<RigidMotion<D>>> = vec![None; count];
    let mut queue = VecDeque::new();
    if let Some(first) = poses.first_mut() {
        *first = Some(RigidMotion::identity());
        queue.push_back((0, RigidMotion::identity()));
    }
    while let Some((index, pose)) = queue.pop_front() {
        for m in incident[index].iter().map(|i| &measurements[*i]) {
            let (other, step) = if m.from == index { (m.to, m.motion) } else { (m.from, m.motion.inverse()) };
            if poses[other].is_none() {
                let next = pose.compose(&step);
                poses[other] = Some(next);
                queue.push_back((other, next));
            }
        }
    }
    match poses.iter().position(Option::is_none) {
        Some(pose) => Err(PoseGraphError::Disconnected { pose }),
        None => Ok(poses.into_iter().flatten().collect()),
    }
}
