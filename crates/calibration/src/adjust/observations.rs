//! The factors of one camera: its markers and depth samples with their standard deviations.

use std::sync::Arc;

use depthcal_model::Target;
use depthcal_model::chain::{Chain, DepthQuery, Workspace};
use depthcal_solver::{Graph, Key, Loss};
use nalgebra::Isometry3;
use rayon::prelude::*;

use super::blocks::{BlockKeys, is_depth_only};
use super::camera_keys::CameraKeys;
use super::factors::{BlockVariables, CameraVariables, FrameGroup, FrameView, ObservationBatch, Observations};
use super::field_cells::{cell_chain, cell_groups};
use super::problem::CameraProblem;
use crate::observe::noise::NoiseModel;
use crate::observe::{AdjustableFrame, DepthSample, DetectedFrame};

/// Residuals beyond this many standard deviations lose influence (Huber's loss): clean data are hardly touched.
pub const HUBER: f64 = 3.0;

/// Adds the batches of a camera's markers and depth samples.
pub(super) fn add_observations<F: AdjustableFrame>(
    problem: &CameraProblem<'_, F>,
    keys: &mut CameraKeys,
    poses: &[Key<Isometry3<f64>>],
    graph: &mut Graph,
) {
    let by_node = keys.by_node();
    let chain = Arc::new(if by_node { cell_chain(problem.camera) } else { problem.camera.chain() });
    let variables = CameraVariables { chain, extrinsics: keys.extrinsics, drift: keys.drift, offset: keys.offset };
    let whole: Vec<_> =
        keys.blocks.iter().filter_map(|b| if let BlockKeys::Whole(key) = b { Some(*key) } else { None }).collect();
    let image_blocks = problem.camera.blocks().iter().filter(|b| !is_depth_only(b)).count();
    let (in_image, whole): (BlockVariables, BlockVariables) =
        (whole[..image_blocks.min(whole.len())].into(), whole.into());
    let frames: Vec<(&F, FrameView)> = problem
        .capture
        .frames
        .iter()
        .zip(&problem.views)
        .map(|(f, view)| (f, FrameView { pose: poses[view.frame], drifted: view.drifted, moving: view.moving }))
        .collect();
    let name = |kind: &str| problem.name.map_or_else(|| kind.to_owned(), |camera| format!("{camera}/{kind}"));
    let with_markers = frames.iter().filter(|(f, _)| !f.posed().markers.is_empty());
    let groups: Vec<FrameGroup> = with_markers
        .map(|(f, view)| FrameGroup {
            view: *view,
            blocks: in_image.clone(),
            observed: markers(&problem.capture.target, f.posed(), problem.noise),
        })
        .collect();
    let loss = Loss::Huber { delta: HUBER };
    if !groups.is_empty() || problem.name.is_none() {
        keys.image =
            Some(graph.add_batch(ObservationBatch::of_markers(name("image"), variables.clone(), groups, loss.clone())));
    }
    if !problem.with_depth {
        return;
    }
    let whole_chain = problem.camera.chain();
    let sampled: Vec<_> = frames.into_iter().filter(|(f, _)| !f.samples().is_empty()).collect();
    let group = |(f, view): &(&F, FrameView)| {
        let sigmas = DepthSigmas { problem, chain: &whole_chain, pose: &f.posed().camera_from_board };
        if !by_node {
            return vec![FrameGroup { view: *view, blocks: whole.clone(), observed: sigmas.observations(f.samples()) }];
        }
        let cells = cell_groups(f.samples(), &keys.blocks).into_iter();
        cells
            .map(|(samples, blocks)| FrameGroup { view: *view, blocks, observed: sigmas.observations(samples) })
            .collect()
    };
    let groups: Vec<FrameGroup> = sampled.par_iter().flat_map_iter(group).collect();
    keys.depth_sigmas = groups.iter().flat_map(|group| group.observed.sigmas()).copied().collect();
    // The samples of a frame share the error of its plane and are not independent. One factor for all of them corrects the
    // weight of depth relative to the markers (the magnitude adjustment of a composite likelihood; Pauli, Racugno,
    // Ventura 2011).
    let loss = loss.scaled(1.0 / problem.noise.planes.design_effect);
    keys.depth = Some(graph.add_batch(ObservationBatch::of_depth(name("depth"), variables, groups, loss)));
}

fn markers(target: &Target, frame: &DetectedFrame, noise: &NoiseModel) -> Observations {
    Observations::Markers {
        points: frame.markers.iter().map(|m| target.point(m.index)).collect(),
        pixels: frame.markers.iter().map(|m| m.pixel).collect(),
        sigmas: frame.markers.iter().map(|m| m.std_px * noise.pixel_sigma).collect(),
    }
}

/// The standard deviations of the depth samples of a frame with this pose, `camera_from_board`.
struct DepthSigmas<'a, F> {
    problem: &'a CameraProblem<'a, F>,
    /// The camera's chain with all parameters of its fields.
    chain: &'a Chain,
    pose: &'a Isometry3<f64>,
}

impl<F> DepthSigmas<'_, F> {
    /// Depth samples with the standard deviations that the noise law gives them at the inverse depth that the start values
    /// predict: at the measured one, samples with an error towards far would weigh more than those towards near.
    fn observations(&self, samples: &[DepthSample]) -> Observations {
        let inverse_depths: Vec<f64> = samples.iter().map(|s| 1.0 / s.depth_mm).collect();
        let queries: Vec<DepthQuery> =
            samples.iter().map(|s| DepthQuery { board_seed: s.board_seed, context: s.context }).collect();
        let predicted = self.predicted(&queries);
        let noise = &self.problem.noise.depth;
        let sigmas = predicted.as_ref().unwrap_or(&inverse_depths).iter().map(|rho| noise.sigma(*rho)).collect();
        Observations::Depth { queries, inverse_depths, sigmas }
    }

    /// Inverse depths under the start values, 1/mm; `None` where they cannot be evaluated: the solver then meets the same error
    /// and says which.
    fn predicted(&self, queries: &[DepthQuery]) -> Option<Vec<f64>> {
        let mut work = Workspace::default();
        let mut predicted = vec![0.0; queries.len()];
        let mut points = vec![[0.0; 2]; queries.len()];
        let theta = self.problem.camera.theta();
        self.chain.depth(&mut work, &theta, self.pose, queries, &mut predicted, &mut points, None).ok()?;
        Some(predicted)
    }
}
